"""Depth from normals inside a mask: free boundary, components apart, weighted by confidence (METHOD stage 7).

Every edge between two neighbouring pixels has two predictions of the rise of height along it, one from the normal at
either end. Masked least squares takes their mean. Bilateral integration (Cao et al., Bilateral Normal Integration, ECCV
2022) lets each pixel believe that the surface is continuous to at least one side: a sigmoid shares the pixel's say
between its two sides, and iteratively reweighted least squares finds the shares, so that an edge which neither end
believes becomes a step. Two choices differ from the published method: the start is masked least squares instead of a
plane (it leads to a lower minimum of the energy, which is not convex), and the sides compare their misfits instead of
their rises (so that on smooth curved parts both sides count alike).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.integration.edges import Edges, edges_of, equations, focal_length, shares
from glint.tasks.algorithms.integration.multigrid import solve

FLOOR = 0.01
"""Least cosine between a normal and the line of sight in slopes: a steep rim may rise by a hundred pixels per pixel."""
SHARPNESS = 5.25
"""Slope of the sigmoid between a pixel's two sides, per square pixel of misfit along the normal."""
WEIGHT_POWER, RISE_POWER = 2.0, 1.0
"""Powers of that cosine with which a pixel weighs an edge, and with which the two ends' predictions are averaged: at 1
the average is the rise by the mean of the two normals, which is exact on circular arcs."""
BLIND = 1e-4
"""Weight of a pixel without a normal or of no confidence: it follows its neighbours and hardly pulls them."""
KEEP = 1e-10
"""Weight that is left of an edge in which neither end believes: the two sides of a step stay one component."""

Method = Literal["bilateral", "least-squares"]


@dataclass(frozen=True, slots=True)
class Depth:
    """Integrated depth of a region.

    depth: (H, W) float32, NaN outside the mask. Orthographic: height towards the camera in pixels, of mean zero in each
        component. Perspective: distance from the camera along its axis, of geometric mean one in each component, as the
        scale is free.
    components: (H, W) int32, 4-connected components counted from 1, 0 outside; offsets between them are unknowable.
    iterations: rounds of reweighting, 0 for least squares.
    energy: mean squared misfit per pixel along the normals, square pixels.
    perspective: whether `depth` is a distance from the camera.
    """

    depth: np.ndarray
    components: np.ndarray
    iterations: int
    energy: float
    perspective: bool

    def towards_camera(self, distance: float = 1.0) -> np.ndarray:
        """Depth (H, W) float32 that grows towards the camera.

        Under perspective, `distance` is the components' (geometric mean) distance from the camera in the unit wanted;
        the result is how much nearer than that a pixel is. An orthographic depth is returned as it is.
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
    floor: float = FLOOR,
    rounds: int = 9,
    tolerance: float = 1e-3,
) -> Depth:
    """Integrate normals (H, W, 3; camera frame: x right, y up, z to the camera) over the mask (H, W).

    confidence (H, W) >= 0 weighs each pixel's normal; where it is zero or NaN, or the normal is NaN, the pixel follows
    its neighbours. camera (3, 3) is the intrinsic matrix in pixels of these arrays, whose pixel (0, 0) is the centre of
    the top-left one; without it the camera is orthographic. sharpness, floor: see SHARPNESS and FLOOR. At most
    `rounds` of reweighting are done, fewer once the energy changes by less than the fraction `tolerance`;
    many more would sharpen steps that the normals do not support.

    Raises UnusableCapture for an empty mask or one without normals, ValueError for shapes that do not agree.
    """
    normals, mask = np.asarray(normals), np.asarray(mask, bool)
    _check(normals, mask, confidence, method, camera)
    components = ndimage.label(mask)[0].astype(np.int32)
    window = ndimage.find_objects(mask.astype(np.int8))[0]
    inner = mask[window]
    trust, filled = _trusted(normals[window], inner, None if confidence is None else np.asarray(confidence)[window])
    if camera is not None:
        camera = np.array(camera, float) - [[0, 0, window[1].start], [0, 0, window[0].start], [0, 0, 0]]
    edges = edges_of(filled, inner, trust, camera, floor)
    if method == "bilateral":
        height, taken, energy = _bilateral(edges, sharpness, rounds, tolerance)
    else:
        height = _least_squares(edges)
        taken, energy = 0, shares(*_fields(edges), height, 0.0)[1]

    # Each component by itself: the equations tie no two, so only their means are left to fix.
    names = components[window]
    height -= (np.bincount(names.ravel(), height.ravel()) / np.maximum(np.bincount(names.ravel()), 1))[names]
    if camera is not None:
        height = np.exp(-height / focal_length(camera))
    depth = np.full(mask.shape, np.nan, np.float32)
    depth[window][inner] = height[inner]
    return Depth(depth, components, taken, energy / int(inner.sum()), camera is not None)


def _least_squares(edges: Edges) -> np.ndarray:
    weights, source = equations(*_fields(edges), np.full(edges.here.shape, 0.5), 0.0, 0.0, KEEP)
    return solve(weights, source, np.zeros(source.shape), tolerance=1e-5)[0]


def _bilateral(edges: Edges, sharpness: float, rounds: int, tolerance: float) -> tuple[np.ndarray, int, float]:
    height = _least_squares(edges)
    share, energy = shares(*_fields(edges), height, sharpness)
    for taken in range(1, rounds + 1):
        weights, source = equations(*_fields(edges), share, WEIGHT_POWER, RISE_POWER, KEEP)
        height = solve(weights, source, height, tolerance=1e-3)[0]
        before = energy
        share, energy = shares(*_fields(edges), height, sharpness)
        if abs(before - energy) <= tolerance * before:
            return height, taken, energy
    return height, rounds, energy


def _fields(edges: Edges) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    return edges.inside, edges.here, edges.there, edges.facing, edges.trust


def _trusted(normals: np.ndarray, mask: np.ndarray, confidence: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Weights (H, W) in BLIND..1 and normals (H, W, 3) without NaN: each missing one is its nearest known one."""
    known = mask & np.isfinite(normals).all(axis=-1)
    if not known.any():
        raise UnusableCapture("no pixel of the mask has a normal", "check the stage that estimates the normals")
    nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    filled = normals[tuple(nearest)].astype(np.float64)
    trust = known.astype(np.float64)
    if confidence is not None:
        trust *= np.clip(np.nan_to_num(confidence, nan=0.0, posinf=0.0), 0.0, None)
        trust /= trust.max() or 1.0
    return np.maximum(trust, BLIND), filled


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
