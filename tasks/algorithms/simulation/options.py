"""Options of a simulated capture, each with its unit; presets of the sizes in the paper's Tables 2 and 3."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Preset:
    """Size of the object's region in pixels and number of frames of one of the paper's captures."""

    width: int
    height: int
    frames: int


PRESETS = {
    "hemisphere": Preset(251, 221, 8000),
    "cylinder": Preset(146, 384, 4226),
    "jug": Preset(279, 419, 3870),
    "fish": Preset(259, 252, 1512),
    "wine-glass": Preset(153, 324, 3133),
    "water-glass": Preset(153, 279, 3383),
    "faceted-bottle": Preset(200, 330, 2400),
    "puppy": Preset(230, 300, 2400),
    "mug": Preset(290, 270, 2400),
}
"""Sizes and lengths of the paper's Tables 2 and 3, and of a bottle of flat faces, a figurine with overlapping limbs and
a mug with a handle, which are not in the paper."""
SHAPES = (
    *PRESETS,
    "goblet",
    "tumbler",
    "coupe",
    "tankard",
    "pitcher",
    "hobnail-vase",
    "ribbed-bottle",
    "cut-bowl",
    "bird",
    "elephant",
    "teddy-bear",
    "hexagonal-prism",
    "cut-cube",
    "gem",
    "ring",
    "flask",
)
"""All shapes that can be simulated; those without a preset are other glasses, figurines and solids of flat faces."""
DEFAULT_PRESET = Preset(240, 220, 2000)
"""Size and length of shapes without a preset of their own."""


@dataclass(frozen=True, slots=True)
class CaptureOptions:
    """Options of simulating a shape. The defaults give a careful capture; the later fields degrade it.

    Raises:
        ValueError: an option is out of its range.
    """

    frames: int | None = None
    """Frames of each view; None: as in the preset."""
    scale: float = 1.0
    """Size relative to the preset's pixels."""
    seed: int = 0
    """Seed of the light's path, the noise, the jitter, the room and the background."""
    views: int = 1
    """Number of turntable angles, evenly spaced over 360 degrees; with more than one the camera looks level."""
    free_poses: bool = False
    """If set, cameras of several views also look from above and below; the catalogue then states matrices."""
    axis_offset: float = 0.0
    """Distance in pixels of the turntable's axis to the right of the region's centre."""
    axis_lean: float = 0.0
    """Lean of the turntable's axis in degrees, 1.5 times as much to the right as to the camera."""
    angle_error: float = 0.0
    """Largest error in degrees of the angles that the catalogue states; seeded."""
    wrong_view: int | None = None
    """Number of a view whose stated angle is 25 degrees too large; None: no view."""
    sphere_radius: float = 30.0
    """Radius of the chrome sphere in pixels."""
    spheres: int = 1
    """Number of chrome spheres: 1, to the right of the object, or 2, on both sides."""
    sphere_diameter: float = 25.0
    """Diameter of the chrome sphere in millimetres, which sets the scale."""
    light_radius: float = 5.4
    """Angular radius of the light in degrees, at which its lobe has fallen to 1/e."""
    rays: int = 2
    """Square root of the number of rays per pixel, each jittered in its cell."""
    missing_quarter: bool = False
    """If set, the light never visits one quarter of the hemisphere, chosen by the seed."""
    light_distance: float | None = None
    """Distance of the light from the frame's centre in frame widths; None: infinite."""
    focal: float | None = None
    """Focal length of the camera in frame widths (0.8: a phone), which sets its distance; None: orthographic."""
    table_tilt: float = 0.0
    """Angle in degrees between the table's normal and the camera's axis; no light comes from below the table."""
    table_contrast: float = 1.0
    """Contrast of the table's texture, as a factor; 0 is a plain table."""
    shadows: bool = False
    """If set, object and spheres stand on the table and throw shadows and caustics on it (0.2 seconds a frame)."""
    sphere_height: float = 0.0
    """Height in radii of spheres above the table, as on a holder; only with shadows, and from afar."""
    exposure_drift: float = 0.0
    """Relative amplitude of a slow drift of the exposure."""
    shake: float = 0.0
    """Amplitude of the camera's shake, a slow random walk, in pixels."""
    noise: float = 1.8
    """Standard deviation of the sensor's noise in 8-bit levels."""
    crf: int = 14
    """Constant rate factor of H.264: 18 looks lossless, 35 is poor."""
    mask_error: int = 0
    """Pixels by which the written mask is too large (negative: too small)."""

    def __post_init__(self) -> None:
        """Check all ranges."""
        checks = {
            "frames": self.frames is None or self.frames >= 2,
            "seed": self.seed >= 0,
            "scale": 0.1 <= self.scale <= 16,
            "views": 1 <= self.views <= 360,
            "free_poses": not self.free_poses or self.views > 1,
            "axis_offset": abs(self.axis_offset) <= 20,
            "axis_lean": abs(self.axis_lean) <= 10,
            "angle_error": 0 <= self.angle_error <= 30,
            "wrong_view": self.wrong_view is None or 0 <= self.wrong_view < self.views,
            "sphere_radius": 10 <= self.sphere_radius <= 2000,
            "spheres": self.spheres in (1, 2),
            "sphere_diameter": 0 < self.sphere_diameter <= 10_000,
            "light_radius": 0.5 <= self.light_radius <= 30,
            "rays": 1 <= self.rays <= 8,
            "light_distance": self.light_distance is None or 1 <= self.light_distance <= 1e6,
            "focal": self.focal is None or 0.5 <= self.focal <= 1000,
            "table_tilt": 0 <= self.table_tilt <= 80,
            "table_contrast": 0 <= self.table_contrast <= 3,
            "sphere_height": 0 <= self.sphere_height <= 20,
            "exposure_drift": 0 <= self.exposure_drift < 1,
            "shake": 0 <= self.shake <= 5,
            "noise": 0 <= self.noise <= 255,
            "crf": 0 <= self.crf <= 51,
            "mask_error": abs(self.mask_error) <= 20,
        }
        for name, good in checks.items():
            if not good:
                raise ValueError(f"{name}={getattr(self, name)!r} cannot be simulated")


DEGRADED: dict[str, dict[str, Any]] = {
    "no-defect": {},
    "500-frames": {"frames": 500},
    "quarter-missing": {"missing_quarter": True},
    "near-light": {"light_distance": 10.0, "spheres": 2},
    "near-light-one-sphere": {"light_distance": 10.0},
    "perspective": {"focal": 0.9},
    "exposure-drift": {"exposure_drift": 0.3},
    "low-bit-rate": {"crf": 35},
    "shake": {"shake": 0.5},
    "noise": {"noise": 6.0},
    "mask-too-large": {"mask_error": 3},
}
"""Degraded captures by defect: the options in which each differs from a careful one."""
