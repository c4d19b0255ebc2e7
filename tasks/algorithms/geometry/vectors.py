"""Vectors in the camera frame: normals, lights, half vectors, gradients.

Camera frame: x right, y up, z towards the camera; the origin is the centre of the full frame. Under the orthographic
camera the view vector is V = (0, 0, 1) at every pixel (Yeung et al. 2009, section 3).
"""

import numpy as np

NZ_FLOOR = 0.05
"""Lower bound of n_z in gradients, which keeps those of occluding-contour normals (n_z = 0) finite."""

MIN_TANGENT_NZ = 0.2
"""Lower bound of n_z in the derivatives of a normal by its n_x and n_y."""


def lengths(vectors: np.ndarray) -> np.ndarray:
    """Return the lengths (...) of vectors (..., 3); several times as fast as `numpy.linalg.norm` along a short axis."""
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", vectors, vectors)))


def unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors (..., 3) scaled to unit length; zero vectors become NaN."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return vectors / lengths(vectors)[..., None]


def half_vectors_of(lights: np.ndarray) -> np.ndarray:
    """Return the half vectors (..., 3) between unit light directions (..., 3) and the view vector (0, 0, 1)."""
    return unit(np.asarray(lights) + np.array([0.0, 0.0, 1.0]))


def lights_of(half_vectors: np.ndarray) -> np.ndarray:
    """Return the light directions (..., 3) that half vectors n (..., 3) reflect into V: L = 2 (n.V) n - V."""
    return 2.0 * half_vectors[..., 2:3] * half_vectors - np.array([0.0, 0.0, 1.0])


def component_derivatives(normals: np.ndarray) -> np.ndarray:
    """Return the derivatives (..., 3, 2) of unit normals (..., 3) by their n_x and n_y."""
    columns = []
    for axis in (0, 1):
        column = np.zeros_like(normals)
        column[..., axis] = 1.0
        column[..., 2] = -normals[..., axis] / np.maximum(normals[..., 2], MIN_TANGENT_NZ)
        columns.append(column)
    return np.stack(columns, axis=-1)


def gradients(normals: np.ndarray, floor: float = NZ_FLOOR) -> tuple[np.ndarray, np.ndarray]:
    """Return the gradients p = -n_x/n_z and q = -n_y/n_z (...) of normals (..., 3), n_z clamped from below to `floor`.

    Both are slopes of the depth in the camera frame (pixels per pixel), as in section 4.2 of Yeung et al. 2009.
    """
    nz = np.maximum(normals[..., 2], floor)
    return -normals[..., 0] / nz, -normals[..., 1] / nz


def equal_area(vectors: np.ndarray) -> np.ndarray:
    """Return x and y (..., 2) of unit vectors (..., 3) in Lambert's azimuthal equal-area map of the sphere.

    (0, 0, 1) is its middle, and the radius 2 sin(a / 2) at the angle a from it.
    """
    return vectors[..., :2] / np.sqrt(np.maximum((1.0 + vectors[..., 2:]) / 2.0, 1e-9))


def angles(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the angles (...) in degrees between unit vectors (..., 3).

    They follow from the chord, since the arc cosine of the dot product loses its digits for small angles.
    """
    return np.degrees(2.0 * np.arcsin(np.clip(0.5 * lengths(first - second), 0.0, 1.0)))


def nearest_angles(candidates: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the degrees (N,) from normals (N, 3) to the nearest of candidates (K, N, 3), 180 without any."""
    return np.asarray(np.nan_to_num(angles(candidates, normals[None]), nan=180.0).min(axis=0, initial=180.0))


def to_camera(columns: np.ndarray, rows: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y (...), pixels, camera frame, of columns and rows (...) of a frame of `width` x `height` pixels.

    Columns and rows count from 0 at the centre of the top-left pixel; the origin is the centre of the frame.
    """
    return columns - (width - 1) / 2, (height - 1) / 2 - rows


def positions_at(rows: np.ndarray, columns: np.ndarray, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y (...), pixels, camera frame, of the pixels at rows and columns (...) of an image of a shape."""
    return to_camera(columns.astype(float), rows.astype(float), shape[1], shape[0])


def pixel_positions(pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y (N,), pixels, camera frame, of the N pixels of a mask (H, W) bool, row by row."""
    rows, columns = np.nonzero(pixels)
    return positions_at(rows, columns, pixels.shape)


def sampled_pixels(pixels: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns (N,) of at most `count` pixels of a mask (H, W) bool, at random but always the same.

    Every n-th pixel in order would be one of a few columns of the image.
    """
    rows, columns = np.nonzero(pixels)
    chosen = np.random.default_rng(0).permutation(len(rows))[:count]
    return rows[chosen], columns[chosen]
