"""Image of a perspective camera turned to look at the object, where a surface of revolution has a symmetric silhouette.

Rays through the same point stay the same, so the two images differ by a homography, and normals relative to their rays
by a turn about the ray.

Source: Hartley and Zisserman 2004, section 8.4.2 (a rotating camera); a surface of revolution is symmetric in the image
once its axis passes through the principal point (Wong, Mendonca and Cipolla 2004).
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.perspective import (
    CAMERA_FLIP,
    aimed_along,
    focal_length,
    rotate_from_view,
    rotate_to_view,
    view_vectors,
)
from glint.tasks.algorithms.geometry.vectors import unit

ROUND_PX = 3
"""Width of what lies round the silhouette in the aimed view."""


@dataclass(frozen=True, eq=False)
class AimedView:
    """Image of a camera turned to look at the silhouette; its principal point is the image's centre.

    mask: (H, W) bool, the silhouette in the camera's own image. camera: (3, 3), its matrix in pixels of these.
    rotation: (3, 3), from its frame to that of the turned camera, both with y down and z forward. focal: of the turned
    camera in pixels, at which the silhouette keeps its size.
    """

    mask: np.ndarray
    camera: np.ndarray
    rotation: np.ndarray
    focal: float

    @classmethod
    def at(cls, mask: np.ndarray, camera: np.ndarray) -> "AimedView":
        """Return the view of a camera (3, 3), in pixels of the silhouette (H, W) bool, aimed at the latter's centre."""
        row, column = np.argwhere(mask).mean(axis=0)
        forward = np.asarray(unit(np.linalg.inv(camera) @ np.array([column, row, 1.0])))
        return cls(mask, camera, *aimed_along(forward, camera))

    @cached_property
    def silhouette(self) -> np.ndarray:
        """The silhouette (H', W') bool in this view."""
        return np.asarray(self._warped(self.mask.astype(np.float32), cv2.INTER_LINEAR) >= 0.5)

    def normals(self, normals: np.ndarray) -> np.ndarray:
        """Return normals (H, W, 3), relative to the camera's rays, as those (H', W', 3) of the nearest pixel."""
        return self._warped(_turned(normals, self._turns), cv2.INTER_NEAREST, np.nan)

    def candidates(self, candidates: np.ndarray) -> np.ndarray:
        """Return candidates (K, H, W, 3) as `normals` does each of their layers."""
        return np.stack([self.normals(layer) for layer in candidates])

    def normals_back(self, normals: np.ndarray) -> np.ndarray:
        """Return normals (H', W', 3) of this view at the silhouette's pixels in the camera's image, (H, W, 3).

        Those of the nearest pixel fill gaps; NaN outside the silhouette.
        """
        missing = np.isnan(normals[..., 0])
        nearest = ndimage.distance_transform_edt(missing, return_distances=False, return_indices=True)
        result = _turned(unit(self._sampled(normals[tuple(nearest)])), -self._turns)
        return np.where(self.mask[..., None], result, np.float32(np.nan))

    def vectors_back(self, vectors: np.ndarray) -> np.ndarray:
        """Return unit vectors (H', W', 3) of this view like normals, (H, W, 3), but NaN beside where they are NaN."""
        is_known = self._sampled(np.isfinite(vectors[..., 0]).astype(np.float32), border=0.0) > 1.0 - 1e-3
        return np.where(is_known[..., None], self.normals_back(vectors), np.float32(np.nan))

    def heights_back(self, depths: np.ndarray) -> np.ndarray:
        """Return depths (H', W'), z of this view, as heights (H, W) in the camera's image: NaN outside the silhouette.

        A height is the negative logarithm of the distance along the camera's axis, times the focal length.
        """
        nearness = self._sampled(depths) / self.focal
        along = (self._rays @ self.rotation[2]) / self._rays[..., 2]
        with np.errstate(invalid="ignore"):
            heights = -focal_length(self.camera) * (np.log1p(-nearness) - np.log(along))
        return np.where(self.mask, heights, np.nan).astype(np.float32)

    def values_back(self, values: np.ndarray) -> np.ndarray:
        """Return values (H', W') of this view at the camera's pixels, (H, W) float32; 0 outside the silhouette."""
        return np.where(self.mask, self._sampled(values, border=0.0), np.float32(0.0))

    def numbers_back(self, numbers: np.ndarray) -> np.ndarray:
        """Return numbers (H', W') int16 of this view at the camera's pixels, (H, W); -1 outside the silhouette."""
        return np.where(self.mask, self._sampled(numbers, cv2.INTER_NEAREST, -1.0), -1.0).astype(np.int16)

    @cached_property
    def _view(self) -> np.ndarray:
        """View vectors (H, W, 3) of the camera's pixels."""
        return view_vectors(self.camera, self.mask.shape, 0.0, 0.0)

    @property
    def _rays(self) -> np.ndarray:
        """Unit rays (H, W, 3) of the camera's pixels, y down and z forward."""
        return -self._view * CAMERA_FLIP

    @cached_property
    def _positions(self) -> np.ndarray:
        """Positions (H, W, 2) of the camera's pixels in this view, from its principal point, y down."""
        rays = self._rays @ self.rotation.T
        return self.focal * rays[..., :2] / rays[..., 2:]

    @cached_property
    def _size(self) -> tuple[int, int]:
        """Half the width and half the height of this view, without the pixel in the middle."""
        half = np.ceil(np.abs(self._positions[self.mask]).max(axis=0)).astype(int) + ROUND_PX
        return int(half[0]), int(half[1])

    @cached_property
    def _turns(self) -> np.ndarray:
        """Angles (H, W) by which normals relative to the camera's rays turn about these to be relative to this view's.

        Either frame is turned to the ray by the smallest rotation, from another axis.
        """
        rotation = CAMERA_FLIP[:, None] * self.rotation * CAMERA_FLIP
        sideways = rotate_from_view(np.broadcast_to([1.0, 0.0, 0.0], self._view.shape), self._view)
        turned = rotate_to_view(sideways @ rotation.T, self._view @ rotation.T)
        return np.asarray(np.arctan2(turned[..., 1], turned[..., 0]))

    def _warped(self, image: np.ndarray, interpolation: int, border: float = 0.0) -> np.ndarray:
        """Return an image (H, W, ..) of the camera as this view shows it."""
        half_width, half_height = self._size
        matrix = np.array([[self.focal, 0.0, half_width], [0.0, self.focal, half_height], [0.0, 0.0, 1.0]])
        homography = self.camera @ self.rotation.T @ np.linalg.inv(matrix)
        size, flags = (2 * half_width + 1, 2 * half_height + 1), interpolation | cv2.WARP_INVERSE_MAP
        border_value = (border,) * 4
        return cv2.warpPerspective(image, homography, size, flags=flags, borderValue=border_value)

    def _sampled(self, image: np.ndarray, interpolation: int = cv2.INTER_LINEAR, border: float = np.nan) -> np.ndarray:
        """Return an image (H', W', ..) of this view at the camera's pixels; if interpolated, NaN next to NaN."""
        x, y = np.moveaxis(self._positions + self._size, -1, 0).astype(np.float32)
        return cv2.remap(image.astype(np.float32), x, y, interpolation, borderValue=(border,) * 4)


def _turned(normals: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return normals (H, W, 3) turned about the z axis by angles (H, W), radians; float32."""
    c, s = np.cos(angles), np.sin(angles)
    x, y, z = np.moveaxis(normals, -1, 0)
    return np.stack([c * x - s * y, s * x + c * y, z], axis=-1).astype(np.float32)
