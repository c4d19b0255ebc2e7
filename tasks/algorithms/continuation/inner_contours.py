"""Contours inside the silhouette: where what lies before them ends, and another part of the surface begins.

Around most of them nothing shows a highlight, since the near part turns away there. Accepted normals beside such a gap
continue into it, each patch of their borders by its own linear fit (`border_patches`). Every pixel of the gap belongs
to one patch, so that few of those that face the lights lack a candidate, normals end where they lie in the image plane,
and neighbours agree; where they do not, a contour costs its length (weak continuity constraints, Blake and Zisserman
1987; plane labels, Birchfield and Tomasi 1999). So contours are closed between patches that contradict one another,
and fade out where these agree.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from glint.tasks.algorithms.continuation.border_patches import BorderPatches
from glint.tasks.algorithms.continuation.expansion import expand
from glint.tasks.algorithms.prior.lit_pixels import LitPixels
from glint.tasks.algorithms.prior.smooth_normals import contour_normals

CANDIDATE_DEG = 8.0
"""Angle up to which a candidate shows the normal that is expected."""
SHOWN_NATS, DARK_NATS = 0.5, 0.6
"""Evidence for a normal that a candidate shows, and against one that faces the lights without a candidate."""
REACH_MARGIN = 1.08
"""Factor of (n_x, n_y) before it is compared with what flashes: at the limit of the lights, few highlights count."""
BEYOND_LENGTH, BEYOND_NATS, MAX_BEYOND_NATS = 1.05, 20.0, 5.0
"""Length of (n_x, n_y) from which a part has ended, what a length beyond it costs, and at most."""
DISTANCE_NATS, PATCH_REACH_INRADII = 1.0, 0.6
"""Cost of a patch one inradius away, and distance up to which one continues."""
RIM_NATS, RIM_DEVIATION = 2.0, 0.5
"""Cost of contradicting the occluding contour, and the difference at which it is reached."""
CONTOUR_NATS, CONTOUR_JUMP = 0.05, 0.5
"""Cost of a contour as long as a pixel in an object of unit inradius, and the difference of (n_x, n_y) from which a
contour is cheaper than a bend."""
MIN_JUMP = 0.25
"""Difference of (n_x, n_y) between neighbours from which a contour runs between them."""
MIN_OUTWARD = 0.3
"""Component of a normal across a contour, towards the other side, that one of its sides must have: what hides something
turns away there."""
EXPANSION_SWEEPS = 1
"""Expansion moves of each patch."""


@dataclass(frozen=True, slots=True)
class InnerContours:
    """Contours between pixels, and how accepted normals continue up to them.

    right (H, W) bool: whether a contour runs between a pixel and its right neighbour; down (H, W) bool: and the one
    below. plane (H, W, 2): continued n_x and n_y, NaN where nothing continues; variance (H, W): theirs, infinite there;
    distance (H, W): from the patch that continues, pixels.
    """

    right: np.ndarray
    down: np.ndarray
    plane: np.ndarray
    variance: np.ndarray
    distance: np.ndarray


def has_candidate(candidates: np.ndarray, normals: np.ndarray, max_deg: float = CANDIDATE_DEG) -> np.ndarray:
    """Return where (...) a candidate (K, ..., 3; NaN without) is within `max_deg` degrees of the normal (..., 3)."""
    cosines = np.nan_to_num((candidates * normals[None]).sum(axis=-1), nan=-1.0)
    return np.asarray((cosines > np.cos(np.radians(max_deg))).any(axis=0))


def lifted(plane: np.ndarray) -> np.ndarray:
    """Return the unit normals (..., 3) of n_x and n_y (..., 2), in the image plane where these are longer than 1."""
    plane = plane / np.maximum(np.linalg.norm(plane, axis=-1, keepdims=True), 1.0)
    depth = np.sqrt(np.maximum(1.0 - (plane**2).sum(axis=-1, keepdims=True), 0.0))
    return np.concatenate([plane, depth], axis=-1)


def inner_contours(accepted: np.ndarray, candidates: np.ndarray, pixels: LitPixels) -> InnerContours | None:
    """Find the contours inside a silhouette; None if fewer than two patches continue.

    Args:
        accepted: (H, W, 3) accepted normals, NaN elsewhere.
        candidates: (K, H, W, 3), all candidates, NaN without.
        pixels: of the object, and the normals that the lights reach.
    """
    mask, inradius = pixels.mask, pixels.inradius
    patches = BorderPatches.of(accepted, mask, inradius)
    if patches.count < 2:
        return None
    nodes = mask & ~patches.inner | (patches.owner >= 0)
    rows, columns = np.nonzero(nodes)
    owner = patches.owner[nodes]
    unary, allowed = _costs(patches, candidates, pixels, rows, columns)
    allowed &= owner < 0
    edges = _edges(nodes)
    edges = edges[(owner[edges] < 0).any(axis=1)]
    middle = (rows[edges].mean(axis=1), columns[edges].mean(axis=1))

    def predict(labels: np.ndarray, which: np.ndarray) -> np.ndarray:
        return patches.at(labels, middle[0][which], middle[1][which])

    def difference(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        square = ((first[:, :2] - second[:, :2]) ** 2).sum(axis=1)
        return CONTOUR_NATS * inradius * np.minimum(square / (CONTOUR_JUMP**2 + first[:, 2] + second[:, 2]), 1.0)

    places = np.stack([rows, columns], axis=1)
    fixed = owner >= 0
    start = owner[fixed][cKDTree(places[fixed]).query(places)[1]]
    labels = expand(start, unary, allowed, edges, predict, difference, EXPANSION_SWEEPS)

    ends = [predict(labels[edges[:, end]], np.arange(len(edges))) for end in (0, 1)]
    right, down = _jumps(accepted)
    _add_contours(right, down, places[edges], ends)
    plane, variance, distance = np.full((*mask.shape, 2), np.nan), *np.full((2, *mask.shape), np.inf)
    continued = patches.at(labels, rows, columns)
    plane[nodes], variance[nodes] = continued[:, :2], continued[:, 2]
    distance[nodes] = np.linalg.norm(places - patches.centres[labels], axis=1)
    return InnerContours(right, down, plane, variance, distance)


def _costs(
    patches: BorderPatches, candidates: np.ndarray, pixels: LitPixels, rows: np.ndarray, columns: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the cost of each patch at each pixel (N, M), nats, and whether it reaches so far (N, M) bool."""
    rim, outward = contour_normals(pixels.mask)
    costs = np.zeros((patches.count, len(rows)), np.float32)
    allowed = np.zeros(costs.shape, bool)
    for patch, centre in enumerate(patches.centres):
        distance = np.hypot(rows - centre[0], columns - centre[1])
        near = np.flatnonzero(distance <= PATCH_REACH_INRADII * pixels.inradius)
        at = rows[near], columns[near]
        plane = patches.at(np.full(len(near), patch), *at)[:, :2]
        length = np.hypot(*plane.T)
        cost = DISTANCE_NATS * distance[near] / pixels.inradius
        cost += np.minimum(BEYOND_NATS * np.maximum(length - BEYOND_LENGTH, 0.0), MAX_BEYOND_NATS)
        is_shown = has_candidate(candidates[:, at[0], at[1]], lifted(plane))
        cost += DARK_NATS * (pixels.swept.flashes(lifted(plane * REACH_MARGIN)) & ~is_shown) - SHOWN_NATS * is_shown
        square = ((plane - np.nan_to_num(outward[at][:, :2])) ** 2).sum(axis=1)
        cost += RIM_NATS * rim[at] * np.minimum(square / RIM_DEVIATION**2, 1.0)
        costs[patch, near], allowed[patch, near] = cost, True
    return costs, allowed


def _add_contours(right: np.ndarray, down: np.ndarray, edges: np.ndarray, ends: list[np.ndarray]) -> None:
    """Add contours to `right` and `down` (H, W) bool where what continues contradicts itself.

    edges: (E, 2, 2), row and column of both pixels; ends: what continues at either of them (E, 3), see `BorderPatches`.
    """
    jump = np.linalg.norm(ends[0][:, :2] - ends[1][:, :2], axis=1)
    is_contour = (jump > MIN_JUMP) & (jump > np.sqrt(ends[0][:, 2] + ends[1][:, 2]))
    # To the right n_x grows towards the other side, and downwards n_y falls.
    for contour, along, part, sign in ((right, 1, 0, 1.0), (down, 0, 1, -1.0)):
        facing = np.maximum(sign * ends[0][:, part], -sign * ends[1][:, part]) > MIN_OUTWARD
        of_axis = is_contour & facing & (edges[:, 1, along] > edges[:, 0, along])
        contour[tuple(edges[of_axis, 0].T)] = True


def _edges(nodes: np.ndarray) -> np.ndarray:
    """Return the pairs (E, 2) of nodes, numbered in raster order, that lie side by side in nodes (H, W) bool."""
    numbers = np.full(nodes.shape, -1)
    numbers[nodes] = np.arange(nodes.sum())
    pairs = [(numbers[:, :-1], numbers[:, 1:]), (numbers[:-1], numbers[1:])]
    edges = np.concatenate([np.stack([first.ravel(), second.ravel()], axis=1) for first, second in pairs])
    return np.asarray(edges[(edges >= 0).all(axis=1)])


def _jumps(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where (H, W) bool normals (H, W, 3) differ much from their right neighbours, and from those below."""
    right, down = np.zeros((2, *normals.shape[:2]), bool)
    right[:, :-1] = np.linalg.norm(np.diff(normals[..., :2], axis=1), axis=-1) > MIN_JUMP
    down[:-1] = np.linalg.norm(np.diff(normals[..., :2], axis=0), axis=-1) > MIN_JUMP
    return right, down
