"""Highlights of the rounded creases of a faceted body: normals that turn from one face to the next, along it alone.

Round walls show such normals too, but beside the places of supposed creases as well as along them.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from glint.tasks.algorithms.facets.facet_view import FacetView
from glint.tasks.algorithms.facets.faceted_body import Creases, FacetedBody
from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.prisms.prism_evidence import (
    ADDED_EDGE_PX,
    ARC_NORMALS,
    EDGE_INRADII,
    FALSE_FACE_SHARE,
    FLASHED_DEG,
    LEAST_TURN_DEG,
    MIDDLE_SHARES,
    MIN_ARC_SHARE,
    PERPENDICULAR_DEG,
    PIECE_INRADII,
    STRAY_SHARE,
    share_log_ratio,
)
from glint.tasks.algorithms.prisms.right_prism import to_pixels

BESIDE_WIDTHS = 0.3
"""Distance from a crease, in widths of the face there, at which nothing may turn as it does: a round wall in place of
the faces would turn as far as half of that."""
MIN_CREASE_PX = 1.5
"""Length in pixels of the shortest crease that is looked at."""
MIN_FLASH_SHARE = 0.5
"""Share of the places inside along a crease that flash from which a face must not flash beyond it."""


def creases_log_ratio(body: FacetedBody, view: FacetView) -> float:
    """Return what the highlights of the rounded creases say, and flashes of their faces beyond them."""
    creases, reach = body.creases, round(EDGE_INRADII * view.inradius + ADDED_EDGE_PX)
    along = creases.ends - creases.starts
    lengths = np.linalg.norm(along, axis=1)
    used = lengths > MIN_CREASE_PX
    if not used.any():
        return 0.0
    creases = Creases(*(values[used] for values in creases))
    across = np.stack([-along[used, 1], along[used, 0]], axis=1) / lengths[used, None]
    # Each of the two faces lies on one side of the crease, as far as its width.
    offsets = (body.corners[creases.faces] - creases.starts[:, None, None]) @ across[:, None, :, None]
    widths = np.abs(offsets[..., 0]).max(axis=2)
    across *= np.sign(offsets[:, 1].mean(axis=(1, 2)))[:, None]
    first, second = body.normals[creases.faces[:, 0]], body.normals[creases.faces[:, 1]]
    arcs = unit(first + np.linspace(0.0, 1.0, ARC_NORMALS)[:, None, None] * (second - first))
    middles = np.broadcast_to((creases.starts + creases.ends) / 2.0, (ARC_NORMALS, len(first), 2))
    reached = view.flashing(arcs.reshape(-1, 3), middles.reshape(-1, 2)).reshape(ARC_NORMALS, -1).mean(axis=0)
    ends = [to_pixels(creases.starts + share * along[used], view.mask.shape) for share in MIDDLE_SHARES[:, 0]]
    is_wide = BESIDE_WIDTHS * widths > reach
    shares = _shares_at_creases(
        view.normals,
        np.stack(ends, axis=1),
        across * [1.0, -1.0],
        np.stack([first, second, creases.directions], axis=1),
        np.where(is_wide, np.minimum(BESIDE_WIDTHS * widths, 2 * reach + 1), 0.0),
        view.strays,
        reach,
        LIMITS,
    )
    # A face ends at its crease, and so do its flashes.
    beyond = share_log_ratio(1.0 - shares.beyond, FALSE_FACE_SHARE)
    beyond = np.where(shares.inside > MIN_FLASH_SHARE, np.minimum(beyond, 0.0), 0.0).sum(axis=1)
    # A round wall turns everywhere, not only at a crease.
    turning = share_log_ratio(shares.near, np.clip(np.maximum(shares.stray, shares.beside), *STRAY_SHARE))
    turning = np.where((reached >= MIN_ARC_SHARE) & np.isfinite(shares.beside), turning, 0.0)
    return float((lengths[used] * (beyond + turning)).sum() / (PIECE_INRADII * view.inradius))


class _CreaseShares(NamedTuple):
    """Shares of places with highlights, for each crease.

    inside, beyond: (C, 2), of its faces' normals, on the face's side of the crease and on the other. near, stray,
    beside: (C,), of normals between the two, along it, all over the silhouette, and beside it; the last NaN where its
    faces are too narrow.
    """

    inside: np.ndarray
    beyond: np.ndarray
    near: np.ndarray
    stray: np.ndarray
    beside: np.ndarray


class _Limits(NamedTuple):
    """Limits of cosines between normals.

    flashed: to a face of which a candidate is, at least. turned: to either face of a crease, of a candidate that lies
    between them, at most. across: of that candidate to the crease's direction, at most.
    """

    flashed: float
    turned: float
    across: float


LIMITS = _Limits(
    float(np.cos(np.radians(FLASHED_DEG))),
    float(np.cos(np.radians(LEAST_TURN_DEG))),
    float(np.sin(np.radians(PERPENDICULAR_DEG))),
)
"""Those of the evidence for prisms."""


@njit(cache=True, nogil=True)
def _shares_at_creases(
    normals: np.ndarray,
    ends: np.ndarray,
    across: np.ndarray,
    directions: np.ndarray,
    distances: np.ndarray,
    strays: np.ndarray,
    reach: int,
    limits: _Limits,
) -> _CreaseShares:
    """Return what candidates show at C creases.

    Args:
        normals: (H, W, K, 3), candidates.
        ends: (C, 2, 2), columns and rows of the creases' ends.
        across: (C, 2), unit, from each of them to its second face, likewise.
        directions: (C, 3, 3), normals of its faces, and its own direction.
        distances: (C, 2), pixels from the crease at which its first and second face are looked at; 0 if not.
        strays: (M, 2), columns and rows to compare with.
        reach: distance in pixels within which a highlight is near.
        limits: of the cosines.
    """
    count = len(ends)
    shares = _CreaseShares(
        np.empty((count, 2)), np.empty((count, 2)), np.empty(count), np.empty(count), np.full(count, np.nan)
    )
    for crease in range(len(ends)):
        start, end, way = ends[crease, 0], ends[crease, 1], across[crease]
        places = int(np.sqrt(((end - start) ** 2).sum())) + 1
        points = np.empty((places, 2))
        for place in range(places):
            points[place] = start + (end - start) * (place / max(places - 1, 1))
        first, second, direction = directions[crease]
        for face in range(2):
            sign = 2.0 * face - 1.0
            normal, step = directions[crease, face], sign * (reach + 1)
            shares.inside[crease, face] = _flash_share(normals, points + step * way, normal, limits.flashed)
            shares.beyond[crease, face] = _flash_share(normals, points - step * way, normal, limits.flashed)
        bounds = float((first * second).sum()), limits.turned, limits.across
        shares.near[crease] = _arc_share(normals, points, first, second, direction, bounds, reach)
        shares.stray[crease] = _arc_share(normals, strays, first, second, direction, bounds, reach)
        beside, faces = 0.0, 0
        for face in range(2):
            if distances[crease, face] > 0.0:
                strip = points + (2.0 * face - 1.0) * distances[crease, face] * way
                beside += _arc_share(normals, strip, first, second, direction, bounds, 1)
                faces += 1
        if faces:
            shares.beside[crease] = beside / faces
    return shares


@njit(cache=True, nogil=True)
def _flash_share(normals: np.ndarray, places: np.ndarray, normal: np.ndarray, min_cosine: float) -> float:
    """Return the share of places (N, 2), columns and rows, with a candidate (H, W, K, 3) that is this normal (3,)."""
    height, width, layers, _ = normals.shape
    flashes = 0
    for place in range(len(places)):
        column, row = int(np.rint(places[place, 0])), int(np.rint(places[place, 1]))
        if 0 <= row < height and 0 <= column < width:
            for layer in range(layers):
                x, y, z = normals[row, column, layer]
                if x * normal[0] + y * normal[1] + z * normal[2] > min_cosine:
                    flashes += 1
                    break
    return flashes / len(places)


@njit(cache=True, nogil=True)
def _arc_share(
    normals: np.ndarray,
    places: np.ndarray,
    first: np.ndarray,
    second: np.ndarray,
    direction: np.ndarray,
    bounds: tuple[float, float, float],
    reach: int,
) -> float:
    """Return the share of places (N, 2), columns and rows, near a candidate that turns from one face to the other.

    normals: (H, W, K, 3), candidates. first, second: (3,), normals of the faces. direction: (3,), of the crease.
    bounds: least and largest cosine to either face's normal, and largest one to the direction. reach: radius of a place
    in pixels.
    """
    near = 0
    for place in range(len(places)):
        row, column = int(np.rint(places[place, 1])), int(np.rint(places[place, 0]))
        near += _is_near_arc(normals, row, column, first, second, direction, bounds, reach)
    return near / len(places)


@njit(cache=True, nogil=True)
def _is_near_arc(
    normals: np.ndarray,
    row: int,
    column: int,
    first: np.ndarray,
    second: np.ndarray,
    direction: np.ndarray,
    bounds: tuple[float, float, float],
    reach: int,
) -> bool:
    """Return whether a pixel is near a candidate that turns from one face to the other; see `_arc_share`."""
    height, width, layers, _ = normals.shape
    least, most, across = bounds
    for i in range(max(row - reach, 0), min(row + reach + 1, height)):
        for j in range(max(column - reach, 0), min(column + reach + 1, width)):
            if (i - row) ** 2 + (j - column) ** 2 > reach**2:
                continue
            for layer in range(layers):
                x, y, z = normals[i, j, layer]
                if not abs(x * direction[0] + y * direction[1] + z * direction[2]) < across:
                    continue
                to_first = x * first[0] + y * first[1] + z * first[2]
                to_second = x * second[0] + y * second[1] + z * second[2]
                if least < to_first < most and least < to_second < most:
                    return True
    return False
