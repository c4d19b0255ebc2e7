"""A capture's depth as a cloud of oriented points with confidences."""

from dataclasses import dataclass

import numpy as np

from glint.storage.export.axes import CAMERA_AXES, OPTICAL_AXES, Frame, conversion, converted_unit
from glint.storage.export.camera import CaptureCamera

MAX_SLOPE_DEG = 85.0
"""Angle between normal and line of sight beyond which a pixel, at the silhouette, has no reliable depth: it lies far
behind the surface beside it."""


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud:
    """Points of a surface.

    points: (N, 3) float32 in `unit`; normals: (N, 3) float32, unit length, away from the surface; confidence: (N,)
    float32, the probability that the normal's error is below 5 degrees.
    unit: "mm", "m" or "pixels"; frame: the frame of reference, "camera" (x right, y up, z towards the camera), "opencv"
    or "ros_optical" (x right, y down, z ahead).
    """

    points: np.ndarray
    normals: np.ndarray
    confidence: np.ndarray
    unit: str
    frame: Frame = "camera"

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.points)

    def __repr__(self) -> str:
        """Return the number of points, their extent and the frame of reference."""
        axes = CAMERA_AXES if self.frame == "camera" else OPTICAL_AXES
        extent = np.ptp(self.points, axis=0) if len(self) else np.zeros(3)
        size = " x ".join(f"{length:.4g}" for length in extent)
        return f"<PointCloud of {len(self):,} points, {size} {self.unit}, frame {self.frame!r} ({axes})>"

    def in_frame(self, frame: Frame) -> "PointCloud":
        """Return the cloud in another frame of reference; "ros_optical" counts in metres.

        Raises:
            ValueError: the cloud is not in the camera frame, no such frame, or the cloud is in pixels.
        """
        if frame == self.frame:
            return self
        if self.frame != "camera":
            raise ValueError(f"the cloud is in frame {self.frame!r} already: convert that of the camera frame")
        matrix = conversion(frame, self.unit)[:3, :3]
        points = (self.points @ matrix.T).astype(np.float32)
        normals = self.normals * np.sign(np.diagonal(matrix)).astype(np.float32)
        return PointCloud(points, normals, self.confidence, converted_unit(frame, self.unit), frame)


def point_cloud_of(
    camera: CaptureCamera,
    depth: np.ndarray,
    normals: np.ndarray,
    confidence: np.ndarray,
    min_confidence: float = 0.0,
) -> PointCloud:
    """Return the points of depth (H, W) whose normal (H, W, 3) is known with at least `min_confidence`.

    confidence: (H, W) in 0..1. Points are in the camera frame, row by row. Pixels steeper than MAX_SLOPE_DEG, at the
    silhouette, are left out.
    """
    is_confident = np.nan_to_num(confidence, nan=-1.0) >= min_confidence
    kept = has_surface(camera, depth, normals) & is_confident
    return PointCloud(camera.points(depth)[kept], normals[kept], confidence[kept], camera.unit)


def has_surface(camera: CaptureCamera, depth: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the pixels (H, W) bool with depth (H, W) and a normal (H, W, 3) not steeper than MAX_SLOPE_DEG."""
    if camera.matrix is None:
        cosines = normals[..., 2]
    else:
        points = camera.points(depth)
        cosines = -(points * normals).sum(axis=-1) / np.linalg.norm(points, axis=-1)
    return np.isfinite(depth) & (np.nan_to_num(cosines, nan=-1.0) >= np.cos(np.radians(MAX_SLOPE_DEG)))
