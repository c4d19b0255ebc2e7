"""Offset of a mask's contour from the strongest edges nearby: masks that are too large or too small, and those beyond
which the object goes on."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from scipy import ndimage

SEARCH_SHARE, MIN_SEARCH_PX = 0.04, 6
"""Distance from the contour in which a stronger edge is looked for: share of the square root of the object's area, and
at least, in pixels."""
BEYOND_PX = 1.5
"""Distance from the contour beyond which highlights lie outside of it: nearer ones are blur."""
MIN_OFFSET_PX = 2
"""Distance of a stronger edge that is reported: nearer ones are within the blur of the contour."""
INWARD_RATIO, OUTWARD_RATIO = 1.5, 1.05
"""Strength of an edge farther in, or farther out, relative to that at the contour, which contradicts a mask. Glass has
edges inside: up to 1.2 times those of a right contour, while the table beside it has at most 0.9 times these."""
MIN_OWN_EDGE, MIN_WALL_PX = 0.3, 3
"""Strength of the edge at a contour, above the table's and relative to one farther in, from which it is that of a right
mask although that one is stronger: thin walls have 0.30 to 0.57, masks 3 or 5 pixels too large of 52 captures up to
0.29, which is the blur of the right contour. Distance of the inner one, below which all edges are blur."""
TABLE_STEPS = 3
"""Outermost steps of the profile, which show the table."""
MAX_EDGE_STRENGTH = 6.0
"""Bound of an edge's strength, in edges of the table: one highlight shall not outweigh the whole contour."""
MAX_OUTER_HIGHLIGHTS = 0.4
"""Share of the contour that may have highlights beyond it: caustics beside the object make some."""
OUTER_DENSITY = 0.05
"""Share of the pixels beyond a part of the contour that highlights there fill at least."""
CONTINUED_RATIO = 0.3
"""Density of highlights beyond a part of the contour, relative to the usual one inside, from which it may go on."""
MIN_CONTINUED_SHARE, MAX_OWN_EDGE_RATIO = 0.08, 1.5
"""Share of the contour beyond which it must, and ratio of the edges there to those farther out up to which it does: of
47 right masks none has highlights beyond its contour, except where caustics lie beside it, and its edges are 3.6 times
as strong then; of masks that lack half of the object, or are moved or mirrored, 0.8 to 1.4 times."""
PARTS = 24
"""Parts of equal length into which the contour is divided."""


@dataclass(frozen=True, slots=True)
class Misplacement:
    """A contour beside its object's.

    offset: of the strongest edge, pixels outward, 0 if unknown; piece: (H, W) bool, the pixels of the contour that are
    affected.
    """

    kind: Literal["too large", "too small"]
    offset: float
    piece: np.ndarray


@dataclass(frozen=True, slots=True)
class ContourEvidence:
    """What the contour of a mask is compared with.

    contour: (H, W) bool, the outermost pixels of the mask. distance: (H, W), from the contour, negative inside, pixels.
    images: (H, W) each, see `edge_image`. free: (H, W) bool, pixels beside the spheres. reach: distance from the
    contour in which a stronger edge is looked for, pixels.
    """

    contour: np.ndarray
    distance: np.ndarray
    images: Sequence[np.ndarray]
    free: np.ndarray
    reach: int

    @classmethod
    def of(
        cls, contour: np.ndarray, distance: np.ndarray, images: Sequence[np.ndarray], free: np.ndarray, root_area: float
    ) -> "ContourEvidence":
        """Return the evidence, with the reach for a mask whose area has this square root, pixels."""
        return cls(contour, distance, images, free, max(MIN_SEARCH_PX, round(SEARCH_SHARE * root_area)))


def misplacement(evidence: ContourEvidence, flash: np.ndarray) -> Misplacement | None:
    """Return how a contour lies beside the strongest edges or inside of highlights; None: it does not.

    flash: (H, W) bool, pixels of highlights.
    """
    contour, distance, reach = evidence.contour, evidence.distance, evidence.reach
    profile = _edge_profile(evidence, evidence.free)
    at_contour = float(profile[reach])
    inward, outward = profile[: reach - MIN_OFFSET_PX + 1], profile[reach + MIN_OFFSET_PX :]
    if outward.max() > OUTWARD_RATIO * at_contour and outward.max() > inward.max() / INWARD_RATIO:
        return Misplacement("too small", float(outward.argmax()) + MIN_OFFSET_PX, contour)
    inner = int(inward.argmax())
    if inward[inner] > INWARD_RATIO * at_contour and not _has_own_edge(profile, inner):
        return Misplacement("too large", float(inner - reach), contour)
    beyond = (
        _beside_outer_highlights(contour, flash, (distance > BEYOND_PX) & (distance <= reach) & evidence.free) & contour
    )
    if beyond.sum() > MAX_OUTER_HIGHLIGHTS * contour.sum():
        return Misplacement("too small", 0.0, beyond)
    return None


def continued_beyond(evidence: ContourEvidence, flash: np.ndarray) -> np.ndarray | None:
    """Return the piece (H, W) bool of a contour beyond which the object goes on; None: it does nowhere.

    Highlights are at least CONTINUED_RATIO times as dense there as inside, and the contour is hardly a stronger edge
    than what lies beyond it; beside a caustic it is a much stronger one.

    flash: (H, W) bool, pixels of highlights, as many of the object's as possible.
    """
    contour, distance, free, reach = evidence.contour, evidence.distance, evidence.free, evidence.reach
    parts = _parts(contour)
    outside = (distance > BEYOND_PX) & (distance <= reach) & free
    inside = (distance < 0.0) & (distance >= -reach) & free
    usual = float(np.median(_density(parts, flash, inside)))
    is_beside = (_density(parts, flash, outside) > max(CONTINUED_RATIO * usual, OUTER_DENSITY))[parts]
    piece = contour & is_beside
    if piece.sum() < MIN_CONTINUED_SHARE * contour.sum():
        return None
    profile = _edge_profile(evidence, free & is_beside)
    own, beyond = profile[reach - 1 : reach + 2].max(), profile[reach + 2 :].max()
    return piece if own < MAX_OWN_EDGE_RATIO * beyond else None


def _edge_profile(evidence: ContourEvidence, used: np.ndarray) -> np.ndarray:
    """Return the mean strength (2 reach + 1,) of edges parallel to the contour by their distance, outward.

    used: (H, W) bool, pixels that count.
    """
    distance, images, reach = evidence.distance, evidence.images, evidence.reach
    down, right = np.gradient(cv2.GaussianBlur(distance, (0, 0), 1.0))
    length = np.hypot(down, right) + 1e-6
    strength = np.zeros(distance.shape)
    for image in images:
        image_down, image_right = np.gradient(image)
        strength += np.minimum(np.abs(image_down * down + image_right * right) / length, MAX_EDGE_STRENGTH)
    used = (np.abs(distance) < reach) & used
    # Distances from a straight contour are all halfway between two steps, and count for both.
    step = np.floor(distance[used]).astype(int) + reach
    beyond = distance[used] + reach - step
    count, total = (
        np.bincount(step, (1.0 - beyond) * value, 2 * reach + 1) + np.bincount(step + 1, beyond * value, 2 * reach + 1)
        for value in (1.0, strength[used])
    )
    mean = total / np.maximum(count, 1e-6)
    return np.convolve(np.pad(mean, 1, mode="edge"), [0.25, 0.5, 0.25], "valid")


def _has_own_edge(profile: np.ndarray, inner: int) -> bool:
    """Return whether the contour, in the middle of a profile, is an edge beside the stronger one farther in.

    A thin wall is seen through, but for the band in which its inner side reflects all light: where that band ends, a
    vessel has its strongest edge. What lies between the contour of a mask that is too large and the object is table.

    profile: of `_edge_profile`; inner: number of the stronger edge in it.
    """
    middle, table = len(profile) // 2, profile[-TABLE_STEPS:].mean()
    is_edge = profile[middle] - table >= MIN_OWN_EDGE * (profile[inner] - table)
    return middle - inner >= MIN_WALL_PX and bool(is_edge)


def _beside_outer_highlights(contour: np.ndarray, flash: np.ndarray, band: np.ndarray) -> np.ndarray:
    """Return the pixels (H, W) bool whose part of the contour has highlights in a band (H, W) bool beyond it."""
    parts = _parts(contour)
    return np.asarray((_density(parts, flash, band) > OUTER_DENSITY)[parts])


def _parts(contour: np.ndarray) -> np.ndarray:
    """Return the number (H, W) of the part of a contour (H, W) bool that is nearest to a pixel.

    Parts have equal numbers of pixels, in order of their direction from the centre.
    """
    rows, columns = np.nonzero(contour)
    turn = np.arctan2(rows - rows.mean(), columns - columns.mean())
    parts = np.zeros(contour.shape, int)
    parts[rows, columns] = np.argsort(np.argsort(turn)) * PARTS // len(rows)
    nearest = ndimage.distance_transform_edt(~contour, return_distances=False, return_indices=True)
    return np.asarray(parts[tuple(nearest)])


def _density(parts: np.ndarray, flash: np.ndarray, band: np.ndarray) -> np.ndarray:
    """Return the share (PARTS,) of the pixels of a band (H, W) bool that highlights fill, by the part beside them."""
    return np.bincount(parts[flash & band], minlength=PARTS) / np.maximum(np.bincount(parts[band], minlength=PARTS), 1)
