"""Depth from normals inside a mask by bilateral normal integration, weighted by confidence, with a free boundary.

After Cao, Santo, Shi, Okura and Matsushita, Bilateral Normal Integration, ECCV 2022. Every edge between neighbouring
pixels has two predictions of the rise of height along it, from the normals at either end (`edges`). Masked least
squares averages them. Bilateral integration lets each pixel assume that the surface is continuous on at least one side:
a sigmoid divides the pixel's weight between its two sides, found by iteratively reweighted least squares, so that an
edge whose two ends both reject it becomes a step. Each iteration solves weighted Poisson equations (`multigrid`).

The start is the masked least-squares solution, and the sides are compared by their misfits, so that both count alike on
smooth curved parts. Where large steps have bent the start all misfits are large and early decisions are wrong ones. So
two more attempts compare the publication's rises (large beyond an occluding contour) as well, or alone, with a sigmoid
that starts as flat as the largest differences require and sharpens from round to round (graduated non-convexity, Blake
and Zisserman 1987). A graduated attempt ends when the height no longer changes; clearly sparser discontinuities win
(Kim, Jung and Lee 2024). Without a step of a pixel there is nothing to attempt. Each connected component is integrated
by itself: offsets between them cannot be known from one view.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.integration.edges import (
    GridEdges,
    assemble,
    bilateral_weights,
    compare_sides,
    discontinuity,
    focal_length,
    grid_edges,
)
from glint.tasks.algorithms.integration.multigrid import solve_poisson

MIN_COSINE = 0.01
"""Lower bound of the cosine between normal and line of sight: a steep rim rises by at most 100 pixels per pixel."""
SHARPNESS = 5.25
"""Slope of the sigmoid between a pixel's two sides where misfits are compared, per square pixel along the normal."""
GRADUATED_SHARPNESS = 2.0
"""Final slope where rises are compared too: they are larger than misfits on all slopes."""
RISE_SHARES = (0.5, 1.0)
"""Shares of the squared rise in the comparison of a pixel's sides, per graduated attempt; the rest is the squared
misfit. With 0.5 limbs before a body come free; with 1 faces with edges stay together, whose creases are no steps."""
SHARPENING = 2.0
"""Factor of the sigmoid's slope from round to round."""
UNDECIDED_SHARE = 0.999
"""Quantile of the differences between sides at which the first graduated round has the inverse of its slope."""
LEAST_STEP_PX = 1.0
"""Step, by that quantile of misfits after the first attempt, up to which no graduated attempt is made."""
LEAST_COSINE = 0.3
"""Cosine of incidence (73 degrees) from which a pixel's misfit shows a step: steeper ones misfit at every rim."""
SPARSER = 0.95
"""Ratio of the discontinuity below which a graduated attempt replaces the one that compares misfits alone."""
MISFIT_ROUNDS = 9
"""Limit of the rounds that compare misfits alone: more of them sharpen steps that the normals do not support."""
MAX_ROUNDS = 30
"""Limit of an attempt's reweighted solutions: some steps flicker between two neighbouring pixels for ever."""
TOLERANCE_PX = 5e-3
"""Root mean square change of the height in a round below which the rounds end."""
WEIGHT_POWER, RISE_POWER = 2.0, 1.0
"""Powers of that cosine with which a pixel weighs an edge, and with which the two ends' rises are averaged: at 1 the
average is the rise by the mean of the two normals, which is exact on circular arcs."""
MIN_PIXEL_WEIGHT = 1e-4
"""Weight of a pixel without a normal or confidence: it follows its neighbours and hardly influences them."""
MIN_EDGE_WEIGHT = 1e-10
"""Weight left to an edge that both its ends reject: the two sides of a step stay one component."""
LEAST_SQUARES_TOLERANCE, REWEIGHTED_TOLERANCE = 1e-5, 1e-3
"""Relative residuals at which the solver stops: for the start, and for each iteration, which begins near its end."""

Method = Literal["bilateral", "least-squares"]


@dataclass(frozen=True, slots=True)
class Depth:
    """Integrated depth of a region.

    depth: (H, W) float32, NaN outside the mask. Orthographic: height towards the camera in pixels, of mean zero in each
        component. Perspective: distance from the camera along its axis, of geometric mean one in each component, as the
        scale is free.
    components: (H, W) int32, 4-connected components counted from 1, 0 outside; offsets between them are unknowable.
    rounds: reweighted solutions, 0 for least squares.
    converged: whether the height changed by less than the tolerance before the rounds reached their limit.
    energy: mean squared misfit per pixel along the normals, square pixels.
    perspective: whether `depth` is a distance from the camera.
    """

    depth: np.ndarray
    components: np.ndarray
    rounds: int
    converged: bool
    energy: float
    perspective: bool

    def height(self, distance: float = 1.0) -> np.ndarray:
        """Return the height towards the camera (H, W) float32.

        Under perspective, `distance` is the components' (geometric mean) distance from the camera in any unit; the
        result is how much nearer than that a pixel is. An orthographic depth is returned as it is.
        """
        return np.float32(distance) * (np.float32(1.0) - self.depth) if self.perspective else self.depth


def integrate(
    normals: np.ndarray,
    mask: np.ndarray,
    *,
    confidence: np.ndarray | None = None,
    method: Method = "bilateral",
    camera: np.ndarray | None = None,
    sharpness: float = SHARPNESS,
    min_cosine: float = MIN_COSINE,
    max_rounds: int = MAX_ROUNDS,
    tolerance: float = TOLERANCE_PX,
) -> Depth:
    """Integrate normals inside a mask to depth.

    Args:
        normals: (H, W, 3) unit, camera frame (x right, y up, z to the camera); NaN where unknown.
        mask: (H, W) bool.
        confidence: (H, W) >= 0, weight of each normal; where it is zero or NaN, or the normal is NaN, the pixel follows
            its neighbours.
        method: bilateral, or least squares alone.
        camera: (3, 3) intrinsic matrix in pixels of these arrays, whose pixel (0, 0) is the centre of the top-left one;
            None for an orthographic camera.
        sharpness, min_cosine: see SHARPNESS and MIN_COSINE.
        max_rounds, tolerance: see MAX_ROUNDS and TOLERANCE_PX.

    Raises:
        UnusableCapture: the mask is empty or has no normals.
        ValueError: shapes do not agree, or the method is unknown.
    """
    normals, mask = np.asarray(normals), np.asarray(mask, bool)
    _check(normals, mask, confidence, method, camera)
    components = ndimage.label(mask)[0].astype(np.int32)
    window = ndimage.find_objects(mask.astype(np.int8))[0]
    inner = mask[window]
    inner_confidence = None if confidence is None else np.asarray(confidence)[window]
    weight, filled = _weighted_normals(normals[window], inner, inner_confidence)
    if camera is not None:
        camera = np.array(camera, float) - [[0, 0, window[1].start], [0, 0, window[0].start], [0, 0, 0]]
    edges = grid_edges(filled, inner, weight, camera, min_cosine)
    if method == "bilateral":
        height, rounds, converged = _bilateral(edges, inner, sharpness, max_rounds, tolerance)
        energy = _energy(edges, height, sharpness)
    else:
        (height, converged), rounds = _least_squares(edges), 0
        energy = _energy(edges, height, 0.0)

    # The equations tie no two components, so only the mean of each is left to fix.
    numbers = components[window]
    height -= (np.bincount(numbers.ravel(), height.ravel()) / np.maximum(np.bincount(numbers.ravel()), 1))[numbers]
    if camera is not None:
        height = np.exp(-height / focal_length(camera))
    depth = np.full(mask.shape, np.nan, np.float32)
    depth[window][inner] = height[inner]
    return Depth(depth, components, rounds, converged, energy / int(inner.sum()), camera is not None)


def _least_squares(edges: GridEdges) -> tuple[np.ndarray, bool]:
    """Solve for the height (H, W) with both ends of each edge weighted alike; return it and whether it converged."""
    equal = np.full(edges.forward_rise.shape, 0.5)
    weights, source = assemble(*_fields(edges), equal, 0.0, 0.0, MIN_EDGE_WEIGHT)
    height, _, converged = solve_poisson(weights, source, np.zeros(source.shape), tolerance=LEAST_SQUARES_TOLERANCE)
    return height, converged


def _bilateral(
    edges: GridEdges, mask: np.ndarray, sharpness: float, max_rounds: int, tolerance: float
) -> tuple[np.ndarray, int, bool]:
    """Solve for the height (H, W); return it, the rounds of all attempts, and whether its own rounds converged.

    The first attempt compares misfits alone. It is replaced where a graduated one is clearly less discontinuous, or by
    least squares, where all begin, if that is the least discontinuous.
    """
    start, solved = _least_squares(edges)
    few = min(MISFIT_ROUNDS, max_rounds)
    best, rounds, converged = _reweighted(edges, mask, start, (0.0, sharpness, sharpness), few, tolerance)
    least = discontinuity(*_fields(edges), best)
    if discontinuity(*_fields(edges), start) < least:
        best, least, converged = start, discontinuity(*_fields(edges), start), solved
    bound = SPARSER * least
    flat = mask & (edges.cos_incidence >= LEAST_COSINE)
    if not flat.any() or _largest(compare_sides(*_fields(edges), best, 0.0)[0], flat) <= LEAST_STEP_PX**2:
        return best, rounds, converged
    for rise_share in RISE_SHARES:
        difference = compare_sides(*_fields(edges), start, rise_share)[0]
        first = min(GRADUATED_SHARPNESS, 1.0 / max(_largest(difference, mask), 1e-12))
        slopes = (rise_share, first, GRADUATED_SHARPNESS)
        height, completed, ended = _reweighted(edges, mask, start, slopes, max_rounds, tolerance)
        rounds += completed
        total = discontinuity(*_fields(edges), height)
        if total < bound:
            best, bound, converged = height, total, ended
    return best, rounds, converged


def _largest(difference: np.ndarray, mask: np.ndarray) -> float:
    return float(np.quantile(np.abs(difference[:, mask]), UNDECIDED_SHARE))


def _reweighted(
    edges: GridEdges,
    mask: np.ndarray,
    height: np.ndarray,
    comparison: tuple[float, float, float],
    max_rounds: int,
    tolerance: float,
) -> tuple[np.ndarray, int, bool]:
    """Solve by iteratively reweighted least squares from a height (H, W).

    `comparison` is the share of the rise and the slopes of the sigmoid in the first round and in the end. Returns the
    height, the number of rounds, and whether the last one changed it by less than the tolerance.
    """
    rise_share, slope, sharpness = comparison
    for completed in range(1, max_rounds + 1):
        shares = bilateral_weights(compare_sides(*_fields(edges), height, rise_share)[0], slope)
        weights, source = assemble(*_fields(edges), shares, WEIGHT_POWER, RISE_POWER, MIN_EDGE_WEIGHT)
        previous = height
        height, _, solved = solve_poisson(weights, source, height, tolerance=REWEIGHTED_TOLERANCE)
        change = float(np.sqrt(np.mean((height - previous)[mask] ** 2)))
        if slope >= sharpness and change <= tolerance:
            return height, completed, solved
        slope = min(slope * SHARPENING, sharpness)
    return height, max_rounds, False


def _energy(edges: GridEdges, height: np.ndarray, sharpness: float) -> float:
    """Return the sum of the weighted squared misfits along the normals, square pixels."""
    difference, following, preceding = compare_sides(*_fields(edges), height, 0.0)
    share = bilateral_weights(difference, sharpness)
    return float((edges.weight * (share * following + (1.0 - share) * preceding)).sum())


def _fields(edges: GridEdges) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    return edges.inside, edges.forward_rise, edges.backward_rise, edges.cos_incidence, edges.weight


def _weighted_normals(
    normals: np.ndarray, mask: np.ndarray, confidence: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return weights (H, W) in MIN_PIXEL_WEIGHT..1 and normals (H, W, 3), each unknown one replaced by its nearest."""
    known = mask & np.isfinite(normals).all(axis=-1)
    if not known.any():
        raise UnusableCapture("no pixel of the mask has a normal", "check the stage that estimates the normals")
    nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    filled = normals[tuple(nearest)].astype(np.float64)
    weight = known.astype(np.float64)
    if confidence is not None:
        weight *= np.clip(np.nan_to_num(confidence, nan=0.0, posinf=0.0), 0.0, None)
        weight /= weight.max() or 1.0
    return np.maximum(weight, MIN_PIXEL_WEIGHT), filled


def _check(
    normals: np.ndarray, mask: np.ndarray, confidence: np.ndarray | None, method: str, camera: np.ndarray | None
) -> None:
    if mask.ndim != 2 or normals.shape != (*mask.shape, 3):
        raise ValueError(f"normals {normals.shape} and mask {mask.shape} do not agree")
    if confidence is not None and np.shape(confidence) != mask.shape:
        raise ValueError(f"confidence {np.shape(confidence)} and mask {mask.shape} do not agree")
    if camera is not None and np.shape(camera) != (3, 3):
        raise ValueError(f"the camera matrix is {np.shape(camera)}, not (3, 3)")
    if method not in ("bilateral", "least-squares"):
        raise ValueError(f"unknown method {method!r}: bilateral or least-squares")
    if not mask.any():
        raise UnusableCapture("the mask is empty", "give a mask that covers the object, or let it be estimated")
