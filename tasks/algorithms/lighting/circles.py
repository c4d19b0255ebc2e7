"""Circles in pictures: seeds by voting along gradients, and an outline score that is fitted below a pixel."""

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit

ARC = 3
"""Pixels per arc of an outline: each arc counts by how coherent its edge is, not by how strong."""

SIDE = 2.0
"""Pixels to either side of the outline where the radial gradient must be weaker: shading has no edge there."""


LATER = 0.2
"""Weight of each picture relative to the one before it: what moves leaves edges of its own in the maximum."""

OUTWARD = 4.5
"""Power of the radius in a fit: what a ball mirrors near its rim makes false edges inside the outline, none outside."""

HORIZON, HORIZON_WEIGHT = float(np.sin(np.radians(45.0))), 0.25
"""On a mirror ball the plane through it across the view (lamps before the object, the table's far parts) shows here."""


@dataclass(frozen=True, slots=True)
class EdgePicture:
    """Gradient of the logarithm of a picture: `gradient` (2, H, W) float32 (x, y) and its usual magnitude."""

    gradient: np.ndarray
    floor: float


def edge_picture(picture: np.ndarray, *, sigma: float = 0.8, dark: float = 4.0) -> EdgePicture:
    """Gradient of log(picture + dark), so that an edge in the dark counts as much as one in the light."""
    smooth = cv2.GaussianBlur(np.log(picture.astype(np.float32) + np.float32(dark)), (0, 0), sigma)
    gradient = np.stack([cv2.Sobel(smooth, cv2.CV_32F, *axes, scale=0.125) for axes in ((1, 0), (0, 1))])
    return EdgePicture(gradient, max(float(np.median(np.hypot(*gradient))), 0.004))


def strongest_circles(edges: EdgePicture, radii: np.ndarray, most: int) -> list[tuple[float, float, float]]:
    """Circles (x, y, radius) that most edge pixels point to, one per neighbourhood of centres, strongest first.

    Every edge pixel votes for the two centres at each radius along its gradient; a vote counts as a share of the
    outline, and an edge much stronger than usual counts no more than others.
    """
    gx, gy = edges.gradient
    strength = np.hypot(gx, gy)
    nx, ny = gx / (strength + 1e-9), gy / (strength + 1e-9)
    rows, columns = np.mgrid[: strength.shape[0], : strength.shape[1]].astype(np.float32)
    ahead = cv2.remap(strength, columns + nx, rows + ny, cv2.INTER_LINEAR)
    behind = cv2.remap(strength, columns - nx, rows - ny, cv2.INTER_LINEAR)
    ridge = (strength >= ahead) & (strength > behind) & (strength > 1.5 * edges.floor)
    ridge[:2] = ridge[-2:] = ridge[:, :2] = ridge[:, -2:] = False
    y, x = np.nonzero(ridge)
    weight = strength[ridge] / (strength[ridge] + 4.0 * edges.floor)
    best, of = np.zeros_like(strength), np.zeros_like(strength)
    for radius in radii:
        share = np.zeros_like(strength)
        _vote(x, y, nx[ridge], ny[ridge], weight, float(radius), share)
        share = cv2.GaussianBlur(share, (0, 0), 1.2) / np.float32(radius)
        of[share > best] = radius
        np.maximum(best, share, out=best)
    row, column = np.nonzero((best == cv2.dilate(best, np.ones((7, 7), np.uint8))) & (best > 0))
    order = np.argsort(-best[row, column])[:most]
    return [(float(column[k]), float(row[k]), float(of[row[k], column[k]])) for k in order]


def outline(edges: list[EdgePicture], x: float, y: float, radius: float) -> float:
    """Share 0..1 of the circle's arcs along which the pictures have a coherent edge."""
    return max(float(_outline(*_stack(edges), x, y, radius)), 0.0)


def fit_outline(
    edges: list[EdgePicture],
    x: float,
    y: float,
    least: float,
    largest: float,
    *,
    reach: float,
    step: float,
    finest: float = 0.02,
) -> tuple[float, float, float, float]:
    """Circle (x, y, radius, score) of the best outline within `reach` of a centre and between two radii, in pixels.

    All circles on a grid of `step`, then uphill from the best one with steps halved until `finest`.
    """
    return _search(*_stack(edges), x, y, least, largest, reach, step, finest)


def _stack(edges: list[EdgePicture]) -> tuple[np.ndarray, np.ndarray]:
    return np.stack([picture.gradient for picture in edges]), np.array([picture.floor for picture in edges], np.float32)


@njit(cache=True, nogil=True)
def _vote(
    x: np.ndarray, y: np.ndarray, nx: np.ndarray, ny: np.ndarray, weight: np.ndarray, radius: float, into: np.ndarray
) -> None:
    height, width = into.shape
    for k in range(x.size):
        for side in (-radius, radius):
            column, row = int(np.rint(x[k] + side * nx[k])), int(np.rint(y[k] + side * ny[k]))
            if 0 <= row < height and 0 <= column < width:
                into[row, column] += weight[k]


@njit(cache=True, nogil=True, fastmath=True)
def _outline(gradient: np.ndarray, floor: np.ndarray, x: float, y: float, radius: float) -> float:
    pictures, _, height, width = gradient.shape
    share = LATER ** np.arange(pictures)
    share /= share.sum()
    arcs = max(12, int(2.0 * np.pi * radius / ARC))
    turn = 2.0 * np.pi / (arcs * ARC)
    cos_turn, sin_turn = np.cos(turn), np.sin(turn)
    score = 0.0
    along = np.zeros(3)
    for p in range(pictures):
        c, s = np.cos(0.5 * turn), np.sin(0.5 * turn)
        for _ in range(arcs):
            along[:] = 0.0
            whole = 0.0
            seen = 0
            for _ in range(ARC):
                for side in range(3):
                    distance = radius + (side - 1) * SIDE
                    u, v = x + distance * c, y + distance * s
                    i, j = int(np.floor(v)), int(np.floor(u))
                    if i < 0 or j < 0 or i >= height - 1 or j >= width - 1:
                        continue
                    fy, fx = v - i, u - j
                    a, b = (1 - fx) * (1 - fy), fx * (1 - fy)
                    d, e = (1 - fx) * fy, fx * fy
                    gx = a * gradient[p, 0, i, j] + b * gradient[p, 0, i, j + 1]
                    gx += d * gradient[p, 0, i + 1, j] + e * gradient[p, 0, i + 1, j + 1]
                    gy = a * gradient[p, 1, i, j] + b * gradient[p, 1, i, j + 1]
                    gy += d * gradient[p, 1, i + 1, j] + e * gradient[p, 1, i + 1, j + 1]
                    along[side] += gx * c + gy * s
                    if side == 1:
                        whole += np.hypot(gx, gy)
                        seen += 1
                c, s = c * cos_turn - s * sin_turn, s * cos_turn + c * sin_turn
            if seen > 0:
                sharp = abs(along[1]) - 0.5 * (abs(along[0]) + abs(along[2]))
                score += share[p] * max(sharp, 0.0) / (whole + 3.0 * seen * floor[p])
    return score / arcs


@njit(cache=True, nogil=True)
def _ball(gradient: np.ndarray, floor: np.ndarray, x: float, y: float, radius: float) -> float:
    horizon = _outline(gradient, floor, x, y, HORIZON * radius)
    return (_outline(gradient, floor, x, y, radius) + HORIZON_WEIGHT * horizon) * radius**OUTWARD


@njit(cache=True, nogil=True)
def _search(
    gradient: np.ndarray,
    floor: np.ndarray,
    x: float,
    y: float,
    least: float,
    largest: float,
    reach: float,
    step: float,
    finest: float,
) -> tuple[float, float, float, float]:
    best = (x, y, 0.5 * (least + largest), -1.0)
    side = int(np.ceil(reach / step))
    radii = int(np.ceil((largest - least) / step))
    for k in range(radii + 1):
        radius = least + k * step
        for i in range(-side, side + 1):
            for j in range(-side, side + 1):
                score = _ball(gradient, floor, x + j * step, y + i * step, radius)
                if score > best[3]:
                    best = (x + j * step, y + i * step, radius, score)
    finer = step
    while finer > finest:
        finer *= 0.5
        for _ in range(3):
            centre = best
            for k in range(-1, 2):
                for i in range(-1, 2):
                    for j in range(-1, 2):
                        u, v, r = centre[0] + j * finer, centre[1] + i * finer, centre[2] + k * finer
                        score = _ball(gradient, floor, u, v, r)
                        if score > best[3]:
                            best = (u, v, r, score)
            if best == centre:
                break
    return best
