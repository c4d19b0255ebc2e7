"""What normals say about depth along the edges between neighbouring pixels, and the grid equations made of it.

Axis 0 leads to the next row, axis 1 to the next column. The normal at either end of an edge predicts the rise of height
along it; a pixel's misfit to a neighbour is the difference from its own prediction, along its normal.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit


@dataclass(frozen=True, slots=True)
class Edges:
    """Predictions of the normals along the edges of a region.

    inside: (2, H, W) bool, whether the pixel and its next one along the axis both lie in the mask.
    here, there: (2, H, W) float64, rise of height (pixels) along the edge by the pixel's and by the next one's normal.
    facing: (H, W) float64, cosine between normal and line of sight, at least the floor.
    trust: (H, W) float64 in 0..1, weight of the pixel's normal.
    """

    inside: np.ndarray
    here: np.ndarray
    there: np.ndarray
    facing: np.ndarray
    trust: np.ndarray


def edges_of(
    normals: np.ndarray, mask: np.ndarray, trust: np.ndarray, camera: np.ndarray | None, floor: float
) -> Edges:
    """Edges of normals (H, W, 3; finite) inside the mask (H, W).

    Height is towards the camera: in pixels for an orthographic one, minus `focal_length(camera)` times the logarithm of
    the distance for a perspective one. Planes are predicted exactly by both.
    """
    height, width = mask.shape
    inside = np.zeros((2, height, width), bool)
    inside[0, :-1] = mask[:-1] & mask[1:]
    inside[1, :, :-1] = mask[:, :-1] & mask[:, 1:]
    here, there = np.zeros(inside.shape), np.zeros(inside.shape)
    if camera is None:
        facing = np.maximum(normals[..., 2], floor)
        for axis, slope in enumerate((normals[..., 1] / facing, -normals[..., 0] / facing)):
            here[axis] = slope
            there[axis] = np.roll(slope, -1, axis)
        return Edges(inside, here, there, facing, trust)

    right = (np.arange(width) - camera[0, 2]) / camera[0, 0]
    below = ((np.arange(height) - camera[1, 2]) / camera[1, 1])[:, None]
    focal = focal_length(camera)
    facing = normals[..., 2] - normals[..., 0] * right + normals[..., 1] * below
    steps = (normals[..., 1] / camera[1, 1], -normals[..., 0] / camera[0, 0])
    for axis, step in enumerate(steps):
        # A plane n.X = const has distance const / (n.ray), and n.ray changes linearly from pixel to pixel.
        here[axis] = focal * _log_ratio(facing, facing + step, floor)
        there[axis] = np.roll(focal * _log_ratio(facing - step, facing, floor), -1, axis)
    return Edges(inside, here, there, np.maximum(facing, floor), trust)


def focal_length(camera: np.ndarray) -> float:
    """Mean focal length in pixels of an intrinsic matrix (3, 3)."""
    return float((camera[0, 0] + camera[1, 1]) / 2)


def _log_ratio(first: np.ndarray, second: np.ndarray, floor: float) -> np.ndarray:
    lift = np.maximum(floor - np.minimum(first, second), 0.0)
    return np.log((second + lift) / (first + lift))


@njit(cache=True, nogil=True)
def shares(
    inside: np.ndarray,
    here: np.ndarray,
    there: np.ndarray,
    facing: np.ndarray,
    trust: np.ndarray,
    height: np.ndarray,
    sharpness: float,
) -> tuple[np.ndarray, float]:
    """How much of its say each pixel gives to its next neighbour along each axis (2, H, W), the rest to its previous.

    The side with the smaller misfit gets more, by a sigmoid over the difference of the squared misfits; the less a
    normal is trusted, the less its misfits say about steps. Also the energy: the sum of the squared misfits (square
    pixels), weighted by share and trust.
    """
    rows, columns = height.shape
    out = np.full(here.shape, 0.5)
    energy = 0.0
    for axis in range(2):
        di, dj = 1 - axis, axis
        for i in range(rows):
            for j in range(columns):
                ahead, back = 0.0, 0.0
                if inside[axis, i, j]:
                    ahead = ((height[i + di, j + dj] - height[i, j] - here[axis, i, j]) * facing[i, j]) ** 2
                if i >= di and j >= dj and inside[axis, i - di, j - dj]:
                    rise = height[i, j] - height[i - di, j - dj]
                    back = ((rise - there[axis, i - di, j - dj]) * facing[i, j]) ** 2
                argument = min(max(sharpness * trust[i, j] * (ahead - back), -40.0), 40.0)
                share = 1.0 / (1.0 + math.exp(argument))
                out[axis, i, j] = share
                energy += trust[i, j] * (share * ahead + (1.0 - share) * back)
    return out, energy


@njit(cache=True, nogil=True)
def equations(
    inside: np.ndarray,
    here: np.ndarray,
    there: np.ndarray,
    facing: np.ndarray,
    trust: np.ndarray,
    share: np.ndarray,
    weight_power: float,
    rise_power: float,
    keep: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Weights (2, H, W) of the edges and the source (H, W) of their Laplacian, for the shares (2, H, W).

    Either end speaks for an edge with share x trust x a power of facing: `rise_power` when the two predictions are
    averaged, `weight_power` in the weight. An edge never weighs less than `keep`.
    """
    rows, columns = facing.shape
    weights = np.zeros(here.shape)
    source = np.zeros(facing.shape)
    for axis in range(2):
        di, dj = 1 - axis, axis
        for i in range(rows):
            for j in range(columns):
                if not inside[axis, i, j]:
                    continue
                k, m = i + di, j + dj
                first = share[axis, i, j] * trust[i, j]
                second = (1.0 - share[axis, k, m]) * trust[k, m]
                a, b = first * facing[i, j] ** rise_power, second * facing[k, m] ** rise_power
                rise = (a * here[axis, i, j] + b * there[axis, i, j]) / (a + b + 1e-300)
                weight = max(first * facing[i, j] ** weight_power + second * facing[k, m] ** weight_power, keep)
                weights[axis, i, j] = weight
                source[i, j] -= weight * rise
                source[k, m] += weight * rise
    return weights, source
