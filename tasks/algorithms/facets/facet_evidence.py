"""How much a view speaks for a faceted body: its silhouette, whole facets that flashed, and their rounded creases.

What flashes and creases say of a solid of flat faces is that of right prisms (`prism_evidence`). Of the many bodies
that are compared, a facet also must end where its flashes do, and the silhouette must be filled.
"""

import cv2
import numpy as np
from numba import njit

from glint.tasks.algorithms.facets.facet_view import FacetView
from glint.tasks.algorithms.facets.faceted_body import FacetedBody
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
from glint.tasks.algorithms.prisms.right_prism import Crease, to_pixels

UNFILLED_NATS = 4.0
"""What a piece of the silhouette that the body does not fill speaks against it."""


def facet_log_ratio(body: FacetedBody, view: FacetView) -> float:
    """Return the log-likelihood ratio, nats, of a view of this body against one of another object."""
    if not len(body.normals):
        return -np.inf
    faces = body.faces(view.mask.shape)
    piece = PIECE_INRADII * view.scale
    unfilled = int((view.inner & (faces < 0)).sum())
    return float(
        _faces_log_ratio(body, faces, view) + _creases_log_ratio(body, view) - UNFILLED_NATS * unfilled / piece**2
    )


def _faces_log_ratio(body: FacetedBody, faces: np.ndarray, view: FacetView) -> float:
    """Return what the insides of the visible faces, numbered (H, W), say."""
    count = len(body.normals)
    reach = round(EDGE_INRADII * view.scale + ADDED_EDGE_PX)
    inside = faces.copy()
    inside[_near_edges(faces, reach) | ~view.mask] = -1
    normals, pixels = view.shown
    numbers = inside.ravel()[pixels]
    belongs = (normals * body.normals[numbers]).sum(axis=1) > np.cos(np.radians(FLASHED_DEG))
    flashes = np.zeros(faces.size, bool)
    flashes[pixels[belongs & (numbers >= 0)]] = True
    areas = np.bincount(inside[inside >= 0], minlength=count)
    shares = np.bincount(inside.ravel()[flashes], minlength=count) / np.maximum(areas, 1)
    ratios = share_log_ratio(shares, FALSE_FACE_SHARE)
    middles = np.array([corners.mean(axis=0) for corners in body.corners])
    ratios = np.where((ratios < 0.0) & ~view.flashing(body.normals, middles), 0.0, ratios)
    return float((ratios * np.sqrt(areas)).sum() / (PIECE_INRADII * view.scale))


def _near_edges(faces: np.ndarray, reach: int) -> np.ndarray:
    """Return the pixels (H, W) bool within `reach` pixels of one that belongs to another face."""
    high, low = (morph(faces, np.ones((3, 3), np.uint8)) for morph in (cv2.dilate, cv2.erode))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach - 1, 2 * reach - 1))
    return np.asarray(cv2.dilate((high != low).astype(np.uint8), disc) > 0)


def _creases_log_ratio(body: FacetedBody, view: FacetView) -> float:
    """Return what the highlights of the rounded creases say, and flashes of their faces beyond them."""
    creases = body.creases
    if not creases:
        return 0.0
    first, second = (body.normals[[crease.faces[end] for crease in creases]] for end in (0, 1))
    shares = np.linspace(0.0, 1.0, ARC_NORMALS)[:, None, None]
    arcs = unit((1.0 - shares) * first + shares * second)
    middles = np.array([(crease.start + crease.end) / 2.0 for crease in creases])
    places = np.broadcast_to(middles, (ARC_NORMALS, *middles.shape))
    flashing = view.flashing(arcs.reshape(-1, 3), places.reshape(-1, 2)).reshape(ARC_NORMALS, -1)
    reach = round(EDGE_INRADII * view.scale + ADDED_EDGE_PX)
    total = 0.0
    for number in range(len(creases)):
        crease, pair = creases[number], (first[number], second[number])
        length = float(np.linalg.norm(crease.end - crease.start)) / (PIECE_INRADII * view.scale)
        points, beside = _places_along(crease, body, view.mask.shape, reach + 1.0)
        if not len(points):
            continue
        # A face ends at its crease, and so do its flashes.
        for normal, side in zip(pair, (1.0, -1.0), strict=True):
            inner, outer = (
                _flash_share(view.normals, points - sign * side * beside, normal, _COS_FLASHED) for sign in (1.0, -1.0)
            )
            if inner > 0.5:
                total += length * min(0.0, share_log_ratio(1.0 - outer, FALSE_FACE_SHARE))
        if flashing[:, number].mean() >= MIN_ARC_SHARE:
            bounds = float(pair[0] @ pair[1]), _COS_TURNED, _SIN_PERPENDICULAR
            shown, stray = (
                _arc_share(view.normals, where.astype(np.int64), *pair, crease.direction, bounds, reach)
                for where in (np.rint(points), view.strays)
            )
            total += length * share_log_ratio(shown, float(np.clip(stray, *STRAY_SHARE)))
    return total


_COS_FLASHED = float(np.cos(np.radians(FLASHED_DEG)))
_COS_TURNED, _SIN_PERPENDICULAR = (
    float(np.cos(np.radians(LEAST_TURN_DEG))),
    float(np.sin(np.radians(PERPENDICULAR_DEG))),
)


def _places_along(
    crease: Crease, body: FacetedBody, shape: tuple[int, ...], distance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return columns and rows (N, 2) a pixel apart along a crease without its ends, which are rounded corners.

    Also the way (2,) from there, so many pixels long, into the second of its faces.
    """
    start, end = to_pixels(crease.start + MIDDLE_SHARES * (crease.end - crease.start), shape)
    length = float(np.linalg.norm(end - start))
    if length < 1.0:
        return np.zeros((0, 2)), np.zeros(2)
    points = start + np.linspace(0.0, 1.0, int(length) + 1)[:, None] * (end - start)
    across = np.array([start[1] - end[1], end[0] - start[0]]) / length
    inward = to_pixels(body.corners[crease.faces[1]], shape).mean(axis=0) - (start + end) / 2.0
    return points, across * distance * (np.sign(across @ inward) or 1.0)


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
    """Return the share of places (N, 2) int, columns and rows, near a candidate that turns from one face to the other.

    normals: (H, W, K, 3), candidates. first, second: (3,), normals of the faces. direction: (3,), of the crease.
    bounds: of the cosines to the faces' normals, and of that to the direction. reach: radius of a place in pixels.
    """
    height, width, layers, _ = normals.shape
    least, most, across = bounds
    near = 0
    for place in range(len(places)):
        is_near = False
        for down in range(-reach, reach + 1):
            row = places[place, 1] + down
            if is_near or not 0 <= row < height:
                continue
            for right in range(-reach, reach + 1):
                column = places[place, 0] + right
                if is_near or right * right + down * down > reach * reach or not 0 <= column < width:
                    continue
                for layer in range(layers):
                    x, y, z = normals[row, column, layer]
                    if not abs(x * direction[0] + y * direction[1] + z * direction[2]) < across:
                        continue
                    to_first = x * first[0] + y * first[1] + z * first[2]
                    to_second = x * second[0] + y * second[1] + z * second[2]
                    if least < to_first < most and least < to_second < most:
                        is_near = True
                        break
        near += is_near
    return near / len(places)
