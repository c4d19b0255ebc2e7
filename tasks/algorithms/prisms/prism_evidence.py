"""How much candidates speak for a right prism: whole faces that flashed, and the highlights of rounded edges.

Edges of real glass are rounded: across one the normal turns from that of one face to that of the other, perpendicular
to the edge. So the highlights along it show its direction in space, even where neither face showed the light. Light
that crosses the glass shows such normals too, but anywhere: what counts is how many more there are along the edges than
elsewhere in the silhouette.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from glint.tasks.algorithms.geometry.distance import depth_inside, inradius_of
from glint.tasks.algorithms.geometry.perspective import rotate_from_view, rotate_to_view, to_camera_directions
from glint.tasks.algorithms.geometry.vectors import positions_at, unit
from glint.tasks.algorithms.prior.swept_normals import SweptNormals
from glint.tasks.algorithms.prisms.right_prism import Crease, RightPrism, to_pixels

FLASHED_DEG = 3.0
"""Degrees from a face's normal within which a candidate belongs to it."""
PERPENDICULAR_DEG, LEAST_TURN_DEG = 2.5, 3.0
"""Degrees from the perpendicular to a crease within which a candidate may belong to the rounded edge, and by which it
turns away from either face at least."""
EDGE_INRADII, ADDED_EDGE_PX = 0.05, 1.0
"""Half the width in inradii of the strip along a crease in which its highlights are looked for, and added pixels."""
MIDDLE_SHARES = np.array([[0.12], [0.88]])
"""Part of a crease, as shares of the way along it, that is looked at: ends are rounded corners."""
PIECE_INRADII = 0.1
"""Length in inradii of a crease, or of the side of a part of a face, that is a piece of evidence of its own."""
TRUE_SHARE, STRAY_SHARE, FALSE_FACE_SHARE = 0.8, (0.05, 0.7), 0.1
"""Share of a true crease or face that shows its highlights; bounds of that of a false crease, and of a false face."""
ARC_NORMALS, MIN_ARC_SHARE = 15, 0.25
"""Normals of a rounded edge that are looked at, and the share that lights must have reached."""


@dataclass(frozen=True, slots=True, eq=False)
class ShownNormals:
    """Candidates of a view in the camera frame, without gaps.

    normals: (M, 3). pixels: (M,), flat positions of their pixels. mask: (H, W) bool. inradius: of the mask, in pixels.
    inverse_focal: 1 over the focal length in pixels, 0 for parallel rays. swept: normals that the lights reached,
    relative to the view rays.
    """

    normals: np.ndarray
    pixels: np.ndarray
    mask: np.ndarray
    inradius: float
    inverse_focal: float
    swept: SweptNormals

    @classmethod
    def of(cls, candidates: np.ndarray, mask: np.ndarray, inverse_focal: float = 0.0) -> "ShownNormals | None":
        """Return those of candidates (K, H, W, 3; NaN without), relative to the view rays, in a mask; None: none."""
        swept = SweptNormals.of(candidates)
        layers, rows, columns = np.nonzero(np.isfinite(candidates[..., 0]) & mask)
        if swept is None:
            return None
        x, y = positions_at(rows, columns, mask.shape)
        view = unit(to_camera_directions(x, y, inverse_focal))
        normals = rotate_from_view(candidates[layers, rows, columns].astype(np.float64), view)
        return cls(
            normals.astype(np.float64), rows * mask.shape[1] + columns, mask, inradius_of(mask), inverse_focal, swept
        )

    def flashing(self, normals: np.ndarray, place: np.ndarray) -> np.ndarray:
        """Return which of normals (N, 3), camera frame, the lights reached at an image position (2,)."""
        view = unit(to_camera_directions(place[0], place[1], self.inverse_focal))
        return self.swept.flashes(rotate_to_view(normals, np.broadcast_to(view, normals.shape)))

    def where(self, shows: np.ndarray) -> np.ndarray:
        """Return the pixels (H, W) bool one of whose normals is chosen, `shows` (M,) bool."""
        result = np.zeros(self.mask.shape, bool)
        result.ravel()[self.pixels[shows]] = True
        return result


def prism_log_ratio(prism: RightPrism, shown: ShownNormals) -> float:
    """Return the log-likelihood ratio, nats, of candidates with this prism against candidates of another solid."""
    faces = prism.faces(shown.mask.shape)
    ratio = sum(_face_log_ratio(number, prism, faces, shown) for number in range(len(prism.normals)))
    return float(ratio + sum(_crease_log_ratio(crease, prism, shown) for crease in prism.creases))


def _face_log_ratio(number: int, prism: RightPrism, faces: np.ndarray, shown: ShownNormals) -> float:
    """Return what the inside of a face says; faces (H, W): their numbers."""
    inside = depth_inside((faces == number) & shown.mask) > EDGE_INRADII * shown.inradius + ADDED_EDGE_PX
    if not inside.any():
        return 0.0
    normal = prism.normals[number]
    flashing = shown.where(shown.normals @ normal > np.cos(np.radians(FLASHED_DEG)))
    ratio = share_log_ratio(float(flashing[inside].mean()), FALSE_FACE_SHARE)
    if ratio < 0.0 and not shown.flashing(normal[None], prism.corners[number].mean(axis=0)).all():
        return 0.0
    return float(ratio * np.sqrt(inside.sum()) / (PIECE_INRADII * shown.inradius))


def _crease_log_ratio(crease: Crease, prism: RightPrism, shown: ShownNormals) -> float:
    """Return what the highlights of a rounded edge say."""
    first, second = (prism.normals[face] for face in crease.faces)
    share = np.linspace(0.0, 1.0, ARC_NORMALS)[:, None]
    arc = unit((1.0 - share) * first + share * second)
    line = _pixels_along(crease, shown)
    if not line.any() or shown.flashing(arc, (crease.start + crease.end) / 2.0).mean() < MIN_ARC_SHARE:
        return 0.0
    shows = np.abs(shown.normals @ crease.direction) < np.sin(np.radians(PERPENDICULAR_DEG))
    for normal in (first, second):
        along = shown.normals @ normal
        shows &= (along > first @ second) & (along < np.cos(np.radians(LEAST_TURN_DEG)))
    reach = round(EDGE_INRADII * shown.inradius + ADDED_EDGE_PX)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    near = cv2.dilate(shown.where(shows).astype(np.uint8), disc)
    stray = float(np.clip(near[shown.mask].mean(), *STRAY_SHARE))
    length = float(np.linalg.norm(crease.end - crease.start))
    return float(share_log_ratio(float(near[line].mean()), stray) * length / (PIECE_INRADII * shown.inradius))


def share_log_ratio(share: float | np.ndarray, false_share: float | np.ndarray) -> np.ndarray:
    """Return what shares (...) of places with highlights say, per place; false_share: of a false face or crease."""
    bright, dark = np.log(TRUE_SHARE / false_share), np.log((1.0 - TRUE_SHARE) / (1.0 - false_share))
    return np.asarray(share * bright + (1.0 - share) * dark)


def _pixels_along(crease: Crease, shown: ShownNormals) -> np.ndarray:
    """Return the pixels (H, W) bool along a crease without its ends, which are rounded corners."""
    ends = crease.start + MIDDLE_SHARES * (crease.end - crease.start)
    (left, top), (right, bottom) = np.round(to_pixels(ends, shown.mask.shape)).astype(int).tolist()
    result = np.zeros(shown.mask.shape, np.uint8)
    cv2.line(result, (left, top), (right, bottom), 1)
    return (result > 0) & shown.mask
