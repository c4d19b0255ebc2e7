"""Clear walls that a mask lacks: a vessel is symmetric about its axis, and so are its edges.

A clear wall is a faint line on the table, which the table's texture hides in places, seldom on both sides at once. The
axis is that about which the edges of background and response are most like their mirror images. A cut in the picture
folded along it finds the symmetric body: its contour is cheap where both sides have an edge, and what is inside differs
from the table on both. What this body, or the mirror image of the mask, has beside the mask belongs to the object if
edges along its contour say so: opposite a handle there are none. Pieces that cross the axis are left out: a line across
it, as on the table, is symmetric in any case.
"""

from collections.abc import Sequence
from operator import itemgetter

import cv2
import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.grid_cut import Links, grid_cut, links
from glint.tasks.algorithms.masks.contour_edges import pieces_beside, slope_across
from glint.tasks.algorithms.masks.mask_regions import thick_components
from glint.tasks.algorithms.silhouettes.mirror_images import MirrorAxis, mirror_axes, mirror_image
from glint.tasks.algorithms.silhouettes.reflection_axes import MAX_SCORED_PIXELS, refined_place

AXIS_REACH_SHARE, AXIS_SIGMA_PX = 0.15, 1.0
"""Distance from the mask up to which edges tell the axis, as a share of the square root of its area, and the standard
deviation of their smoothing."""
AXIS_STEPS, LAST_MIRROR_STEP_DEG = (float(np.radians(1.0)), 1.0), 0.05
"""First steps of the axis' angle and offset, radians and pixels, and the step of the angle at which its search ends."""
WALL_REACH_SHARE, INWARD_SHARE = 0.18, 0.03
"""Farthest that the cut moves the contour of mask and mirror image together outward, and that of their overlap inward,
as shares of the square root of the mask's area."""
MIN_SHIFT_PX = 2
"""Distance that it may be moved in any case."""
MIN_WALL_EXCESS, MIN_WALL_EXCESS_RATIO = 0.12, 0.4
"""Mean evidence of an edge, 0 to 1, along the contour of a piece that is added, in excess of that on the table, and
relative to that along the contour that it replaces."""
MIN_DEPTH_PX = 1.5
"""Depth of the smallest piece: thinner ones are blur."""


def with_symmetric_walls(
    mask: np.ndarray,
    images: Sequence[np.ndarray],
    difference: np.ndarray,
    is_table: np.ndarray,
    allowed: np.ndarray,
) -> np.ndarray:
    """Return a mask (H, W) bool with the walls that it lacks.

    Args:
        mask: (H, W) bool.
        images: (H, W) each; a difference of 1 between neighbours is an edge.
        difference: (H, W), by how much pixels differ from the table, nats, small where they are like it.
        is_table: (H, W) bool, pixels of the table.
        allowed: (H, W) bool, where the object may be.
    """
    axis = evident_axis(mask, images)
    if axis is None:
        return mask
    down, right = _slopes(images)
    on_table = float(np.mean([_evidence(slopes)[is_table] for slopes in (down, right)])) if is_table.any() else 0.0
    body = _symmetric_body(mask, axis, images, difference, allowed)
    for larger in (body, mirror_image(mask, axis)):
        mask = _with_evident_pieces(mask, larger & allowed, axis, images, on_table)
    return mask


def evident_axis(mask: np.ndarray, images: Sequence[np.ndarray]) -> MirrorAxis | None:
    """Return the axis about which edges in and beside a mask (H, W) bool are most like their mirror images.

    images: as for `with_symmetric_walls`. None: no part of the mask's contour is the mirror image of another.
    """
    edges = _evidence(np.concatenate(_slopes(images)))
    near = ndimage.distance_transform_edt(~mask) <= AXIS_REACH_SHARE * np.sqrt(mask.sum())
    smooth = cv2.GaussianBlur(edges.astype(np.float32), (0, 0), AXIS_SIGMA_PX)
    smooth -= smooth[near].mean() if near.any() else 0.0
    points = np.argwhere(near)[:, ::-1]
    points = points[:: max(1, len(points) // MAX_SCORED_PIXELS)].astype(float)
    scored = [_nearby_axis(smooth, points, axis) for axis in mirror_axes(mask)]
    return max(scored, key=itemgetter(1))[0] if scored else None


def _slopes(images: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the slopes (N, H, W) of images (H, W) down and to the right."""
    down, right = zip(*(np.gradient(image) for image in images), strict=True)
    return np.stack(down), np.stack(right)


def _nearby_axis(edges: np.ndarray, points: np.ndarray, axis: MirrorAxis) -> tuple[MirrorAxis, float]:
    """Return the axis near another about which edges (H, W) are most like their mirror images, and how like they are.

    Likeness is the sum of their products at points (N, 2), column and row, relative to that of the edges' squares.
    """
    values = edges[points[:, 1].astype(int), points[:, 0].astype(int)]
    total = float(values @ values) + 1e-9

    def likeness(angle: float, offset: float) -> float:
        column, row = MirrorAxis(axis.centre, angle, offset).mirrored(points).astype(np.float32).T[:, :, None]
        opposite = cv2.remap(edges, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        return float(opposite[:, 0] @ values) / total

    place, _ = refined_place(likeness, (axis.angle, axis.offset), AXIS_STEPS, float(np.radians(LAST_MIRROR_STEP_DEG)))
    return MirrorAxis(axis.centre, *place), likeness(*place)


def _symmetric_body(
    mask: np.ndarray,
    axis: MirrorAxis,
    images: Sequence[np.ndarray],
    difference: np.ndarray,
    allowed: np.ndarray,
) -> np.ndarray:
    """Return the body (H, W) bool, symmetric about an axis, of minimum energy; see `with_symmetric_walls`."""
    root_area = float(np.sqrt(mask.sum()))
    upright, size = _upright(mask, axis, WALL_REACH_SHARE * root_area + 2 * MIN_SHIFT_PX)

    def turned(image: np.ndarray, border: int = cv2.BORDER_CONSTANT) -> np.ndarray:
        return np.asarray(cv2.warpAffine(image.astype(np.float32), upright, size, borderMode=border))

    capacities = _folded(links([turned(image, cv2.BORDER_REPLICATE) for image in images], 1.0))
    difference, mask_there, allowed_there = turned(difference), turned(mask) > 0.5, turned(allowed) > 0.5
    difference = np.minimum(difference, difference[:, ::-1])
    possible = allowed_there & allowed_there[:, ::-1]
    shared, reach = mask_there & mask_there[:, ::-1], mask_there | mask_there[:, ::-1]
    inside = ndimage.distance_transform_edt(shared) > max(MIN_SHIFT_PX, round(INWARD_SHARE * root_area))
    outside = ndimage.distance_transform_edt(~reach) > max(MIN_SHIFT_PX, round(WALL_REACH_SHARE * root_area))
    # Both sides are one: the cut is that of one side, of which the pixels on the axis count half.
    half = slice(size[0] // 2, None)
    sides = {neighbour: capacity[:, half].copy() for neighbour, capacity in capacities.items()}
    sides[1, 0][:, 0] *= 0.5
    difference = difference[:, half].copy()
    difference[:, 0] *= 0.5
    side = grid_cut(difference, sides, inside[:, half], (outside | ~possible)[:, half])
    body = np.hstack([side[:, :0:-1], side]).astype(np.float32)
    turned_back = cv2.warpAffine(body, upright, mask.shape[::-1], flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    return np.asarray(turned_back > 0.5)


def _upright(mask: np.ndarray, axis: MirrorAxis, margin: float) -> tuple[np.ndarray, tuple[int, int]]:
    """Return the motion (2, 3) to a picture whose middle column is the axis, and its size (width, height).

    It holds the mask (H, W) bool, its mirror image and a margin in pixels around both.
    """
    normal = axis.normal
    direction = np.array([-normal[1], normal[0]])
    places = np.argwhere(mask)[:, ::-1] - axis.centre
    across, along = places @ normal - axis.offset, places @ direction
    half, first = int(np.ceil(np.abs(across).max() + margin)), along.min() - margin
    motion = np.array(
        [
            [*normal, half - axis.offset - axis.centre @ normal],
            [*direction, -first - axis.centre @ direction],
        ]
    )
    return motion, (2 * half + 1, int(np.ceil(along.max() + margin - first)) + 1)


def _folded(capacities: Links) -> Links:
    """Return the means of the links' capacities and of their mirror images about the middle column."""
    folded = {}
    for (down, right), capacity in capacities.items():
        # The mirror image of a link to the right begins where that link ends.
        image = capacities[down, -right][:, ::-1] if down else np.roll(capacity[:, ::-1], -right, axis=1)
        folded[down, right] = 0.5 * (capacity + image)
    return folded


def _with_evident_pieces(
    mask: np.ndarray, larger: np.ndarray, axis: MirrorAxis, images: Sequence[np.ndarray], on_table: float
) -> np.ndarray:
    """Return a mask (H, W) bool with those pieces of a larger one beside an axis along whose contour images have edges.

    on_table: mean evidence of an edge on the table.
    """
    whole = mask | larger
    outer_excess, inner_excess = (
        _evidence(np.stack([slope_across(image, area) for image in images])) - on_table for area in (whole, mask)
    )
    result = mask.copy()
    for grown, piece, new, old in pieces_beside(mask, whole, thick_components(whole & ~mask, MIN_DEPTH_PX)):
        if _crosses(axis, piece, grown):
            continue
        # A wall is as long as the contour that it replaces, a line that touches the contour longer.
        shortness = min(1.0, float(old.sum() / new.sum()))
        excess, replaced = shortness * float(outer_excess[grown][new].mean()), float(inner_excess[grown][old].mean())
        if excess >= max(MIN_WALL_EXCESS, MIN_WALL_EXCESS_RATIO * replaced):
            result[grown] |= piece
    return result


def _crosses(axis: MirrorAxis, piece: np.ndarray, window: tuple[slice, ...]) -> bool:
    """Return whether a piece (h, w) bool in a window of the image has pixels on both sides of an axis."""
    places = np.argwhere(piece) + [side.start for side in window]
    across = (places[:, ::-1] - axis.centre) @ axis.normal - axis.offset
    return bool(across.min() < -1.0 and across.max() > 1.0)


def _evidence(slopes: np.ndarray) -> np.ndarray:
    """Return the evidence (H, W) of an edge, 0 to 1, of slopes (N, H, W): by how much less a link across it costs."""
    return np.asarray(1.0 - 1.0 / (1.0 + np.square(slopes).sum(axis=0)))
