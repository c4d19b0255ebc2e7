"""Circles in images: a Hough transform along gradients, and the evidence of edges along rays.

Source: the gradient-directed Hough transform for circles (Kimme, Ballard and Sklansky 1975).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numba import njit

RAYS = 96
"""Rays from the centre."""
MIN_SPACING_PX, SPACING_RATIO = 0.5, 0.01
"""Distance of samples along a ray: at least so many pixels, and at least this share of the radius."""
OUTER_GAP_PX = 3.0
"""Distance outside an edge at which evidence counts against it: samples reach so much farther than the contours."""
LOG_OFFSET, GRADIENT_SIGMA_PX = 4.0, 0.8
"""Level, of 8 bits, that keeps noise in the dark from counting, and standard deviation of the smoothing."""
MIN_GRADIENT_FLOOR = 0.004
"""Lower bound of an image's usual gradient, for images without structure."""
MIN_VOTING_RATIO, HALF_VOTE_RATIO = 1.5, 4.0
"""Gradients, relative to the usual one, from which a pixel is an edge that votes, and whose vote counts half."""
VOTE_SIGMA_PX, NEIGHBOURHOOD_PX = 1.2, 7
"""Standard deviation of the smoothing of votes, and side of the square in which one centre is the strongest."""


@dataclass(frozen=True, slots=True)
class LogGradient:
    """Gradient of an image's logarithm.

    gradient: (2, H, W) float32, along x (right) and y (down), per pixel. floor: the median of its magnitude.
    """

    gradient: np.ndarray
    floor: float


@dataclass(frozen=True, slots=True)
class EdgeEvidence:
    """Evidence of edges along rays from (x, y): evidence (A, N) at radii start + spacing * n, angles (A,), y down."""

    x: float
    y: float
    evidence: np.ndarray
    start: float
    spacing: float
    angles: np.ndarray

    def scores(self, offsets: np.ndarray, radii: np.ndarray) -> np.ndarray:
        """Return the mean evidence (I, J, K) of circles with centres (x + offsets[i], y + offsets[j]), radii[k]."""
        return _circle_scores(self.evidence, self.start, self.spacing, self.angles, offsets, radii)

    def of_rays(self, used: np.ndarray) -> "EdgeEvidence":
        """Return the evidence of some of the rays (A,) bool."""
        return replace(self, evidence=self.evidence[used], angles=self.angles[used])

    def moved(self, right: float, down: float, outward: float = 0.0) -> "EdgeEvidence":
        """Return the evidence moved so that a contour offset by (right, down), its radius larger by `outward`, lies on
        a circle around (x, y), its radius as it was."""
        shifts = (right * np.cos(self.angles) + down * np.sin(self.angles) + outward) / self.spacing
        return replace(self, evidence=_shifted(self.evidence, shifts))


@dataclass(frozen=True, slots=True)
class RaySamples:
    """Log levels (T, A, N) of frames along rays from (x, y), at radii start + spacing * n and angles (A,), y down.

    valid: (A, N) bool, whether the frame holds the sample and its neighbours at a distance of `reach` samples.
    """

    x: float
    y: float
    levels: np.ndarray
    valid: np.ndarray
    start: float
    spacing: float
    reach: int
    angles: np.ndarray

    @property
    def radii(self) -> np.ndarray:
        """Radii (N,) of the samples in pixels."""
        return self.start + self.spacing * np.arange(self.levels.shape[2])


def sample_rays(
    frames: Sequence[np.ndarray],
    x: float,
    y: float,
    min_radius: float,
    max_radius: float,
    rays: int = RAYS,
    interpolation: int = cv2.INTER_LINEAR,
) -> RaySamples:
    """Sample frames along rays from (x, y), for the evidence of edges between two radii.

    Args:
        frames: of `log_frames`, (H, W) each.
        x: column of the centre.
        y: row of the centre.
        min_radius: smallest radius of a contour in pixels.
        max_radius: largest radius.
        rays: number of rays.
        interpolation: OpenCV's code of the interpolation between pixels.
    """
    spacing = max(MIN_SPACING_PX, SPACING_RATIO * min_radius)
    reach = max(1, round(1.0 / spacing))
    start = max(min_radius - (reach + 2) * spacing, spacing)
    radii = np.arange(start, max_radius + OUTER_GAP_PX + (reach + 2) * spacing, spacing)
    angles = 2.0 * np.pi * (np.arange(rays) + 0.5) / rays
    columns = (x + np.cos(angles)[:, None] * radii).astype(np.float32)
    rows = (y + np.sin(angles)[:, None] * radii).astype(np.float32)
    height, width = frames[0].shape
    valid = (columns >= 0) & (rows >= 0) & (columns <= width - 1) & (rows <= height - 1)
    valid[:, reach:-reach] &= valid[:, : -2 * reach] & valid[:, 2 * reach :]
    valid[:, :reach] = valid[:, -reach:] = False
    levels = np.stack(
        [cv2.remap(frame, columns, rows, interpolation, borderMode=cv2.BORDER_REPLICATE) for frame in frames]
    )
    return RaySamples(x, y, levels, valid, start, spacing, reach, angles)


def log_gradient(image: np.ndarray) -> LogGradient:
    """Compute the gradient of an image's (H, W) logarithm, in which edges in the dark count like edges in the light.

    The image is in levels of 8 bits.
    """
    logarithm = np.log(image.astype(np.float32) + np.float32(LOG_OFFSET))
    smooth = cv2.GaussianBlur(logarithm, (0, 0), GRADIENT_SIGMA_PX)
    gradient = np.stack([cv2.Sobel(smooth, cv2.CV_32F, *axes, scale=0.125) for axes in ((1, 0), (0, 1))])
    return LogGradient(gradient, max(float(np.median(np.hypot(*gradient))), MIN_GRADIENT_FLOOR))


def strongest_circles(edges: LogGradient, radii: np.ndarray, count: int) -> list[tuple[float, float, float]]:
    """Return up to `count` circles (x, y, radius) with the most votes, strongest first, one per neighbourhood.

    Every edge pixel votes for the two centres at each radius along its gradient. A vote counts as a share of the
    circumference, and an edge much stronger than usual counts no more than others.
    """
    gx, gy = edges.gradient
    strength = np.hypot(gx, gy)
    nx, ny = gx / (strength + 1e-9), gy / (strength + 1e-9)
    edge = _ridges(strength, nx, ny, edges.floor)
    y, x = np.nonzero(edge)
    weight = strength[edge] / (strength[edge] + HALF_VOTE_RATIO * edges.floor)
    # Best share of the circumference over all radii, for every centre, and the radius that has it.
    best_share, best_radius, votes = np.zeros_like(strength), np.zeros_like(strength), np.zeros_like(strength)
    right, down = nx[edge], ny[edge]
    for radius in radii:
        votes.fill(0.0)
        _vote(x, y, right, down, weight, float(radius), votes)
        _keep_best(cv2.GaussianBlur(votes, (0, 0), VOTE_SIGMA_PX), np.float32(radius), best_share, best_radius)
    neighbourhood = np.ones((NEIGHBOURHOOD_PX, NEIGHBOURHOOD_PX), np.uint8)
    is_peak = (best_share == cv2.dilate(best_share, neighbourhood)) & (best_share > 0)
    row, column = np.nonzero(is_peak)
    order = np.argsort(-best_share[row, column])[:count]
    return [(float(column[k]), float(row[k]), float(best_radius[row[k], column[k]])) for k in order]


def median_of(values: np.ndarray) -> float:
    """Return the median of values (N,): `np.median` takes longer to look at its arguments than to sort a few."""
    middle = len(values) // 2
    if len(values) % 2:
        return float(np.partition(values, middle)[middle])
    return float(np.partition(values, (middle - 1, middle))[middle - 1 : middle + 1].mean())


def _ridges(strength: np.ndarray, nx: np.ndarray, ny: np.ndarray, floor: float) -> np.ndarray:
    """Return the edge pixels (H, W) bool: maxima of the gradient's strength along its direction (Canny 1986)."""
    rows, columns = np.mgrid[: strength.shape[0], : strength.shape[1]].astype(np.float32)
    after = cv2.remap(strength, columns + nx, rows + ny, cv2.INTER_LINEAR)
    before = cv2.remap(strength, columns - nx, rows - ny, cv2.INTER_LINEAR)
    ridges = (strength >= after) & (strength > before) & (strength > MIN_VOTING_RATIO * floor)
    ridges[:2] = ridges[-2:] = ridges[:, :2] = ridges[:, -2:] = False
    return ridges


@njit(cache=True, nogil=True)
def _vote(
    x: np.ndarray, y: np.ndarray, nx: np.ndarray, ny: np.ndarray, weight: np.ndarray, radius: float, votes: np.ndarray
) -> None:
    """Add the weights (N,) of edge pixels to `votes` (H, W) at both centres at `radius` along their gradients."""
    height, width = votes.shape
    for k in range(x.size):
        for side in (-radius, radius):
            column, row = int(np.rint(x[k] + side * nx[k])), int(np.rint(y[k] + side * ny[k]))
            if 0 <= row < height and 0 <= column < width:
                votes[row, column] += weight[k]


@njit(cache=True, nogil=True)
def _shifted(evidence: np.ndarray, shifts: np.ndarray) -> np.ndarray:
    """Return evidence (A, N) float32 moved inward along each ray by shifts (A,), in samples; its ends are continued."""
    rays, count = evidence.shape
    moved = np.empty((rays, count), np.float32)
    for a in range(rays):
        for n in range(count):
            position = min(max(n + shifts[a], 0.0), count - 1.0)
            lower = min(int(position), max(count - 2, 0))
            upper = min(lower + 1, count - 1)
            before, after = np.float64(evidence[a, lower]), np.float64(evidence[a, upper])
            moved[a, n] = (after - before) * (position - lower) + before
    return moved


@njit(cache=True, nogil=True)
def _keep_best(votes: np.ndarray, radius: np.float32, best_share: np.ndarray, best_radius: np.ndarray) -> None:
    """Replace the best share of the circumference (H, W), and its radius, where the votes (H, W) at `radius` exceed it.

    In one pass: the arrays are larger than the processor's caches.
    """
    for i in range(votes.shape[0]):
        for j in range(votes.shape[1]):
            share = votes[i, j] / radius
            if share > best_share[i, j]:
                best_share[i, j] = share
                best_radius[i, j] = radius


@njit(cache=True, nogil=True)
def _circle_scores(
    evidence: np.ndarray, start: float, spacing: float, angles: np.ndarray, offsets: np.ndarray, radii: np.ndarray
) -> np.ndarray:
    """Return the mean evidence (I, J, K) along circles; to first order an offset moves the contour along each ray."""
    rays, count = evidence.shape
    scores = np.zeros((offsets.size, offsets.size, radii.size))
    for a in range(rays):
        cosine, sine = np.cos(angles[a]), np.sin(angles[a])
        for i in range(offsets.size):
            for j in range(offsets.size):
                offset = offsets[i] * cosine + offsets[j] * sine - start
                for k in range(radii.size):
                    position = min(max((radii[k] + offset) / spacing, 0.0), count - 1.001)
                    n = int(position)
                    part = position - n
                    scores[i, j, k] += (1.0 - part) * evidence[a, n] + part * evidence[a, n + 1]
    return scores / rays
