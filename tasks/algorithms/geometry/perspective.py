"""Perspective camera: every pixel has its own view vector, and a sphere projects to an ellipse.

Half vectors are stored relative to the optical axis V0 = (0, 0, 1), one per frame, for either camera model.
`half_vectors_for_view` converts them to a pixel's own view vector. Normals are labelled in a per-pixel frame whose
z axis is that view vector (`rotate_to_view`): there an occluding-contour normal has n_z = 0, and the gradient of a
smooth surface is that of the logarithm of its distance.

Source: the pinhole camera of Hartley and Zisserman 2004 (chapter 6; a sphere's contour: section 8.3) in place of the
orthographic camera of Yeung et al. 2009, section 3.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from glint.tasks.algorithms.geometry.vectors import half_vectors_of, lights_of, positions_at, unit

CAMERA_FLIP = np.array([1.0, -1.0, -1.0])
"""Factors between the camera frame (y up, z towards the camera) and that of camera matrices (y down, z forward)."""
Z_AXIS = np.array([0.0, 0.0, 1.0])

ELLIPSE_ITERATIONS = 8
"""Fixed-point steps in which a cone is fitted to its ellipse; the error shrinks at least tenfold in each."""
MAX_SINE_RATIO = 0.9
"""Upper bound of the sine of a cone's half angle while it is fitted, relative to the cosine of its axis' angle with the
line of sight: at 1 the contour is a parabola, no ellipse."""
VIRTUAL_HALF_WIDTH = 1.6
"""Half the width of a virtual camera's image, in radii of the sphere."""


def view_vectors(camera: np.ndarray, shape: tuple[int, ...], left: float, top: float) -> np.ndarray:
    """Return the unit view vectors (H, W, 3), from the surface to the camera, of a region of the frame.

    Args:
        camera: matrix (3, 3) of the full frame, in pixels.
        shape: (H, W) of the region.
        left: column of the region's first pixel in the full frame.
        top: row of the region's first pixel in the full frame.
    """
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return _view_vectors_at(camera, columns + left, rows + top)


def to_camera_directions(x: np.ndarray, y: np.ndarray, inverse_focal: float) -> np.ndarray:
    """Return the directions (..., 3) from image positions x, y (...) to the camera, camera frame, each with z = 1.

    inverse_focal: 1 over the focal length in pixels, 0 for parallel rays; the principal point is the origin.
    """
    return np.stack([-inverse_focal * x, -inverse_focal * y, np.ones(np.shape(x))], axis=-1)


def centred_view_vectors(shape: tuple[int, ...], inverse_focal: float) -> np.ndarray:
    """Return the unit view vectors (H, W, 3) of an image of this shape whose principal point is its centre.

    inverse_focal: 1 over the focal length in pixels, 0 for parallel rays.
    """
    rows, columns = np.indices(shape, dtype=float)
    return unit(to_camera_directions(*positions_at(rows, columns, shape), inverse_focal))


def half_vectors_for_view(half_vectors: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Return half vectors (..., 3) float32 of the same lights relative to view vectors (..., 3) instead of V0."""
    return unit(lights_of(half_vectors.astype(np.float64)) + view).astype(np.float32)


def half_vectors_on_axis(normals: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Return the half vectors (..., 3) float32 relative to V0 at which normals (..., 3) show a highlight.

    This inverts `half_vectors_for_view`.
    """
    return half_vectors_of(lights_for_view(normals, view)).astype(np.float32)


def lights_for_view(normals: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Return the lights (..., 3) that normals (..., 3) reflect along view vectors (..., 3): their mirror images."""
    return np.asarray(2.0 * (normals * view).sum(axis=-1, keepdims=True) * normals - view)


def camera_in_crop(camera: np.ndarray, left: float, top: float) -> np.ndarray:
    """Return the matrix (3, 3) of a camera in the pixels of a crop whose top-left pixel is (left, top)."""
    return np.array(camera, float) - np.array([[0, 0, left], [0, 0, top], [0, 0, 0]])


def focal_length(camera: np.ndarray) -> float:
    """Return the mean focal length in pixels of a camera's matrix (3, 3)."""
    return float((camera[0, 0] + camera[1, 1]) / 2)


def areal_focal_length(camera: np.ndarray) -> float:
    """Return the focal length in pixels of square pixels as large as those of a camera's matrix (3, 3)."""
    return float(np.sqrt(camera[0, 0] * camera[1, 1]))


def aimed_along(forward: np.ndarray, camera: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the rotation (3, 3) of a camera (3, 3) to one that looks along a unit vector (3,), and its focal length.

    Both cameras have y down and z forward. In pixels, what lies in that direction is as large to both.
    """
    right = unit(np.cross([0.0, 1.0, 0.0], forward))
    focal = float(areal_focal_length(camera) / forward[2] ** 1.5)
    return np.stack([right, np.cross(forward, right), forward]), focal


def rotate_to_view(vectors: np.ndarray, view: np.ndarray | None) -> np.ndarray:
    """Rotate vectors (..., 3) by the smallest rotation that takes view vectors (..., 3) to the z axis; float32.

    Without view vectors (an orthographic camera) they are returned as they are.
    """
    return vectors if view is None else _smallest_rotation(vectors, view, Z_AXIS)


def rotate_from_view(vectors: np.ndarray, view: np.ndarray | None) -> np.ndarray:
    """Rotate vectors back to the camera frame: the inverse of `rotate_to_view`; both (..., 3), the result float32."""
    return vectors if view is None else _smallest_rotation(vectors, Z_AXIS, view)


@dataclass(frozen=True, slots=True)
class Cone:
    """Tangent cone of a sphere, with its apex at the camera.

    axis (3,): unit vector from the camera to the sphere's centre, camera frame. sine: of the cone's half angle, which
    is the sphere's radius over its distance.
    """

    axis: np.ndarray
    sine: float

    @classmethod
    def from_ellipse(cls, x: float, y: float, radius: float, camera: np.ndarray) -> "Cone":
        """Return the cone whose ellipse has the centre (x, y) and the mean radius, in pixels of a camera (3, 3).

        The ellipse's centre is not the projection of the sphere's, so both are corrected by fixed-point iteration.
        """
        cone = cls(-_view_vectors_at(camera, np.array(x), np.array(y)), 0.0)
        centre, size = np.array([x, y]), radius
        for _ in range(ELLIPSE_ITERATIONS):
            sine = float(size / areal_focal_length(camera) * abs(cone.axis[2]) ** 1.5)
            axis = -_view_vectors_at(camera, *centre)
            cone = cls(axis, min(sine, MAX_SINE_RATIO * abs(float(axis[2]))))
            projection = cone.project(camera)
            centre = centre + np.array([x, y]) - projection[:2]
            size *= radius / projection[2]
        return cone

    def sines(self, view: np.ndarray) -> np.ndarray:
        """Return the sines (...) of the angles between view vectors (..., 3) and the sphere's normals.

        They exceed 1 where the ray misses the sphere.
        """
        return np.linalg.norm(np.cross(view, self.axis), axis=-1) / self.sine

    def normals(self, view: np.ndarray) -> np.ndarray:
        """Return the sphere's unit normals (..., 3) where it is met by the rays of view vectors (..., 3).

        A ray that misses the sphere gets the normal of the nearest point of the contour.
        """
        rays = -view
        along = rays @ self.axis
        nearest = along - np.sqrt(np.maximum(along**2 - (1.0 - self.sine**2), 0.0))
        return unit(rays * nearest[..., None] - self.axis)

    def project(self, camera: np.ndarray) -> tuple[float, float, float]:
        """Return centre x, y and mean radius (of the circle of equal area) of the ellipse, in a camera's pixels."""
        right, down, forward = self.axis * CAMERA_FLIP
        denominator = forward**2 - self.sine**2
        x, y, _ = camera @ np.array([right * forward / denominator, down * forward / denominator, 1.0])
        area = self.sine**2 * np.sqrt(1.0 - self.sine**2) / denominator**1.5
        return float(x), float(y), float(np.sqrt(area * camera[0, 0] * camera[1, 1]))


@dataclass(frozen=True, slots=True)
class VirtualCamera:
    """Camera rotated so that it looks at a sphere, whose contour is then a circle.

    camera (3, 3): matrix of the real camera. matrix (3, 3): of the virtual one, whose small square image has the
    sphere at its `centre`. rotation (3, 3): from the real to the virtual camera; both have y down and z forward.
    """

    camera: np.ndarray
    matrix: np.ndarray
    rotation: np.ndarray

    @classmethod
    def aimed_at(cls, x: float, y: float, radius: float, camera: np.ndarray) -> "VirtualCamera":
        """Return a camera (3, 3) aimed at the sphere whose ellipse has that centre and mean radius; it keeps both.

        The focal length is that at which the sphere's circle has the ellipse's mean radius.
        """
        rotation, focal = aimed_along(Cone.from_ellipse(x, y, radius, camera).axis * CAMERA_FLIP, camera)
        centre = float(np.ceil(VIRTUAL_HALF_WIDTH * radius))
        matrix = np.array([[focal, 0.0, centre], [0.0, focal, centre], [0.0, 0.0, 1.0]])
        return cls(camera, matrix, rotation)

    @property
    def centre(self) -> float:
        """Column and row of the sphere's centre in the virtual image."""
        return float(self.matrix[0, 2])

    def warp(self, image: np.ndarray) -> np.ndarray:
        """Return the virtual camera's image (N, N) float32 of the real camera's image (H, W)."""
        homography = self.camera @ self.rotation.T @ np.linalg.inv(self.matrix)
        size = (2 * int(self.centre) + 1,) * 2
        flags, border = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, cv2.BORDER_REPLICATE
        return cv2.warpPerspective(image.astype(np.float32), homography, size, flags=flags, borderMode=border)

    def project_back(self, x: float, y: float, radius: float) -> tuple[float, float, float]:
        """Return centre and mean radius, in the real camera's pixels, of a contour that the virtual one sees."""
        cone = Cone.from_ellipse(x, y, radius, self.matrix)
        return Cone(self.rotation.T @ (cone.axis * CAMERA_FLIP) * CAMERA_FLIP, cone.sine).project(self.camera)


def _view_vectors_at(camera: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    rays = np.stack([x, y, np.ones(np.shape(x))], axis=-1) @ np.linalg.inv(camera).T
    return unit(-rays * CAMERA_FLIP)


def _smallest_rotation(vectors: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Rotate vectors (..., 3) by the smallest rotation that takes unit vectors `start` to `end` (..., 3); float32.

    The rotation is the product of two reflections: at `start`, then at the bisector of both.
    """
    bisector = start + end
    share = (vectors * bisector).sum(axis=-1, keepdims=True) / (1.0 + (start * end).sum(axis=-1, keepdims=True))
    rotated = vectors - share * bisector + 2.0 * (vectors * start).sum(axis=-1, keepdims=True) * end
    return rotated.astype(np.float32)
