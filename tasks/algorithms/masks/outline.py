"""Outline of an estimated mask: the contour of a separation, moved to the edges of the background and of the response.

Walls of glasses refract the table without any highlight: the contour moves out to an edge of the background that is
stronger than the one that it leaves, then farther to a clear line of it, as the outer face of a thin wall is, and to
that which both sides of a vessel show (`symmetric_walls`), all the more where the texture is not the table's
(`table_texture`); and in from the blur of highlights at the rim. A round foot is added, of which only the rim differs
from the table (`round_foot`), and the opening of a handle taken away (`mask_regions`).
"""

from dataclasses import replace

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.grid_cut import Links, grid_cut, links
from glint.tasks.algorithms.masks.contour_edges import edge_image, stronger_pieces, without_blur
from glint.tasks.algorithms.masks.mask_regions import (
    CLOSE_SHARE,
    closed,
    filled,
    handle_openings,
    large_components,
    thick_components,
)
from glint.tasks.algorithms.masks.round_foot import round_foot
from glint.tasks.algorithms.masks.symmetric_walls import evident_axis, with_symmetric_walls
from glint.tasks.algorithms.masks.table_separation import Separation
from glint.tasks.algorithms.table.table_response import TableResponse
from glint.tasks.algorithms.table.table_texture import texture_ratio

CLOSED_CONTOUR_SHARE = 0.02
"""Gaps of the contour that the second cut takes as closed, as a share of the square root of the object's area."""
MAX_OUTWARD_SHARE, MAX_INWARD_SHARE = 0.06, 0.03
"""Farthest that the second cut moves the contour, likewise."""
OUTWARD_BONUS = 0.2
"""Nats by which a pixel is preferred inside where a contour farther out is looked for."""
MAX_WALL_SHARE, WALL_ROUNDS = 0.18, 2
"""Farthest that the outer face of a wall is looked for, as such a share, and the times it is."""
RESPONSE_WEIGHT, TEXTURE_WEIGHT = 0.03, 0.2
"""Weights of the log-likelihood ratios of response and texture in the second cut: near the contour edges decide."""
MIN_FOOT_DEPTH_PX = 1.5
"""Depth of a part of a foot from which the cut may not leave it out."""
OUTWARD_ROUNDS = 2
"""Times that a contour farther out is looked for."""


def refined_mask(parts: Separation, response: TableResponse, free: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Return the mask (H, W) bool of a separation, its contour moved to the edges nearby.

    response: that was separated. free, allowed: (H, W) bool, pixels beside the spheres, and those of them that may be
    the object.
    """
    mask = _with_foot(_with_contour(parts, response, free, allowed), parts, response, free, allowed)
    axis = evident_axis(mask, wall_images(parts, response.background))
    return mask if axis is None else mask & ~handle_openings(mask, parts.ratios < 0.0, axis)


def _with_contour(parts: Separation, response: TableResponse, free: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Return the mask (H, W) bool with its contour at the edges nearby, without blur; see `refined_mask`."""
    mask = _at_edges(parts, response.background, allowed)
    return without_blur(mask, np.exp(response.deviation), free)


def _with_foot(
    mask: np.ndarray, parts: Separation, response: TableResponse, free: np.ndarray, allowed: np.ndarray
) -> np.ndarray:
    """Return the mask (H, W) bool with the round foot of a vessel, its contour at the edges; see `refined_mask`."""
    foot = allowed & round_foot(mask, response.background, parts.features[..., 1], parts.is_table)
    if not thick_components(foot & ~mask, MIN_FOOT_DEPTH_PX).any():
        return mask
    parts = replace(
        parts,
        differing=parts.differing | foot,
        filled=parts.filled | foot,
        is_table=parts.is_table & ~foot,
    )
    mask = _with_contour(parts, response, free, allowed)
    # A far rim may be too weak for the cut. Whether a rim is a pixel wider or narrower is left to it.
    return mask | thick_components(foot & ~mask, MIN_FOOT_DEPTH_PX)


def _at_edges(parts: Separation, background: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Return the mask (H, W) bool with its contour moved to the edges nearby; see `refined_mask`."""
    root_area = float(np.sqrt(parts.differing.sum()))
    lines, *responses = wall_images(parts, background)
    brightness = edge_image(background, parts.is_table)
    edges, walls = (links([image, *responses], 1.0) for image in (brightness, lines))
    texture = texture_ratio(background, parts.is_table, root_area)

    def cut(inside: np.ndarray, start: np.ndarray, max_share: float, capacities: Links, bonus: float) -> np.ndarray:
        """Return the object, which holds `inside` and reaches at most `max_share` root areas beyond `start`."""
        distance = ndimage.distance_transform_edt(~start)
        outside = (distance > max(2, round(max_share * root_area))) | ~allowed
        ratios = RESPONSE_WEIGHT * parts.ratios + TEXTURE_WEIGHT * texture + bonus
        return large_components(grid_cut(ratios, capacities, inside, outside) & allowed)

    inside, start = _certain(parts, root_area), parts.filled
    mask = cut(inside, start, MAX_OUTWARD_SHARE, edges, 0.0)
    # Where an edge farther out is stronger than the one found, the contour moves out to it.
    for _ in range(OUTWARD_ROUNDS):
        outer = cut(inside, start, MAX_OUTWARD_SHARE, edges, OUTWARD_BONUS)
        mask = mask | stronger_pieces(mask, outer, brightness)
        inside, start = inside | mask, mask
    # A clear line still farther out is the outer face of a wall.
    for _ in range(WALL_ROUNDS):
        outer = mask | cut(mask, mask, MAX_WALL_SHARE, walls, OUTWARD_BONUS)
        mask = mask | stronger_pieces(mask, outer, lines, texture)
    difference = np.maximum(RESPONSE_WEIGHT * parts.difference + TEXTURE_WEIGHT * texture, 0.0)
    return with_symmetric_walls(mask, [lines, *responses], difference, parts.is_table, allowed)


def _certain(parts: Separation, root_area: float) -> np.ndarray:
    """Return the pixels (H, W) bool that are of the object wherever its contour lies.

    root_area: square root of the object's area, pixels.
    """
    # Closing fills concavities of the silhouette as well as gaps of its contour: what it alone adds is not certain.
    holes = parts.filled & ~closed(parts.differing, CLOSE_SHARE * root_area)
    solid = filled(closed(parts.differing | holes, CLOSED_CONTOUR_SHARE * root_area), 0.0) | parts.bridged
    return np.asarray(ndimage.distance_transform_edt(solid) > max(2, round(MAX_INWARD_SHARE * root_area)))


def wall_images(parts: Separation, background: np.ndarray) -> list[np.ndarray]:
    """Return the images (H, W) whose edges show walls: the sharp one of the background, and both responses."""
    return [edge_image(background, parts.is_table, is_sharp=True), *parts.responses]
