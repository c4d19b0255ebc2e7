"""Depth from normals inside a mask by bilateral normal integration, weighted by confidence, with a free boundary.

After Cao, Santo, Shi, Okura and Matsushita, Bilateral Normal Integration, ECCV 2022. Every edge between neighbouring
pixels has two predictions of the rise of height along it, from the normals at either end (`edges`). Masked least
squares averages them. Bilateral integration lets each pixel assume that the surface is continuous on at least one side:
a sigmoid divides the pixel's weight between its two sides, found by iteratively reweighted least squares, so that an
edge whose two ends both reject it becomes a step. Each iteration solves weighted Poisson equations (`multigrid`).

Two choices differ from the publication: the start is the masked least-squares solution instead of a plane (the energy
is not convex, and this leads to a lower minimum), and the sides are compared by their misfits instead of their rises
(so that both sides count alike on smooth curved parts). Each connected component is integrated by itself: offsets
between them cannot be known from one view.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.integration.edges import GridEdges, assemble, bilateral_weights, focal_length, grid_edges
from glint.tasks.algorithms.integration.multigrid import solve_poisson

MIN_COSINE = 0.01
"""Lower bound of the cosine between normal and line of sight: a steep rim rises by at most 100 pixels per pixel."""
SHARPNESS = 5.25
"""Slope of the sigmoid between a pixel's two sides, per square pixel of misfit along the normal."""
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
    iterations: reweighted solves, 0 for least squares.
    energy: mean squared misfit per pixel along the normals, square pixels.
    perspective: whether `depth` is a distance from the camera.
    """

    depth: np.ndarray
    components: np.ndarray
    iterations: int
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
    max_iterations: int = 9,
    tolerance: float = 1e-3,
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
        max_iterations: of reweighting; many more would sharpen steps that the normals do not support.
        tolerance: the iterations end when the energy changes by less than this fraction.

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
        height, iterations, energy = _bilateral(edges, sharpness, max_iterations, tolerance)
    else:
        height = _least_squares(edges)
        iterations, energy = 0, bilateral_weights(*_fields(edges), height, 0.0)[1]

    # The equations tie no two components, so only the mean of each is left to fix.
    numbers = components[window]
    height -= (np.bincount(numbers.ravel(), height.ravel()) / np.maximum(np.bincount(numbers.ravel()), 1))[numbers]
    if camera is not None:
        height = np.exp(-height / focal_length(camera))
    depth = np.full(mask.shape, np.nan, np.float32)
    depth[window][inner] = height[inner]
    return Depth(depth, components, iterations, energy / int(inner.sum()), camera is not None)


def _least_squares(edges: GridEdges) -> np.ndarray:
    """Solve for the height (H, W) with both ends of each edge weighted alike."""
    equal = np.full(edges.forward_rise.shape, 0.5)
    weights, source = assemble(*_fields(edges), equal, 0.0, 0.0, MIN_EDGE_WEIGHT)
    return solve_poisson(weights, source, np.zeros(source.shape), tolerance=LEAST_SQUARES_TOLERANCE)[0]


def _bilateral(
    edges: GridEdges, sharpness: float, max_iterations: int, tolerance: float
) -> tuple[np.ndarray, int, float]:
    """Solve for the height (H, W) by iteratively reweighted least squares; return it, the iterations and the energy."""
    height = _least_squares(edges)
    bilateral, energy = bilateral_weights(*_fields(edges), height, sharpness)
    for iteration in range(1, max_iterations + 1):
        weights, source = assemble(*_fields(edges), bilateral, WEIGHT_POWER, RISE_POWER, MIN_EDGE_WEIGHT)
        height = solve_poisson(weights, source, height, tolerance=REWEIGHTED_TOLERANCE)[0]
        previous_energy = energy
        bilateral, energy = bilateral_weights(*_fields(edges), height, sharpness)
        if abs(previous_energy - energy) <= tolerance * previous_energy:
            return height, iteration, energy
    return height, max_iterations, energy


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
