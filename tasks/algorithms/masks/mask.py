"""Object mask of a bare video: where pixels do not follow the light as the table does.

Yeung et al. 2009 take the silhouette as given (section 4.1). Here a first cut separates the pixels whose response to
the light differs from that of the table around them (`table_response`); holes and gaps that are glass are filled
(`mask_regions`); and a second cut moves the contour to the edges of the background and of the response nearby. Walls
of glasses refract the table without any highlight: the contour moves out to an edge of the background that is stronger
than the one that it leaves, then farther to a clear line of it, as the outer face of a thin wall is; and in from the
blur of highlights at the rim. A round foot is added, of which only the rim differs from the table (`round_foot`), and
the opening of a handle taken away (`handle_openings`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.convex_hull import convex_hull
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.masks.contour_edges import edge_image, stronger_pieces, without_blur
from glint.tasks.algorithms.masks.grid_cut import Links, grid_cut, links
from glint.tasks.algorithms.masks.handle_openings import handle_openings
from glint.tasks.algorithms.masks.mask_regions import (
    CLOSE_SHARE,
    bridged,
    closed,
    filled,
    large_components,
    main_components,
    thick_components,
    without_specks,
)
from glint.tasks.algorithms.masks.round_foot import round_foot
from glint.tasks.algorithms.masks.symmetric_walls import with_symmetric_walls
from glint.tasks.algorithms.masks.table_model import TableModel, fit_table
from glint.tasks.algorithms.masks.table_response import TableResponse, table_response

EXCLUDED_RADII = 1.3
"""Radii around a sphere's centre that are excluded: beside the sphere lie its caustics."""
MASK_REMEDY = "paint a mask (white object on black) and name it as `mask: mask.png`, or give the object's `region`"
ROUNDS = 3
"""Times that object and table around it are separated."""
DISTANCE_THRESHOLD, STRONG_DISTANCE = 9.0, 16.0
"""Squared Mahalanobis distance from the table at which object and table are equally likely, and from which a pixel
differs whatever its neighbours do: lines of highlights are a pixel wide."""
MAX_RATIO = 5.0
"""Bound of the log-likelihood ratio of a pixel, nats: a surprise is no proof."""
FEATURE_LIMITS = -4.0, 6.0
"""Bounds of the two features, standard deviations of the table: beyond them a pixel differs from it in any case."""
FEATURE_SIGMA_PX = 0.6
"""Standard deviation of the smoothing before edges of the features are taken."""
CUT_STRENGTH, CUT_CONTRAST = 3.0, 0.5
"""Cost of the first cut per pixel of contour, nats, and the difference of log response that counts as an edge."""
CLOSED_CONTOUR_SHARE = 0.02
"""Gaps of the contour that the second cut takes as closed, as a share of the edge of a square of the object's area."""
MAX_OUTWARD_SHARE, MAX_INWARD_SHARE = 0.06, 0.03
"""Farthest that the second cut moves the contour, likewise."""
OUTWARD_BONUS = 0.2
"""Nats by which a pixel is preferred inside where a contour farther out is looked for."""
EDGE_FLOOR = 0.03
"""Cost of the second cut across the strongest edge, relative to that without an edge."""
MAX_WALL_SHARE, WALL_ROUNDS = 0.18, 2
"""Farthest that the outer face of a wall is looked for, as a share of that edge, and the times it is."""
RESPONSE_EDGE = 0.24
"""Difference of the saturated response that counts as an edge."""
RESPONSE_WEIGHT = 0.03
"""Weight of the log-likelihood ratios in the second cut: near the contour edges decide."""
MIN_FOOT_DEPTH_PX = 1.5
"""Depth of a part of a foot from which the cut may not leave it out."""
OUTWARD_ROUNDS = 2
"""Times that a contour farther out is looked for."""
MIN_HIGHLIGHT_PX = 12
"""Pixels with highlights without which there is no object."""
MAX_HIGHLIGHT_SHARE = 0.9
"""Share of the picture beyond which highlights are no highlights."""
MIN_GAP_PX, MIN_GAP_SHARE, MAX_GAP_PX, MAX_GAP_SHARE = 3.0, 0.02, 20.0, 0.4
"""Distances from the object between which the table is sampled, in pixels and as a share of the edge of a square of the
object's area, whichever is more: beyond the blur of the contour, and where the light is still the same."""
MIN_TABLE_PX = 50
"""Pixels around the object without which the frame's border is the table."""


@dataclass(frozen=True, slots=True)
class _Classes:
    """Object and table as the responses separate them.

    differing: (H, W) bool, pixels that differ from the table. filled: with gaps and holes that are glass. bridged: what
    a contour with gaps encloses. features: (H, W, 2), log responses. ratios: (H, W), log-likelihood ratios, nats.
    is_table: (H, W) bool, pixels of the table around the object. table: its model.
    """

    differing: np.ndarray
    filled: np.ndarray
    bridged: np.ndarray
    features: np.ndarray
    ratios: np.ndarray
    is_table: np.ndarray
    table: TableModel


def estimate_mask(
    frames: np.ndarray, *, spheres: Sequence[Sphere] = (), within: np.ndarray | None = None
) -> np.ndarray:
    """Estimate the mask (H, W) bool of the object from a sample of the frames.

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
    classes = _separate(response, free, allowed)
    mask = _with_foot(_with_contour(classes, response, free, allowed), classes, response, free, allowed)
    return mask & ~handle_openings(mask, classes.ratios < 0.0)


def beside_spheres(shape: tuple[int, ...], spheres: Sequence[Sphere]) -> np.ndarray:
    """Return the pixels (H, W) bool that lie beside the spheres."""
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    free = np.ones(shape, bool)
    for sphere in spheres:
        free &= np.hypot(columns - sphere.x, rows - sphere.y) > EXCLUDED_RADII * sphere.radius
    return free


def _separate(response: TableResponse, free: np.ndarray, allowed: np.ndarray) -> _Classes:
    """Separate object and table, beginning with the frame's border as the table.

    free, allowed: (H, W) bool, pixels beside the spheres, and those of them that may be the object.
    """
    features = np.clip(np.stack([response.deviation, response.flash], axis=-1), *FEATURE_LIMITS).astype(np.float32)
    images = [
        cv2.GaussianBlur(channel, (0, 0), FEATURE_SIGMA_PX) / CUT_CONTRAST for channel in np.moveaxis(features, -1, 0)
    ]
    capacities = links(images, CUT_STRENGTH, EDGE_FLOOR, gaussian=True)
    is_table, edge = response.border, None
    for _ in range(ROUNDS):
        table = fit_table(features, is_table, edge)
        highlights = table.flashing(features)
        flashing = highlights & allowed
        _check_highlights(flashing, allowed)
        distance = table.distance(features)
        ratios = np.clip((distance - DISTANCE_THRESHOLD) / 2.0, -MAX_RATIO, MAX_RATIO)
        if edge is None:
            # Shadows differ from the table far away as well: at first highlights alone are the object.
            differing = main_components(flashing, flashing, response.moment)
        else:
            differing = grid_cut(ratios, capacities, np.zeros_like(free), ~allowed) & allowed
            strong = without_specks((distance > STRONG_DISTANCE) & allowed)
            differing = main_components(differing | strong, flashing, response.moment)
        mask = filled(differing, CLOSE_SHARE)
        enclosed = bridged(differing, mask)
        # Parts of the object without highlights lie between those with them, not in the table's sample.
        covered = mask | enclosed if edge is not None else convex_hull(mask)
        edge = float(np.sqrt(max(int(differing.sum()), 1)))
        gap = ndimage.distance_transform_edt(~covered)
        is_table = (gap > max(MIN_GAP_PX, MIN_GAP_SHARE * edge)) & (gap < max(MAX_GAP_PX, MAX_GAP_SHARE * edge)) & free
        is_table &= ~ndimage.binary_dilation(highlights, np.ones((3, 3)))
        if is_table.sum() < MIN_TABLE_PX:
            is_table = response.border
    return _Classes(differing, mask | enclosed, enclosed, features, ratios, is_table, table)


def _check_highlights(flashing: np.ndarray, free: np.ndarray) -> None:
    """Refuse a picture without highlights, or one full of them.

    Raises:
        UnusableCapture: as `estimate_mask`.
    """
    height, width = flashing.shape
    count = int(flashing.sum())
    if count < MIN_HIGHLIGHT_PX:
        raise UnusableCapture(f"no highlight in {width} x {height} pixels ({count} pixels flash)", MASK_REMEDY)
    if count > MAX_HIGHLIGHT_SHARE * free.sum():
        raise UnusableCapture(f"{count / free.sum():.0%} of {width} x {height} pixels show a highlight", MASK_REMEDY)


def _with_contour(classes: _Classes, response: TableResponse, free: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Return the mask (H, W) bool with its contour at the edges nearby, without blur; see `_separate`."""
    mask = _at_edges(classes, response.background, allowed)
    return without_blur(mask, np.exp(response.deviation), free)


def _with_foot(
    mask: np.ndarray, classes: _Classes, response: TableResponse, free: np.ndarray, allowed: np.ndarray
) -> np.ndarray:
    """Return the mask (H, W) bool with the round foot of a vessel, its contour at the edges nearby; see `_separate`."""
    foot = allowed & round_foot(mask, response.background, classes.features[..., 1], classes.is_table)
    if not thick_components(foot & ~mask, MIN_FOOT_DEPTH_PX).any():
        return mask
    classes = replace(
        classes,
        differing=classes.differing | foot,
        filled=classes.filled | foot,
        is_table=classes.is_table & ~foot,
    )
    mask = _with_contour(classes, response, free, allowed)
    # A far rim may be too weak for the cut. Whether a rim is a pixel wider or narrower is left to it.
    return mask | thick_components(foot & ~mask, MIN_FOOT_DEPTH_PX)


def _at_edges(classes: _Classes, background: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return the mask (H, W) bool with its contour moved to the edges nearby."""
    edge = float(np.sqrt(classes.differing.sum()))
    # Closing fills concavities of the silhouette as well as gaps of its contour: what it alone adds is not certain.
    holes = classes.filled & ~closed(classes.differing, CLOSE_SHARE * edge)
    certain = filled(closed(classes.differing | holes, CLOSED_CONTOUR_SHARE * edge), 0.0) | classes.bridged
    inside = ndimage.distance_transform_edt(certain) > max(2, round(MAX_INWARD_SHARE * edge))
    responses, brightness = _saturated_responses(classes), edge_image(background, classes.is_table)
    lines = edge_image(background, classes.is_table, is_sharp=True)
    edges = links([brightness, *responses], 1.0, EDGE_FLOOR)
    walls = links([lines, *responses], 1.0, EDGE_FLOOR)

    def cut(inside: np.ndarray, reach: np.ndarray, share: float, bonus: float, capacities: Links) -> np.ndarray:
        outside = (ndimage.distance_transform_edt(~reach) > max(2, round(share * edge))) | ~free
        return large_components(grid_cut(RESPONSE_WEIGHT * classes.ratios + bonus, capacities, inside, outside) & free)

    reach = classes.filled
    mask = cut(inside, reach, MAX_OUTWARD_SHARE, 0.0, edges)
    for _ in range(OUTWARD_ROUNDS):
        outer = cut(inside, reach, MAX_OUTWARD_SHARE, OUTWARD_BONUS, edges)
        mask = mask | stronger_pieces(mask, outer, brightness)
        inside, reach = inside | mask, mask
    for _ in range(WALL_ROUNDS):
        outer = mask | cut(mask, mask, MAX_WALL_SHARE, OUTWARD_BONUS, walls)
        mask = mask | stronger_pieces(mask, outer, lines, is_wall=True)
    # Clear glass is like the table: only what differs from it says where the object is.
    difference = RESPONSE_WEIGHT * (classes.ratios + DISTANCE_THRESHOLD / 2.0)
    return with_symmetric_walls(mask, [lines, *responses], difference, classes.is_table, free, EDGE_FLOOR)


def _saturated_responses(classes: _Classes) -> list[np.ndarray]:
    """Return both responses (H, W) on a scale on which their edge lies halfway between the object's and the table's."""
    images = []
    for channel in range(2):
        excess = classes.features[..., channel] - classes.table.mean[..., channel]
        reference = max(float(np.exp(np.median(excess[classes.differing]))) - 1.0, 1.0)
        ratio = np.exp(excess.clip(-1.0, 5.0)) - 1.0
        images.append(ratio / (np.abs(ratio) + reference) / RESPONSE_EDGE)
    return images
