"""Depth from normals inside a mask, weighted by confidence, with steps where they are required and a free boundary.

Every edge between neighbouring pixels has two predictions of the rise of height along it, from the normals at either
end (`edges`). Where the surface is continuous it rises by their mean, with a known precision (`expected_rises`);
elsewhere it has a step. Which edges are steps is found by iteratively reweighted least squares from several starts
(`reweighting`). Two of these are after Cao, Santo, Shi, Okura and Matsushita, Bilateral Normal Integration, ECCV 2022:
each pixel assumes that the surface is continuous on at least one side. Each iteration solves weighted Poisson equations
(`multigrid`). Connected components are integrated one by one: offsets between them cannot be known from one view.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.perspective import camera_in_crop, focal_length
from glint.tasks.algorithms.integration.coarse_grid import NormalGrid, doubled, halved
from glint.tasks.algorithms.integration.contour_margin import least_cosines
from glint.tasks.algorithms.integration.edges import GridEdges, grid_edges
from glint.tasks.algorithms.integration.graduation import Solution, least_squares
from glint.tasks.algorithms.integration.known_body import known_body
from glint.tasks.algorithms.integration.reweighting import misfit_energy, refined, robust
from glint.tasks.algorithms.integration.search_limits import DEFAULT_LIMITS, SearchLimits

MIN_PIXEL_WEIGHT = 1e-4
"""Weight of a pixel without a normal or confidence: it follows its neighbours and hardly influences them."""

Method = Literal["bilateral", "least-squares"]


@dataclass(frozen=True, slots=True)
class Depth:
    """Integrated depth of a region.

    depth: (H, W) float32, NaN outside the mask. Orthographic: height towards the camera in pixels, of mean zero in each
        component. Perspective: distance from the camera along its axis, of geometric mean one in each component, as the
        scale is free.
    components: (H, W) int32, 4-connected components counted from 1, 0 outside; offsets between them are unknowable.
    rounds: reweighted solutions, 0 for least squares.
    converged: whether the height changed by less than the tolerance in a round before these reached their limit. Parts
        that only edges taken for steps tie together may have moved against one another less than they would.
    energy: mean squared misfit per pixel along the normals, square pixels.
    perspective: whether `depth` is a distance from the camera.
    follows_body: whether it has the steps of a body that was known beforehand.
    """

    depth: np.ndarray
    components: np.ndarray
    rounds: int
    converged: bool
    energy: float
    perspective: bool
    follows_body: bool = False

    def height(self, distance: float) -> np.ndarray:
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
    body: np.ndarray | None = None,
    limits: SearchLimits = DEFAULT_LIMITS,
) -> Depth:
    """Integrate normals inside a mask to depth.

    Args:
        normals: (H, W, 3) unit, camera frame (x right, y up, z to the camera); NaN where unknown.
        mask: (H, W) bool.
        confidence: (H, W) >= 0, weight of each normal; where it is zero or NaN, or the normal is NaN, the pixel follows
            its neighbours.
        method: bilateral for a height with steps, or least squares alone.
        camera: (3, 3) intrinsic matrix in pixels of these arrays, whose pixel (0, 0) is the centre of the top-left one;
            None for an orthographic camera.
        body: (H, W) depth of a body towards the camera in pixels up to a constant, NaN where there is none or normals
            contradict it. It decides between heights with steps; where a continuous surface explains the normals, or
            they contradict it as a whole, nothing changes. Under perspective it is the negative logarithm of the
            distance times the focal length.
        limits: of the search for steps.

    Raises:
        UnusableCapture: the mask is empty or has no normals.
        ValueError: shapes do not agree, or the method is unknown.
    """
    normals, mask = np.asarray(normals), np.asarray(mask, bool)
    _check(normals, mask, confidence, body, method, camera)
    components = ndimage.label(mask)[0].astype(np.int32)
    window = ndimage.find_objects(mask.astype(np.int8))[0]
    inner = mask[window]
    inner_confidence = None if confidence is None else np.asarray(confidence)[window]
    weight, filled = _weighted_normals(normals[window], inner, inner_confidence)
    if camera is not None:
        camera = camera_in_crop(camera, window[1].start, window[0].start)
    grid = NormalGrid(filled, inner, weight, camera, None if body is None else np.asarray(body)[window])
    edges = _edges_of(grid)
    if method == "bilateral":
        solution, sharpness = _robust(grid, edges, limits), limits.sharpness
    else:
        solution, sharpness = least_squares(edges), 0.0
    height, energy = solution.height, misfit_energy(edges, solution.height, sharpness)

    # The equations tie no two components, so only the mean of each is left to fix.
    numbers = components[window]
    height -= (np.bincount(numbers.ravel(), height.ravel()) / np.maximum(np.bincount(numbers.ravel()), 1))[numbers]
    if camera is not None:
        height = np.exp(-height / focal_length(camera))
    depth = np.full(mask.shape, np.nan, np.float32)
    depth[window][inner] = height[inner]
    energy /= int(inner.sum())
    perspective, follows_body = camera is not None, solution.follows_body
    return Depth(depth, components, solution.rounds, solution.converged, energy, perspective, follows_body)


def _edges_of(grid: NormalGrid) -> GridEdges:
    return grid_edges(grid.normals, grid.mask, grid.weight, grid.camera, least_cosines(grid.mask))


def _robust(grid: NormalGrid, edges: GridEdges, limits: SearchLimits) -> Solution:
    """Solve for the height with steps: of a large region from coarse to fine, a level at a time.

    Steps are searched for on the coarsest grid alone, whose height the finer ones refine. The tolerance is in pixels of
    the coarsest grid, the same share of an object however it is sampled.
    """
    levels = [(grid, edges)]
    while np.count_nonzero(levels[-1][0].mask) > limits.max_searched:
        coarse = halved(levels[-1][0])
        levels.append((coarse, _edges_of(coarse)))
    coarsest, coarsest_edges = levels.pop()
    body = known_body(coarsest.body, coarsest.mask)
    solution = robust(coarsest_edges, coarsest.mask, limits, body)
    is_followed = solution.follows_body
    mask, rounds = coarsest.mask, solution.rounds
    for finer, finer_edges in reversed(levels):
        limits = replace(limits, tolerance=2.0 * limits.tolerance)
        start = doubled(solution.height, mask, (finer.mask.shape[0], finer.mask.shape[1]))
        body = known_body(finer.body, finer.mask) if is_followed else None
        solution = refined(finer_edges, finer.mask, start, limits, body)
        mask, rounds = finer.mask, rounds + solution.rounds
    return replace(solution, rounds=rounds)


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
    normals: np.ndarray,
    mask: np.ndarray,
    confidence: np.ndarray | None,
    body: np.ndarray | None,
    method: str,
    camera: np.ndarray | None,
) -> None:
    if mask.ndim != 2 or normals.shape != (*mask.shape, 3):
        raise ValueError(f"normals {normals.shape} and mask {mask.shape} do not agree")
    if confidence is not None and np.shape(confidence) != mask.shape:
        raise ValueError(f"confidence {np.shape(confidence)} and mask {mask.shape} do not agree")
    if body is not None and np.shape(body) != mask.shape:
        raise ValueError(f"body {np.shape(body)} and mask {mask.shape} do not agree")
    if camera is not None and np.shape(camera) != (3, 3):
        raise ValueError(f"the camera matrix is {np.shape(camera)}, not (3, 3)")
    if method not in ("bilateral", "least-squares"):
        raise ValueError(f"unknown method {method!r}: bilateral or least-squares")
    if not mask.any():
        raise UnusableCapture("the mask is empty", "give a mask that covers the object, or let it be estimated")
