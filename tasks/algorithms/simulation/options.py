"""What a simulated capture is like: one frozen record, every field with its unit."""

from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class CaptureOptions:
    """A capture to simulate. The defaults give a careful capture; the fields below `frames per second` degrade it."""

    width: int = 160
    """Region's width in pixels; the object is scaled to fill the region."""
    height: int = 140
    """Region's height in pixels."""
    frames: int = 600
    """Frames per view."""
    seed: int = 0
    """Of the hand, the noise, the jitter and the textures."""
    views: int = 1
    """Turntable angles, evenly spaced over 360 degrees. More than one: the camera looks level at the object."""
    balls: int = 1
    """Chrome balls in the frame: 1 (right of the object) or 2 (one on either side)."""
    ball_radius: float = 26.0
    """Radius of a chrome ball in pixels."""
    ball_diameter: float = 25.0
    """Diameter of a chrome ball in millimetres: the scale of all lengths in millimetres."""
    lamp_radius: float = 6.0
    """Angular radius of the lamp in degrees, where it is at half its brightness."""
    rays: int = 3
    """Rays per pixel are rays x rays, each jittered in its cell."""
    fps: int = 25
    """Frames per second of the video."""

    sweep_gap: float = 0.0
    """Azimuth in degrees that the hand leaves out, starting at a seeded angle."""
    lamp_distance: float | None = None
    """Distance of the lamp from the object in millimetres; None: so far that its light is parallel."""
    camera_distance: float | None = None
    """Distance of a pinhole camera in millimetres; None: orthographic."""
    exposure_drift: float = 0.0
    """Relative amplitude of a slow drift of the exposure: 0.3 is +-30%."""
    colour_drift: float = 0.0
    """Relative amplitude of a slow drift of the white balance."""
    shake: float = 0.0
    """Standard deviation of the camera's position in the image, pixels."""
    noise: float = 1.2
    """Standard deviation of the sensor's noise in 8-bit levels."""
    crf: int = 20
    """Constant rate factor of H.264: 18 looks lossless, 35 is poor."""
    bitrate: int | None = None
    """Kilobits per second, instead of `crf`."""

    def __post_init__(self) -> None:
        """Refuse what cannot be simulated."""
        checks = {
            "width": self.width >= 24,
            "height": self.height >= 24,
            "frames": self.frames >= 1,
            "views": self.views >= 1,
            "balls": self.balls in (1, 2),
            "ball_radius": self.ball_radius >= 4,
            "ball_diameter": self.ball_diameter > 0,
            "lamp_radius": 0 < self.lamp_radius <= 30,
            "rays": 1 <= self.rays <= 8,
            "fps": self.fps >= 1,
            "sweep_gap": 0 <= self.sweep_gap < 360,
            "lamp_distance": self.lamp_distance is None or self.lamp_distance > 0,
            "camera_distance": self.camera_distance is None or self.camera_distance > 0,
            "exposure_drift": 0 <= self.exposure_drift < 1,
            "colour_drift": 0 <= self.colour_drift < 1,
            "shake": self.shake >= 0,
            "noise": self.noise >= 0,
            "crf": 0 <= self.crf <= 51,
            "bitrate": self.bitrate is None or self.bitrate > 0,
        }
        for name, good in checks.items():
            if not good:
                raise ValueError(f"{name}={getattr(self, name)!r} cannot be simulated")

    @property
    def pixel_size(self) -> float:
        """Millimetres per pixel."""
        return self.ball_diameter / (2.0 * self.ball_radius)

    def quick(self) -> "CaptureOptions":
        """The same capture at about a third of its size and at most 500 frames."""
        return replace(
            self,
            width=round(self.width / 3) + 8,
            height=round(self.height / 3) + 8,
            frames=min(self.frames, 500),
            ball_radius=max(22.0, self.ball_radius / 2),
        )
