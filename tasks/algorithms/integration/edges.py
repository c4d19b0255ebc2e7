"""Grid edges of normal integration: predicted rises, bilateral weights, and the weighted Poisson equations.

After Cao et al., Bilateral Normal Integration, ECCV 2022: the normal at either end of an edge between neighbouring
pixels predicts the rise of height along it (for perspective cameras, of the logarithm of the distance), and a sigmoid
weighs a pixel's two sides along each axis. A pixel's misfit to a neighbour is the difference of the rise from its own
prediction, measured along its normal.

A step is where one part of a surface hides another. What hides turns away from the viewer there: the normal of the near
side tilts towards the far side (unless its edge is sharper than a right angle), up to a right angle where it is round.

Axis 0 leads to the next row, axis 1 to the next column. Height grows towards the camera.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from glint.tasks.algorithms.geometry.perspective import CAMERA_FLIP, focal_length

MAX_SIGMOID_ARGUMENT = 40.0
"""Arguments of the sigmoid are clipped to this, so that the exponential stays finite and the weights positive."""
STEP_PX = 0.25
"""Step, along the normal, from which an edge counts as a whole one."""


class GridEdges(NamedTuple):
    """Edges of a region and the rises that normals predict along them; compiled functions take it whole.

    inside: (2, H, W) bool, whether the pixel and its next one along the axis both lie in the mask.
    forward_rise: (2, H, W) float64, rise of height (pixels) from the pixel to its next one, by the pixel's normal.
    backward_rise: (2, H, W) float64, the same rise by the next pixel's normal.
    normal_share: (H, W) float64, distance along the pixel's normal per rise of height: the cosine between normal and
        line of sight, under perspective times the length of the ray to the distance 1; clamped from below.
    weight: (H, W) float64 in 0..1, weight of the pixel's normal.
    tilt: (2, 2, H, W) float64 in -1..1, component of the near side's normal towards the far side, if the edge were a
        step down to the next pixel, and if it were one up to it.
    """

    inside: np.ndarray
    forward_rise: np.ndarray
    backward_rise: np.ndarray
    normal_share: np.ndarray
    weight: np.ndarray
    tilt: np.ndarray


def grid_edges(
    normals: np.ndarray,
    mask: np.ndarray,
    weight: np.ndarray,
    camera: np.ndarray | None,
    min_share: float | np.ndarray,
) -> GridEdges:
    """Compute the edges of a mask (H, W) and the rises predicted by normals (H, W, 3; finite, camera frame).

    Height is in pixels for an orthographic camera, and minus `focal_length(camera)` times the logarithm of the distance
    for a perspective one. Both predict planes exactly.

    Args:
        normals: (H, W, 3) unit, x right, y up, z to the camera.
        mask: (H, W) bool.
        weight: (H, W), weight of each normal.
        camera: (3, 3) intrinsic matrix in pixels of these arrays, None for an orthographic camera.
        min_share: lower bound of the normal share, one for all or (H, W).
    """
    height, width = mask.shape
    inside = np.zeros((2, height, width), bool)
    inside[0, :-1] = mask[:-1] & mask[1:]
    inside[1, :, :-1] = mask[:, :-1] & mask[:, 1:]
    forward, backward = np.zeros(inside.shape), np.zeros(inside.shape)
    if camera is None:
        normal_share = np.maximum(normals[..., 2], min_share)
        # Rows run downwards and y upwards: the slope along axis 0 has the sign of n_y.
        for axis, slope in enumerate((normals[..., 1] / normal_share, -normals[..., 0] / normal_share)):
            forward[axis] = slope
            backward[axis] = np.roll(slope, -1, axis)
        return GridEdges(inside, forward, backward, normal_share, weight, _tilt(forward, backward, normal_share))

    # Minus the products of the normal with the ray's change from column to column and from row to row, and with the ray
    # (right, up, -1) of the first pixel.
    across, down, first = np.moveaxis(-normals @ (CAMERA_FLIP[:, None] * np.linalg.inv(camera)), -1, 0)
    normal_share = across * np.arange(width) + down * np.arange(height)[:, None] + first
    focal, steps = focal_length(camera), (down, across)
    for axis, step in enumerate(steps):
        # A plane n.X = const has distance const / (n.ray), and n.ray changes linearly from pixel to pixel.
        forward[axis] = focal * _log_ratio(normal_share, normal_share + step, min_share)
        backward[axis] = np.roll(focal * _log_ratio(normal_share - step, normal_share, min_share), -1, axis)
    normal_share = np.maximum(normal_share, min_share)
    return GridEdges(inside, forward, backward, normal_share, weight, _tilt(forward, backward, normal_share))


def _tilt(forward_rise: np.ndarray, backward_rise: np.ndarray, normal_share: np.ndarray) -> np.ndarray:
    beyond = np.stack([np.roll(normal_share, -1, axis) for axis in range(2)])
    return np.clip(np.stack([-forward_rise * normal_share, backward_rise * beyond]), -1.0, 1.0)


def _log_ratio(first: np.ndarray, second: np.ndarray, minimum: float | np.ndarray) -> np.ndarray:
    """Return log(second / first), both shifted by the same amount so that neither is below `minimum`."""
    lift = np.maximum(minimum - np.minimum(first, second), 0.0)
    return np.asarray(np.log((second + lift) / (first + lift)))


@njit(cache=True, nogil=True)
def compare_sides(
    edges: GridEdges,
    height: np.ndarray,
    rise_share: float,
    tilt_power: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compare each pixel's two sides along each axis for a height (H, W).

    What speaks against a side is its squared misfit and its squared rise, both along the normal and in the shares
    1 - `rise_share` and `rise_share`: the surface is continuous where the normal explains the rise, and beyond an
    occluding contour the rise is large. Both count exp(`tilt_power` x tilt) times, as the near side tilts there.

    Returns:
        (2, H, W) float64 each: what speaks against the next side less what speaks against the previous one, times the
        pixel's weight (an uncertain normal is no evidence of a step); and the squared misfits to the next and to the
        previous neighbour, square pixels, 0 where there is none.
    """
    inside, forward_rise, backward_rise, normal_share, weight, tilt = edges
    rows, columns = height.shape
    difference, following, preceding = (
        np.zeros(forward_rise.shape),
        np.zeros(forward_rise.shape),
        np.zeros(forward_rise.shape),
    )
    for axis in range(2):
        di, dj = 1 - axis, axis
        for i in range(rows):
            for j in range(columns):
                # normal_share turns a difference of heights into a distance along the normal.
                next_side, previous_side = 0.0, 0.0
                if inside[axis, i, j]:
                    rise = height[i + di, j + dj] - height[i, j]
                    misfit = ((rise - forward_rise[axis, i, j]) * normal_share[i, j]) ** 2
                    following[axis, i, j] = misfit
                    # A rise of less than expected is a step down, beyond which the next pixel is the far one.
                    expected = (forward_rise[axis, i, j] + backward_rise[axis, i, j]) / 2
                    side = 0 if rise < expected else 1
                    next_side = (1.0 - rise_share) * misfit + rise_share * (rise * normal_share[i, j]) ** 2
                    next_side *= np.exp(tilt_power * tilt[side, axis, i, j])
                if i >= di and j >= dj and inside[axis, i - di, j - dj]:
                    rise = height[i, j] - height[i - di, j - dj]
                    misfit = ((rise - backward_rise[axis, i - di, j - dj]) * normal_share[i, j]) ** 2
                    preceding[axis, i, j] = misfit
                    expected = (forward_rise[axis, i - di, j - dj] + backward_rise[axis, i - di, j - dj]) / 2
                    side = 0 if rise < expected else 1
                    previous_side = (1.0 - rise_share) * misfit + rise_share * (rise * normal_share[i, j]) ** 2
                    previous_side *= np.exp(tilt_power * tilt[side, axis, i - di, j - dj])
                difference[axis, i, j] = weight[i, j] * (next_side - previous_side)
    return difference, following, preceding


@njit(cache=True, nogil=True)
def step_price(
    edges: GridEdges,
    height: np.ndarray,
    tilt_power: float,
) -> float:
    """Compute the price of a height's (H, W) steps: their length in pixels, each divided by exp(`tilt_power` x tilt).

    An edge's step is the part of its rise, along the steeper normal and in pixels, that lies outside of what the two
    ends predict: a crease, with a rise between both, has none. One of less than STEP_PX counts in proportion. The less
    certain of the two normals weighs it, and it is the cheaper, the more the near side tilts towards the far one.
    """
    inside, forward_rise, backward_rise, normal_share, weight, tilt = edges
    rows, columns = height.shape
    total = 0.0
    for axis in range(2):
        di, dj = 1 - axis, axis
        for i in range(rows):
            for j in range(columns):
                if inside[axis, i, j]:
                    rise = height[i + di, j + dj] - height[i, j]
                    low = min(forward_rise[axis, i, j], backward_rise[axis, i, j])
                    high = max(forward_rise[axis, i, j], backward_rise[axis, i, j])
                    step = max(low - rise, rise - high, 0.0)
                    share = min(normal_share[i, j], normal_share[i + di, j + dj])
                    side = 0 if rise < (low + high) / 2 else 1
                    price = min(weight[i, j], weight[i + di, j + dj]) * np.exp(-tilt_power * tilt[side, axis, i, j])
                    total += price * min(share * step / STEP_PX, 1.0)
    return total


def bilateral_weights(difference: np.ndarray, sharpness: float) -> np.ndarray:
    """Divide each pixel between its sides by a sigmoid of their `difference` (2, H, W; see `compare_sides`).

    Returns (2, H, W) float64 in 0..1, the weight of the edge to the next neighbour along each axis, whose complement is
    that of the edge to the previous one. `sharpness` is per square pixel.
    """
    argument = np.clip(sharpness * difference, -MAX_SIGMOID_ARGUMENT, MAX_SIGMOID_ARGUMENT)
    return np.asarray(1.0 / (1.0 + np.exp(argument)))


@njit(cache=True, nogil=True)
def assemble(
    edges: GridEdges,
    bilateral: np.ndarray,
    weight_power: float,
    rise_power: float,
    min_edge_weight: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Assemble the weighted Poisson equations of the grid for given bilateral weights (2, H, W).

    Each end of an edge counts with bilateral weight x weight x a power of its normal share: `rise_power` when
    the two predicted rises are averaged, `weight_power` in the weight of the edge, which is at least `min_edge_weight`.

    Returns:
        Weights (2, H, W) float64 of the edges, 0 outside, and the right-hand side (H, W) float64 of their Laplacian,
        which sums to zero over each component.
    """
    inside, forward_rise, backward_rise, normal_share, weight, _ = edges
    rows, columns = normal_share.shape
    weights = np.zeros(forward_rise.shape)
    source = np.zeros(normal_share.shape)
    for axis in range(2):
        di, dj = 1 - axis, axis
        for i in range(rows):
            for j in range(columns):
                if not inside[axis, i, j]:
                    continue
                k, m = i + di, j + dj
                first = bilateral[axis, i, j] * weight[i, j]
                second = (1.0 - bilateral[axis, k, m]) * weight[k, m]
                a, b = first * normal_share[i, j] ** rise_power, second * normal_share[k, m] ** rise_power
                # Both ends may have given their weight to the opposite side: the tiny addend avoids 0 / 0.
                rise = (a * forward_rise[axis, i, j] + b * backward_rise[axis, i, j]) / (a + b + 1e-300)
                edge = first * normal_share[i, j] ** weight_power + second * normal_share[k, m] ** weight_power
                edge = max(edge, min_edge_weight)
                weights[axis, i, j] = edge
                # The gradient of weight / 2 * (height[k, m] - height[i, j] - rise)^2 at both ends.
                source[i, j] -= edge * rise
                source[k, m] += edge * rise
    return weights, source
