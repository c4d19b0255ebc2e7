"""Doubt of a mask: where its contour contradicts the video, and the probability that normals are wrong because of it.

A right contour is where background and highlights change most: farther in and farther out their edges are weaker.
Glass shows highlights up to its contour; where there are none, an estimated contour rests on refraction alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.connected_parts import largest_part
from glint.tasks.algorithms.geometry.contours import outermost_pixels
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.mask_checks.contour_offset import ContourEvidence, continued_beyond, misplacement
from glint.tasks.algorithms.masks.contour_edges import edge_image, signed_distance
from glint.tasks.algorithms.masks.mask_regions import large_components

MIN_FLASH_LEVELS, FLASH_QUANTILE, FLASH_FACTOR = 12.0, 0.995, 1.5
"""Levels by which a highlight stands out of its surroundings, and the quantile of what the table's pixels do that it
must exceed by a factor."""
TABLE_QUARTILES = 6.0
"""Bound of that quantile where the mask lacks a part of the object, in distances of the table's third quartile from its
median: half of it may be glass."""
SUPPORT_SHARE, MIN_SUPPORT_PX = 0.025, 2.0
"""Distance from the contour within which a highlight supports it: share of the square root of the object's area, and
at least, in pixels."""
MAX_WITHOUT_HIGHLIGHT = 0.07
"""Share of an estimated contour that may be without highlight: smooth glass shows them along all of it, and the masks
of solid objects have at most 0.05."""
MAX_CUT_SHARE = 0.01
"""Share of the contour that may lie along an edge of the picture."""
NECK_SHARE, MIN_PART_RATIO = 0.06, 0.1
"""Half the width of a neck, as a share of the square root of the object's area, and area of the part beyond it,
relative to the object's."""
RAGGED_RATIO, SMOOTH_SHARE, MIN_SMOOTH_PX = 1.25, 0.015, 1.5
"""Length of a contour relative to its smoothed self from which it is ragged, and the standard deviation of that
smoothing: share of the square root of the object's area, and at least, in pixels."""
SHIFT_DOUBT, SHAPE_DOUBT, UNSUPPORTED_DOUBT = 0.8, 0.5, 0.1
"""Probability that normals are wrong because the silhouette is: where the data contradict it, where it is cut off, has
a neck or is ragged, and where nothing supports it. Along the clear walls of glasses normals are right nevertheless: of
the confident ones of 42 captures 99% are, with any value from 0 to 0.5."""
MAX_SPHERE_SHARE, SPHERE_DOUBT = 0.05, 1.0
"""Share of a chrome sphere that a mask drawn by hand may cover, and doubt of the normals of what it covers."""
OVERALL_SHARE = 0.1
"""Doubt that a contour casts on the whole object where it is not known how far off it is, relative to the doubt at the
contour."""
TABLE_SHARES, MAX_TABLE_SHARE = (0.08, 0.03, 0.0), 0.5
"""Distances from the mask between which pixels show the table, as shares of the square root of its area: the first near
one at which there are enough, and the far one."""
ENOUGH_TABLE_PX = 100
"""Pixels that are enough to know the table."""
SURROUNDINGS_SIGMA_PX = 3.0
"""Standard deviation of the window that is a pixel's surroundings."""
REACH_INRADII = 0.3
"""Distance from a piece of contour at which its doubt has fallen to 1/e, in inradii, if its offset is not known."""

Kind = Literal["too large", "too small", "continued", "sphere", "corners", "cut", "neck", "ragged", "unsupported"]
"""What speaks against a mask: edges and highlights inside its contour, outside, and as dense beyond it as inside; a
chrome sphere that it covers; the four corners of the picture, if it covers them; the picture's edge; a neck; a ragged
contour; nothing that supports it."""


@dataclass(frozen=True, slots=True)
class Objection:
    """Evidence against a piece of a contour.

    share: of the contour, or of the sphere that is covered. offset: of the stronger edge, pixels outward. x, y: centre
    of the piece in pixels of the mask. doubt: probability that normals there are wrong because of it. piece: (H, W)
    bool, its pixels.
    """

    kind: Kind
    share: float
    offset: float
    x: float
    y: float
    doubt: float
    piece: np.ndarray


def mask_objections(
    mask: np.ndarray,
    background: np.ndarray,
    peak: np.ndarray,
    *,
    free: np.ndarray,
    estimated: bool,
    edges: np.ndarray,
) -> list[Objection]:
    """Compare a mask with the background and peak level, and return what speaks against it.

    Args:
        mask: (H, W) bool.
        background: (H, W), temporal median, 0 to 255.
        peak: (H, W), temporal maximum, 0 to 255.
        free: (H, W) bool, pixels beside the spheres.
        estimated: whether the mask was estimated; a given one need not have highlights everywhere.
        edges: (H, W) bool, pixels along the edge of the frame, or of a region that was cut out of it.
    """
    contour = outermost_pixels(mask) | (mask & edges)
    inverted = [] if estimated else _inverted(mask)
    if not contour.any():
        return inverted
    distance = signed_distance(mask)
    root_area = float(np.sqrt(mask.sum()))
    table = _table(distance, root_area, free)
    rise = np.clip(peak.astype(np.float32) - background, 0.0, None)
    flash = _highlights(rise, table)
    objections = inverted or _cut_off(mask, contour, edges)
    images = edge_image(background, table), edge_image(rise, table)
    evidence = ContourEvidence.of(contour, distance, images, free, root_area)
    shift = misplacement(evidence, flash)
    if shift is not None:
        share = float(shift.piece.sum() / contour.sum())
        objections.append(_objection(shift.kind, shift.piece, share, SHIFT_DOUBT, shift.offset))
    elif (piece := continued_beyond(evidence, _highlights(rise, table, may_have_glass=True))) is not None:
        objections.append(_objection("continued", piece, float(piece.sum() / contour.sum()), SHIFT_DOUBT))
    if estimated:
        objections += _unsupported(contour & ~edges, root_area, flash) + _misshapen(mask, contour, root_area)
    return objections


def covered_spheres(mask: np.ndarray, spheres: Sequence[Sphere]) -> list[Objection]:
    """Object to a mask (H, W) bool that covers chrome spheres, which are no part of the object.

    spheres: in pixels of the mask.
    """
    rows, columns = np.mgrid[: mask.shape[0], : mask.shape[1]]
    objections = []
    for sphere in spheres:
        covered = mask & (np.hypot(columns - sphere.x, rows - sphere.y) < sphere.radius)
        share = float(covered.sum() / (np.pi * sphere.radius**2))
        if share > MAX_SPHERE_SHARE:
            objections.append(_objection("sphere", covered, min(share, 1.0), SPHERE_DOUBT))
    return objections


def doubt_of(mask: np.ndarray, objections: Sequence[Objection]) -> np.ndarray:
    """Return the probability (H, W) float32 that a normal in a mask (H, W) bool is wrong because the silhouette is.

    It is highest beside a doubtful piece of contour and falls with the distance from it: over the offset of the contour
    where that is known; else over a part of the object, and it does not vanish anywhere.
    """
    trusted = np.ones(mask.shape)
    inradius = max(inradius_of(mask), 1.0)
    for objection in objections:
        reach, overall = REACH_INRADII * inradius, OVERALL_SHARE * objection.share
        if objection.offset != 0.0:
            # Only normals near the contour follow from where that lies.
            reach, overall = abs(objection.offset), 0.0
        local = np.exp(-ndimage.distance_transform_edt(~objection.piece) / reach)
        trusted *= 1.0 - objection.doubt * np.maximum(local, overall)
    return np.where(mask, 1.0 - trusted, 0.0).astype(np.float32)


def _table(distance: np.ndarray, root_area: float, free: np.ndarray) -> np.ndarray:
    """Return the pixels (H, W) bool that show the table: at some distance from the mask, nearer if there are none."""
    for share in TABLE_SHARES:
        table = (distance > share * root_area + 1.0) & (distance < MAX_TABLE_SHARE * root_area) & free
        if table.sum() > ENOUGH_TABLE_PX:
            break
    return table


def _highlights(rise: np.ndarray, table: np.ndarray, *, may_have_glass: bool = False) -> np.ndarray:
    """Return the pixels (H, W) bool of highlights: those whose rise stands out of its surroundings.

    may_have_glass: whether a part of what is taken for the table may be of the object.
    """
    flash = rise - cv2.GaussianBlur(rise, (0, 0), SURROUNDINGS_SIGMA_PX)
    median, quartile, of_table = np.quantile(flash[table], [0.5, 0.75, FLASH_QUANTILE]) if table.any() else np.zeros(3)
    if may_have_glass:
        of_table = min(of_table, median + TABLE_QUARTILES * (quartile - median))
    return np.asarray(flash > max(FLASH_FACTOR * of_table, MIN_FLASH_LEVELS))


def _cut_off(mask: np.ndarray, contour: np.ndarray, edges: np.ndarray) -> list[Objection]:
    """Object to a contour along an edge of the picture, where the object goes on and its silhouette does not end."""
    cut = mask & edges
    share = float(cut.sum() / contour.sum())
    return [_objection("cut", cut, share, SHAPE_DOUBT)] if share > MAX_CUT_SHARE else []


def _inverted(mask: np.ndarray) -> list[Objection]:
    """Object to a mask that covers all four corners: it is inverted, or its object goes on beyond the picture."""
    if not mask[:: len(mask) - 1 or 1, :: mask.shape[1] - 1 or 1].all():
        return []
    frame = np.ones(mask.shape, bool)
    frame[1:-1, 1:-1] = False
    return [_objection("corners", mask & frame, float(mask[frame].mean()), SHIFT_DOUBT)]


def _unsupported(contour: np.ndarray, root_area: float, flash: np.ndarray) -> list[Objection]:
    """Object to a contour along which no highlight was recorded."""
    lonely = contour & (ndimage.distance_transform_edt(~flash) > max(MIN_SUPPORT_PX, SUPPORT_SHARE * root_area))
    share = float(lonely.sum() / max(int(contour.sum()), 1))
    return [_objection("unsupported", lonely, share, UNSUPPORTED_DOUBT)] if share > MAX_WITHOUT_HIGHLIGHT else []


def _misshapen(mask: np.ndarray, contour: np.ndarray, root_area: float) -> list[Objection]:
    """Object to parts that only a neck joins, and to a ragged contour."""
    objections = []
    radius = max(1, round(NECK_SHARE * root_area))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    opened = large_components(cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, disc) > 0, MIN_PART_RATIO)
    if ndimage.label(opened)[1] > ndimage.label(large_components(mask, MIN_PART_RATIO))[1]:
        neck = contour & ~ndimage.binary_dilation(opened, iterations=2)
        if neck.any():
            objections.append(_objection("neck", neck, float(neck.sum() / contour.sum()), SHAPE_DOUBT))
    smooth = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), max(MIN_SMOOTH_PX, SMOOTH_SHARE * root_area)) > 0.5
    ragged = _perimeter(mask) / max(_perimeter(smooth), 1.0)
    if ragged > RAGGED_RATIO:
        piece = contour & (mask ^ smooth | ndimage.binary_dilation(mask ^ smooth))
        objections.append(_objection("ragged", piece if piece.any() else contour, 1.0 - 1.0 / ragged, SHAPE_DOUBT))
    return objections


def _perimeter(mask: np.ndarray) -> float:
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    return float(sum(cv2.arcLength(contour, True) for contour in contours))


def _objection(kind: Kind, piece: np.ndarray, share: float, doubt: float, offset: float = 0.0) -> Objection:
    """Return an objection to the largest part of a piece, whose centre is reported."""
    rows, columns = np.nonzero(largest_part(piece, diagonal=True) if share < 1.0 else piece)
    return Objection(kind, share, offset, float(columns.mean()), float(rows.mean()), doubt, piece)
