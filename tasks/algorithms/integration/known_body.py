"""A body whose depth is known beforehand, as that of a surface of revolution: where its steps are, and how high.

Normals say nothing of how far one part of a surface lies behind another, but the shape of a vessel does: the profile
gives the far wall behind the lip, and the foot behind the bowl. Its pixels are drawn to that depth (a screened Poisson
equation), by no more than one loose measurement in each of many places: where normals are known they decide the shape,
and what the draw decides is the offset between parts that steps separate. What is no part of the body, such as a
handle, has its own shape and is attached to the body along most of its border.
"""

from typing import NamedTuple

import numpy as np

from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.integration.edges import GridEdges
from glint.tasks.algorithms.integration.expected_rises import ExpectedRises, poisson_source
from glint.tasks.algorithms.integration.multigrid import solve_poisson

MIN_BODY_SHARE = 0.6
"""Share of the mask whose normals must follow the body: 0.87 to 1 of vessels, less than a third of figurines into which
one was forced."""
DEPTH_SD, INDEPENDENT_SIDE = 0.02, 0.05
"""Standard deviation of the body's depth, and side of a square in which its errors are the same, in inradii."""
MAX_BODY_DEVIATION, MIN_UNCONTRADICTED_SHARE = 0.1, 0.95
"""Difference between a height and the body's depth, in inradii, from which they contradict each other, and the share of
the body's pixels that must not."""
ATTACHED_WEIGHT, MIN_ATTACHED_PX, ATTACHING_ROUNDS = 1e-4, 1.0, 8
"""Largest weight of an edge between body and rest while the rest is attached to it, as a share of the largest of all;
misfit up to which it has that, and rounds of the reweighting."""
FIXED_WEIGHT = 1e3
"""Weight, likewise, of a body that is held."""


class KnownBody(NamedTuple):
    """The depth of a body.

    known: (H, W) bool, pixels that show it. depth: (H, W) float64, pixels towards the camera up to a constant, 0 where
    it is not known. inradius: of the mask, in pixels.
    """

    known: np.ndarray
    depth: np.ndarray
    inradius: float


def known_body(depth: np.ndarray | None, mask: np.ndarray) -> KnownBody | None:
    """Return the body of a depth (H, W), NaN where there is none; None if it is too small a part of the mask (H, W)."""
    if depth is None:
        return None
    known = mask & np.isfinite(depth)
    if np.count_nonzero(known) < MIN_BODY_SHARE * np.count_nonzero(mask):
        return None
    return KnownBody(known, np.where(known, depth, 0.0).astype(np.float64), inradius_of(mask))


def body_pull(body: KnownBody, height: np.ndarray) -> np.ndarray:
    """Return the weights (H, W), per square pixel, that draw a height (H, W) to the body, by the loss of the edges."""
    relative = (height - body.depth) / (MAX_BODY_DEVIATION * body.inradius)
    full = (DEPTH_SD * INDEPENDENT_SIDE * body.inradius**2) ** -2.0
    return np.where(body.known, full / (1.0 + relative**2) ** 3, 0.0)


def agrees(body: KnownBody, height: np.ndarray) -> bool:
    """Return whether a height (H, W), whose constant is the body's, agrees with its depth nearly everywhere."""
    deviation = np.abs(height - body.depth)[body.known]
    return bool((deviation < MAX_BODY_DEVIATION * body.inradius).mean() >= MIN_UNCONTRADICTED_SHARE)


def beside_body(edges: GridEdges, body: KnownBody) -> GridEdges:
    """Return the edges, of which those between body and rest follow the normal of the rest alone.

    The body goes on behind what stands before it, so that its own normal says nothing of the way there.
    """
    forward, backward = edges.forward_rise.copy(), edges.backward_rise.copy()
    for axis in range(2):
        following = np.roll(body.known, -1, axis)
        leaves, enters = (edges.inside[axis] & part for part in (body.known & ~following, ~body.known & following))
        forward[axis][leaves] = backward[axis][leaves]
        backward[axis][enters] = forward[axis][enters]
    return edges._replace(forward_rise=forward, backward_rise=backward)


def attached_height(rises: ExpectedRises, weights: np.ndarray, body: KnownBody) -> np.ndarray:
    """Return the height (H, W) of the body as it is, and of the rest as it is attached to it.

    The offset of each part of the rest is the one that most of its border allows: the sum of the absolute misfits there
    is least, by reweighting. A handle meets the body along a part of its border, and stands before it along the other.

    Args:
        rises: see `expected_rises`, of edges `beside_body`.
        weights: (2, H, W) of the edges within the rest.
        body: the known one.
    """
    following = np.stack([np.roll(body.known, -1, axis) for axis in range(2)])
    crossing = (rises.precision > 0.0) & (body.known != following)
    fixed = np.where(body.known, FIXED_WEIGHT, 0.0)
    body_rise = np.stack([np.roll(body.depth, -1, axis) - body.depth for axis in range(2)])
    # Solved for is the difference to the body, of which only what lies outside differs from zero.
    rise = np.where(body.known & following, 0.0, rises.mean - body_rise)
    height, misfit = np.zeros(body.depth.shape), np.zeros(rise.shape)
    for _ in range(ATTACHING_ROUNDS):
        weights = np.where(crossing, ATTACHED_WEIGHT / np.maximum(np.abs(misfit), MIN_ATTACHED_PX), weights)
        height = solve_poisson(weights, poisson_source(weights, rise), height, pull=fixed, tolerance=1e-4)[0]
        misfit = np.stack([np.roll(height, -1, axis) - height for axis in range(2)]) - rise
    return np.where(body.known, body.depth, height + body.depth)
