"""Object mask of a bare video: where pixels do not follow the light as the table does.

Yeung et al. 2009 take the silhouette as given (section 4.1). Here a first cut separates object and table
(`table_separation`), and a second one moves the contour to the edges nearby (`outline`). Both are repeated with what a
pixel shows under the lights of its own side of the object (`unshadowed_response`): what is the bare table then was a
shadow of the object, or its caustics, unless its contour is an edge of the background.
"""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.grid_cut import grid_cut, links
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.masks.contour_edges import MIN_EDGE_RATIO, edge_image, edges_of_pieces
from glint.tasks.algorithms.masks.mask_regions import large_components
from glint.tasks.algorithms.masks.outline import refined_mask, wall_images
from glint.tasks.algorithms.masks.table_separation import Separation, separate
from glint.tasks.algorithms.table.light_sectors import sectors_of
from glint.tasks.algorithms.table.table_response import TableResponse, table_response
from glint.tasks.algorithms.table.unshadowed_response import unshadowed_response

EXCLUDED_RADII = 1.3
"""Radii around a sphere's centre that are excluded: beside the sphere lie its caustics."""
MIN_KNOWN_LIGHTS, UNSHADOWED_ROUNDS = 60, 2
"""Least number of frames with a known light for the lights that pass the object to show its shadows, and times that its
outline chooses these lights."""
WINDOW_MARGIN_SHARE = 0.2
"""Margin about the object and the table around it beyond which nothing is looked at, as a share of the square root of
the object's area: for walls and feet, and for what is smoothed."""
SHADOW_CUTS = (0.1, 1.0), (0.03, 0.5)
"""Of each cut for a contour within a shadow, the nats by which a pixel is preferred inside, as that contour is shorter,
and the edge, in edges of the table's texture, below which the contour outside may be a shadow's."""
MIN_SHADOW_SHARE = 0.3
"""Share of a shadow's pixels that differ from the table, but not under the lights that pass the object."""


def estimate_mask(
    frames: np.ndarray, *, spheres: Sequence[Sphere] = (), within: np.ndarray | None = None
) -> np.ndarray:
    """Estimate the mask (H, W) bool of the object from a sample of the frames; empty if no connected area flashes.

    Args:
        frames: (T, H, W) uint8, spread over the video.
        spheres: chrome spheres in these pixels; they are excluded, with the object's reflections in them.
        within: (H, W) bool, where the object lies; None: anywhere.

    Raises:
        UnusableCapture: no pixel shows a highlight, or nearly all do.
        ValueError: frames are not (T, H, W) uint8.
    """
    if frames.ndim != 3 or frames.dtype != np.uint8:
        raise ValueError(f"frames have shape {frames.shape} and dtype {frames.dtype}, expected (T, H, W) uint8")
    free = beside_spheres(frames.shape[1:], spheres)
    allowed = free if within is None else free & within
    response = table_response(frames, free)
    parts = separate(response, free, allowed)
    result, window = np.zeros_like(free), _around(parts)
    response = response.within(window, parts.is_table)
    parts, free, allowed = parts.within(window), free[window], allowed[window]
    mask = refined_mask(parts, response, free, allowed)
    sectors = sectors_of(frames, spheres)
    if (sectors >= 0).sum() >= MIN_KNOWN_LIGHTS:
        mask = _without_shadows(mask, parts, response, frames[:, *window], sectors, free, allowed)
    result[window] = mask
    return result


def _without_shadows(
    mask: np.ndarray,
    parts: Separation,
    response: TableResponse,
    frames: np.ndarray,
    sectors: np.ndarray,
    free: np.ndarray,
    allowed: np.ndarray,
) -> np.ndarray:
    """Return a mask (H, W) bool without the pieces that are shadows or caustics of the table.

    A clear wall on the side where no light stood is like the unshadowed table too. But its outer contour is an edge of
    the background, and what would replace it is none.

    parts: the separation by all lights. response, free, allowed: see `separate`. frames, sectors: see
    `unshadowed_response`.
    """
    outline = mask
    try:
        for _ in range(UNSHADOWED_ROUNDS):
            unshadowed = unshadowed_response(response, frames, sectors, outline)
            bare = separate(unshadowed, free, allowed)
            outline = bare.filled
        outline = refined_mask(bare, unshadowed, free, allowed)
    except UnusableCapture:
        return mask
    inside = mask & ndimage.binary_fill_holes(mask & outline)
    is_shadow = (parts.ratios > 0.0) & (bare.ratios < 0.0)
    lines, *responses = wall_images(parts, response.background)
    brightness = edge_image(response.background, parts.is_table)
    capacities = links([brightness, lines, *responses, *bare.responses], 1.0)
    for bonus, max_edge in SHADOW_CUTS:
        inner = mask & grid_cut(np.full(mask.shape, bonus), capacities, inside, ~mask)
        mask = large_components(mask & ~_shadow_pieces(inner, mask, is_shadow, lines, max_edge))
    return mask


def _shadow_pieces(
    inner: np.ndarray, mask: np.ndarray, is_shadow: np.ndarray, lines: np.ndarray, max_edge: float
) -> np.ndarray:
    """Return the pieces (H, W) bool of a mask beside an inner one that are shadows, with a weaker edge outside."""
    result = np.zeros_like(mask)
    for grown, piece, strength, replacement in edges_of_pieces(inner, mask, lines):
        is_weaker = strength < max_edge and replacement > MIN_EDGE_RATIO * strength
        if is_weaker and is_shadow[grown][piece].mean() > MIN_SHADOW_SHARE:
            result[grown] |= piece
    return result


def beside_spheres(shape: tuple[int, ...], spheres: Sequence[Sphere]) -> np.ndarray:
    """Return the pixels (H, W) bool that lie beside the spheres."""
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    free = np.ones(shape, bool)
    for sphere in spheres:
        free &= np.hypot(columns - sphere.x, rows - sphere.y) > EXCLUDED_RADII * sphere.radius
    return free


def _around(parts: Separation) -> tuple[slice, slice]:
    """Return the rows and columns of a separated object, of the table around it and of a margin."""
    shown = parts.filled | parts.is_table
    margin = round(WINDOW_MARGIN_SHARE * float(np.sqrt(parts.filled.sum())))
    rows, columns = (np.flatnonzero(shown.any(axis=axis)) for axis in (1, 0))
    return (
        slice(max(0, rows[0] - margin), rows[-1] + 1 + margin),
        slice(max(0, columns[0] - margin), columns[-1] + 1 + margin),
    )
