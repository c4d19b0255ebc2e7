"""The camera of a capture: matrix or orthographic scale, region, distance and pose, as its stages recorded them.

Pixel coordinates are those of the full frame: the centre of the top-left pixel is (0, 0), x to the right, y down. The
camera frame is that of docs/method.md: x right, y up, z towards the camera.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from glint.storage.export.axes import CAMERA_AXES, OPTICAL_AXES, WORLD_AXES, conversion
from glint.storage.versions.stage_results import StageResult

PIXEL_CONVENTION = "the centre of the top-left pixel of the full frame is (0, 0); x to the right, y down"


@dataclass(frozen=True, slots=True)
class PixelRegion:
    """The crop of the full frame that a capture's arrays cover: column and row of its top-left pixel, and its size."""

    x: int
    y: int
    width: int
    height: int

    @property
    def rows(self) -> slice:
        """The region's rows of the full frame."""
        return slice(self.y, self.y + self.height)

    @property
    def columns(self) -> slice:
        """The region's columns of the full frame."""
        return slice(self.x, self.x + self.width)


@dataclass(frozen=True, slots=True, eq=False)
class CaptureCamera:
    """The relation between a capture's pixels, its depth and its camera frame.

    matrix: (3, 3) float64 in pixels of the full frame, without lens distortion; None: the camera is orthographic.
    region, frame_size: the arrays' crop, and width and height of the full frame, in pixels.
    pixel_size: mm per pixel (under perspective, at `distance`), None where the scale is unknown.
    unit: of depth, distance and points, "mm" or "pixels".
    distance: under perspective, the distance from the camera at which depth is 0; None: orthographic.
    camera_to_world: (4, 4) float64, the camera frame's axes and origin in the world frame; None: unknown.
    pose_source: "model" (refined when the captures were merged), "catalogue", or None.
    turntable_degrees: the turntable's nominal angle, None where the catalogue has none.
    world_unit: of the world frame, that of the object's model; None: `unit`.
    """

    matrix: np.ndarray | None
    region: PixelRegion
    frame_size: tuple[int, int]
    pixel_size: float | None
    unit: str
    distance: float | None
    camera_to_world: np.ndarray | None = None
    pose_source: Literal["model", "catalogue"] | None = None
    turntable_degrees: float | None = None
    world_unit: str | None = None

    @property
    def region_matrix(self) -> np.ndarray | None:
        """The matrix (3, 3) for pixels of the region, whose top-left pixel has its centre at (0, 0)."""
        if self.matrix is None:
            return None
        return self.matrix - np.array([[0, 0, self.region.x], [0, 0, self.region.y], [0, 0, 0]], float)

    def points(self, depth: np.ndarray) -> np.ndarray:
        """Return the points (H, W, 3) float32 of depth (H, W), in the camera frame and in `unit`; NaN where depth is.

        An orthographic camera frame has its origin at the frame's centre, and a depth that is known up to an offset. A
        perspective one has its origin at the optical centre.

        Raises:
            ValueError: depth has not the region's size.
        """
        if depth.shape != (self.region.height, self.region.width):
            raise ValueError(
                f"depth is {depth.shape}, the region {(self.region.height, self.region.width)}: give all of it"
            )
        columns, rows = np.meshgrid(
            np.arange(self.region.width, dtype=float) + self.region.x,
            np.arange(self.region.height, dtype=float) + self.region.y,
        )
        if self.matrix is None:
            (width, height), scale = self.frame_size, self.pixel_size or 1.0
            parts = ((columns - (width - 1) / 2) * scale, ((height - 1) / 2 - rows) * scale, depth)
            return np.where(np.isnan(depth)[..., None], np.nan, np.stack(parts, axis=-1)).astype(np.float32)
        # Rays have z = 1 ahead of the camera (OpenCV's axes); depth is counted backwards from `distance`.
        pixels = np.stack([columns, rows, np.ones_like(rows)], axis=-1)
        rays = pixels @ np.linalg.inv(self.matrix).T
        ahead = (self.distance or 0.0) - depth.astype(float)
        return (rays * ahead[..., None] * (1.0, -1.0, -1.0)).astype(np.float32)


def camera_of(
    results: Mapping[str, StageResult], entry: Mapping[str, Any], model: Mapping[str, Any] | None
) -> CaptureCamera | None:
    """Return the camera of a capture, None where its survey was not stored.

    results: the capture's stages by name (survey and depth are read); entry: its entry of the catalogue; model: the
    record of the object's model, None where there is none.
    """
    if "survey" not in results:
        return None
    survey, capture = results["survey"].record, results["survey"].capture
    depth = results["depth"].record if "depth" in results else {}
    pose, source = _pose(capture, entry, model)
    width, height = survey["frame_size"]
    return CaptureCamera(
        matrix=_matrix(survey, entry),
        region=PixelRegion(**{name: int(survey["region"][name]) for name in ("x", "y", "width", "height")}),
        frame_size=(int(width), int(height)),
        pixel_size=survey.get("pixel_size"),
        unit=survey.get("unit") or "pixels",
        distance=depth.get("distance"),
        camera_to_world=pose,
        pose_source=source,
        turntable_degrees=(entry.get("pose") or {}).get("turntable"),
        world_unit=(model or {}).get("unit"),
    )


def camera_facts(camera: CaptureCamera) -> dict[str, Any]:
    """Return the content of camera.json: the camera as plain JSON, with its conventions in words and as matrices."""
    perspective = camera.matrix is not None
    in_metres = camera.unit == "mm"
    return {
        "projection": "perspective" if perspective else "orthographic",
        "matrix": _listed(camera.matrix),
        "region_matrix": _listed(camera.region_matrix),
        "orthographic_scale": None
        if perspective
        else {"value": camera.pixel_size or 1.0, "unit": f"{camera.unit} per pixel"},
        "distortion": {"model": "none", "coefficients": []},
        "pixels": PIXEL_CONVENTION,
        "frame_size": {"width": camera.frame_size[0], "height": camera.frame_size[1]},
        "region": {name: getattr(camera.region, name) for name in ("x", "y", "width", "height")},
        "unit": camera.unit,
        "pixel_size_mm": camera.pixel_size,
        "depth": {
            "direction": "towards the camera",
            "zero_distance": camera.distance,
            "meaning": "distance ahead of the camera = zero_distance - depth, known up to one factor for each connected"
            " component"
            if perspective
            else "z of the camera frame = depth, known up to one offset for each connected component",
        },
        "frames": {
            "camera": {
                "axes": CAMERA_AXES,
                "origin": "the optical centre" if perspective else "the centre of the full frame, depth 0",
                "unit": camera.unit,
                "arrays": "normals, lights, half vectors, depth, surface.ply",
            },
            "opencv": {
                "axes": OPTICAL_AXES,
                "unit": camera.unit,
                "from_camera": conversion("opencv", camera.unit).tolist(),
            },
            "ros_optical": {
                "axes": OPTICAL_AXES,
                "unit": "m" if in_metres else None,
                "from_camera": conversion("ros_optical", camera.unit).tolist() if in_metres else None,
            },
            "world": {"axes": WORLD_AXES, "unit": camera.world_unit or camera.unit},
        },
        "pose": {
            "camera_to_world": _listed(camera.camera_to_world),
            "source": camera.pose_source,
            "turntable_degrees": camera.turntable_degrees,
        },
    }


def _matrix(survey: Mapping[str, Any], entry: Mapping[str, Any]) -> np.ndarray | None:
    """Return the camera matrix that the survey recorded, else that of the catalogue's entry."""
    camera = survey.get("camera") or entry.get("camera")
    if isinstance(camera, Mapping):
        camera = camera.get("matrix")
    return None if camera is None else np.array(camera, float)


def _pose(
    capture: str, entry: Mapping[str, Any], model: Mapping[str, Any] | None
) -> tuple[np.ndarray | None, Literal["model", "catalogue"] | None]:
    for view in (model or {}).get("views", ()):
        if view["capture"] == capture:
            return np.array(view["camera_to_world"], float), "model"
    matrix = (entry.get("pose") or {}).get("camera_to_world")
    return (None, None) if matrix is None else (np.array(matrix, float), "catalogue")


def _listed(matrix: np.ndarray | None) -> list[list[float]] | None:
    return None if matrix is None else matrix.tolist()
