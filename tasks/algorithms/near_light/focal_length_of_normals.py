"""Focal length from the object's own normals: only under the right camera are they the normals of a surface.

Under a perspective camera whose matrix is not given, the spheres' highlights are read as if their view vectors were the
optical axis, and so are those of all pixels. That turns all normals by half the angle between spheres and axis, and
bends them by half of each pixel's own. A surface with turned normals is the surface turned, but its pixels stay where
they were: the gradients have a curl that grows with the inverse focal length. Least squares integration (Frankot and
Chellappa 1988) leaves the part of the gradients that no surface has; the inverse focal length that makes it least is
nearly linear in it. Normals that integrate under any camera, such as those of a plane, show no focal length: what
remains of their gradients then changes with it by no more than the noise of the normals explains.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from glint.tasks.algorithms.geometry.perspective import half_vectors_for_view, rotate_from_view, view_vectors
from glint.tasks.algorithms.geometry.vectors import half_vectors_of, lights_of, unit

MAX_SAMPLES = 160
"""Pixels along the longer side of the region at most: for larger regions, every second or third pixel is taken."""
MIN_SAMPLES = 200
"""Pairs of neighbours with normals below which nothing is estimated."""
MAX_SLANT_COSINE = np.cos(np.radians(60.0))
"""Normals slanted by more than 60 degrees are left out: their gradients are mostly noise."""
MIN_PAIR_COSINE = np.cos(np.radians(12.0))
"""Neighbours whose normals differ by more than 12 degrees belong to different sheets."""
STEP_WIDTHS, STEPS = 0.3, 2
"""Difference of inverse focal lengths, per frame width, by which the change of the gradients is measured; how often the
estimate is repeated from the one before."""
MAX_INVERSE_WIDTHS = 2.0
"""Bound of the inverse focal length, per frame width: no camera has a focal length of half a frame width."""
BLOCKS = 6
"""Blocks along each side of the region between which the standard error is estimated."""
REGULARIZATION = 1e-9
"""Added to the diagonal of the normal equations: the depth of each piece is free. It must be far less than the square
of the inverse number of samples, so that it leaves nothing of a plane."""
LEAST_NORMAL_NOISE = 1e-3
"""Least noise of the normals, radians per axis: what quantized half vectors and a smooth sheet leave of it."""
MAX_NOISE_SHARE = 0.5
"""Share of the noise in the squared change of the misfit from which the estimate shows nothing: that of planes is 1, of
domes whose estimate is right within 0.3 per frame width 0.4 at most."""


@dataclass(frozen=True, slots=True)
class InverseFocal:
    """Estimated inverse focal length and its standard deviation, 1/pixels; no true one is negative."""

    value: float
    deviation: float


@dataclass(frozen=True, slots=True)
class UnknownCamera:
    """Knowledge of a camera without matrix.

    left, top: the region's first pixel in the full frame. sphere_x, sphere_y: mean position of the spheres, likewise.
    width, height: of the full frame. principal_point: x and y in the full frame, None for its centre.
    """

    left: int
    top: int
    sphere_x: float
    sphere_y: float
    width: int
    height: int
    principal_point: tuple[float, float] | None = None

    @property
    def centre(self) -> tuple[float, float]:
        """Principal point in the full frame, x and y."""
        return self.principal_point or ((self.width - 1) / 2, (self.height - 1) / 2)

    def matrix(self, inverse_focal: float) -> np.ndarray:
        """Return the matrix (3, 3) of the camera with an inverse focal length in 1/pixels."""
        focal = 1.0 / np.copysign(max(abs(inverse_focal), 1e-9), inverse_focal)
        x, y = self.centre
        return np.array([[focal, 0.0, x], [0.0, focal, y], [0.0, 0.0, 1.0]])


def focal_length_of_normals(normals: np.ndarray, camera: UnknownCamera) -> InverseFocal | None:
    """Estimate the inverse focal length from accepted normals.

    Args:
        normals: (H, W, 3) unit, camera frame, as measured under an orthographic camera; NaN where none is accepted.
        camera: what is known.

    Returns:
        The estimate, whose deviation is at least the bound where it lies beyond that; None if too few neighbours have
        normals, or all in one block, which leaves the standard error unknown, or if they integrate under any camera.
    """
    step = max(1, -(-max(normals.shape[:2]) // MAX_SAMPLES))
    sampled = normals[::step, ::step].astype(np.float64)
    pairs = _Pairs.of(sampled)
    if len(pairs.weight) < MIN_SAMPLES:
        return None
    integration = _Integration(pairs)

    change, bound, value = STEP_WIDTHS / camera.width, MAX_INVERSE_WIDTHS / camera.width, 0.0

    def misfit(inverse_focal: float, normals: np.ndarray = sampled) -> np.ndarray:
        """Return what no surface explains of the pairs' gradients (P,) at an inverse focal length."""
        return integration.residual(pairs.differences(*log_depth_gradients(normals, camera, inverse_focal, step)))

    def misfit_and_slope(inverse_focal: float, normals: np.ndarray = sampled) -> np.ndarray:
        """Return the misfit and its derivative (2, P) by the inverse focal length."""
        before, after = (misfit(inverse, normals) for inverse in (inverse_focal, inverse_focal + change))
        return np.stack([before, (after - before) / change])

    for _ in range(STEPS):
        shift, deviation = _least_squares(pairs, *misfit_and_slope(value))
        estimate = value + shift
        value = float(np.clip(estimate, -bound, bound))
    if not np.isfinite(deviation):
        return None
    noise = np.random.default_rng(0).normal(0.0, LEAST_NORMAL_NOISE, sampled.shape)
    measured = misfit_and_slope(value)
    by_noise = misfit_and_slope(value, unit(sampled + noise)) - measured
    if _noise_share(pairs.weight, measured, by_noise) > MAX_NOISE_SHARE:
        return None
    return InverseFocal(value, deviation if value == estimate else max(deviation, bound))


def log_depth_gradients(
    normals: np.ndarray, camera: UnknownCamera, inverse_focal: float, step: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Return the gradients (H, W) to the right and upwards of the surface that a camera of this focal length sees.

    They are those of the logarithm of its distance, times the focal length: the slopes of an orthographic camera.
    normals: (H, W, 3), see `focal_length_of_normals`, of every `step`-th pixel; inverse_focal: 1/pixels.
    """
    matrix = camera.matrix(inverse_focal)
    of_samples = np.diag([1.0 / step, 1.0 / step, 1.0]) @ matrix
    view = view_vectors(of_samples, normals.shape[:2], camera.left / step, camera.top / step)
    of_spheres = view_vectors(matrix, (1, 1), camera.sphere_x, camera.sphere_y)
    lights = rotate_from_view(lights_of(normals), np.broadcast_to(of_spheres, normals.shape))
    facing = half_vectors_for_view(half_vectors_of(lights), view)
    distance = (facing * view).sum(axis=-1) / view[..., 2]
    with np.errstate(invalid="ignore", divide="ignore"):
        return -facing[..., 0] / distance, -facing[..., 1] / distance


@dataclass(frozen=True, slots=True)
class _Pairs:
    """Pairs of neighbours on one sheet: to_right (H, W - 1) and upwards (H - 1, W) bool; nodes (P, 2): numbers of the
    two; weight (P,): inverse variance of a gradient across the slope; block (P,)."""

    to_right: np.ndarray
    upwards: np.ndarray
    nodes: np.ndarray
    weight: np.ndarray
    block: np.ndarray

    @classmethod
    def of(cls, normals: np.ndarray) -> "_Pairs":
        """Return the pairs of normals (H, W, 3), NaN where there is none."""
        with np.errstate(invalid="ignore"):
            known = normals[..., 2] > MAX_SLANT_COSINE
            to_right = (normals[:, 1:] * normals[:, :-1]).sum(axis=-1) > MIN_PAIR_COSINE
            upwards = (normals[1:] * normals[:-1]).sum(axis=-1) > MIN_PAIR_COSINE
        to_right &= known[:, 1:] & known[:, :-1]
        upwards &= known[1:] & known[:-1]
        numbers = np.arange(known.size).reshape(known.shape)
        # Rows run downwards, y upwards.
        first = np.concatenate([numbers[:, :-1][to_right], numbers[1:][upwards]])
        second = np.concatenate([numbers[:, 1:][to_right], numbers[:-1][upwards]])
        # A gradient's error is that of the normal over n_z across the slope, and over n_z squared along it.
        weight = np.where(known, normals[..., 2], 0.0).ravel() ** 2
        height, width = known.shape
        block = (first // width * BLOCKS // height) * BLOCKS + first % width * BLOCKS // width
        return cls(
            to_right, upwards, np.stack([first, second], axis=1), np.minimum(weight[first], weight[second]), block
        )

    def differences(self, p: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return the differences of depth (P,) that gradients p and q (H, W) give the pairs."""
        right, up = 0.5 * (p[:, 1:] + p[:, :-1]), 0.5 * (q[1:] + q[:-1])
        return np.concatenate([right[self.to_right], up[self.upwards]])


class _Integration:
    """Weighted least squares integration over pairs, factorized once."""

    def __init__(self, pairs: _Pairs) -> None:
        used, numbers = np.unique(pairs.nodes, return_inverse=True)
        first, second = numbers.reshape(pairs.nodes.shape).T
        rows, ones = np.arange(len(first)), np.ones(len(first))
        entries = np.concatenate([-ones, ones]), (np.tile(rows, 2), np.concatenate([first, second]))
        self.differences = sparse.csr_matrix(entries, shape=(len(first), len(used)))
        self.weighted = (self.differences.T @ sparse.diags(pairs.weight)).tocsr()
        self.factors = splu((self.weighted @ self.differences + REGULARIZATION * sparse.eye(len(used))).tocsc())

    def residual(self, differences: np.ndarray) -> np.ndarray:
        """Return the part (P,) of the pairs' differences (P,) that the best surface does not have."""
        return np.asarray(differences - self.differences @ self.factors.solve(self.weighted @ differences))


def _noise_share(weight: np.ndarray, measured: np.ndarray, by_noise: np.ndarray) -> float:
    """Return which share of the squared slope is noise, from misfit and slope (2, P) and what known noise adds to them.

    weight: (P,). The noise is as large as the misfit shows it, but no less than the one that was added.
    """
    squares, noise_squares = ((weight * values**2).sum(axis=1) for values in (measured, by_noise))
    ratio = max(float(squares[0] / noise_squares[0]), 1.0)
    return float(ratio * noise_squares[1] / max(squares[1], 1e-300))


def _least_squares(pairs: _Pairs, residual: np.ndarray, slope: np.ndarray) -> tuple[float, float]:
    """Return the shift at which residual + shift * slope (P,) is least, and its standard error.

    The standard error is the jackknife's over blocks of the region: the residuals of a sheet are not independent. It is
    infinite where all pairs lie in one block.
    """
    products = np.bincount(pairs.block, pairs.weight * residual * slope, BLOCKS**2)
    squares = np.bincount(pairs.block, pairs.weight * slope**2, BLOCKS**2)
    held = squares > 0.0
    products, squares = products[held], squares[held]
    shift = -products.sum() / squares.sum()
    if len(products) < 2:
        return float(shift), float("inf")
    without = -(products.sum() - products) / (squares.sum() - squares)
    error = np.sqrt((len(products) - 1) / len(products) * ((without - shift) ** 2).sum())
    return float(shift), float(error)
