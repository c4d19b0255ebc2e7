"""Edges of an image along a contour: its slope across the contour, in units of the slopes of the table's texture, and
where its level is halfway between both sides'."""

from collections.abc import Iterator

import cv2
import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.table.log_levels import log_levels

BLUR_SIGMA_PX = 0.6
"""Standard deviation of the smoothing before slopes are taken."""
SHARP_SIGMA_PX = 1.5
"""Standard deviation of the smoothing that leaves the smooth part of an image, against which its lines stand out."""
TEXTURE_QUANTILE, MIN_SLOPE = 0.8, 0.01
"""Quantile of the table's slopes that counts as its texture, and the slope added for a table without texture."""
NORMAL_SIGMA_PX = 1.5
"""Standard deviation of the smoothing of a mask from which the contour's normals are taken."""
MIN_OUTER_EDGE, MIN_EDGE_RATIO, MIN_PIECE_PX = 1.0, 1.1, 8
"""Mean edge along a contour, in edges of the table and relative to the one that it replaces; area of a piece."""
CLEAR_OUTER_EDGE, MIN_CLEAR_RATIO = 1.6, 0.7
"""The same two of a contour that is a clear edge by itself, where the one that it replaces may be stronger."""
MIN_WALL_TEXTURE = -0.1
"""Mean evidence of a wall's texture, nats, below which it looks like the bare table."""
MAX_WALL_EDGE = 3.0
"""Edge of a wall beyond which a stronger one counts no more: a black line on the table stands for no other place."""
RIM_DEPTH_PX, TABLE_DISTANCES_PX, PROFILE_STEP_PX = 4.0, (3.0, 6.0), 0.25
"""Distances from a contour up to which the rim inside lies, and between which the table outside, and of samples."""
RIM_SIGMA_PX = 1.0
"""Standard deviation of the smoothing of the distances from the contour, by which it is moved by parts of a pixel."""
MAX_RIM_OFFSET_PX = 1.0
"""Distance outside the contour up to which the rim's highest level is looked for."""
MIN_RIM_RATIO = 3.0
"""Level of the rim, relative to the table's beside it, without which a halfway level says nothing."""
MIN_RIM_SHARE = 2.0 / 3.0
"""Share of the contour that must have a halfway level: elsewhere the rim is too much like the table."""
MAX_BLUR_PX = 1.5
"""Distance inside the contour up to which a halfway level is blur, which is found up to 0.8 pixels inside whatever its
width. Farther in lies the inner face of a clear wall, which no highlight crosses."""


def edge_image(levels: np.ndarray, is_table: np.ndarray, is_sharp: bool = False) -> np.ndarray:
    """Return log levels (H, W), 0 to 255, such that a slope of 1 per pixel is an edge of the table's texture.

    is_table: (H, W) bool, pixels of the table. is_sharp: whether the smooth part of the levels is taken away (a
    difference of Gaussians: Marr and Hildreth 1980), so that lines count and gentle slopes do not.
    """
    brightness = cv2.GaussianBlur(log_levels(levels), (0, 0), BLUR_SIGMA_PX)
    if is_sharp:
        brightness -= cv2.GaussianBlur(brightness, (0, 0), SHARP_SIGMA_PX)
    slopes = np.hypot(*np.gradient(brightness))[is_table]
    texture = float(np.quantile(slopes, TEXTURE_QUANTILE)) if len(slopes) else 0.0
    return np.asarray(brightness / (texture + MIN_SLOPE))


def slope_across(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the absolute slope (H, W) of an image across the contour of a mask (H, W) bool, near that contour."""
    down, right = np.gradient(image)
    normal_down, normal_right = np.gradient(cv2.GaussianBlur(mask.astype(np.float32), (0, 0), NORMAL_SIGMA_PX))
    length = np.hypot(normal_down, normal_right) + 1e-6
    return np.asarray(np.abs(down * normal_down + right * normal_right) / length)


def contour_pixels(mask: np.ndarray) -> np.ndarray:
    """Return the pixels (H, W) bool on both sides of the contour of a mask (H, W) bool."""
    return ndimage.binary_dilation(mask) & ~ndimage.binary_erosion(mask)


def stronger_pieces(
    mask: np.ndarray, outer: np.ndarray, image: np.ndarray, texture: np.ndarray | None = None
) -> np.ndarray:
    """Return the pieces (H, W) bool of `outer` beside `mask` whose outer contour is the stronger edge of an image.

    texture: (H, W), evidence that what is seen is not the bare table, nats, if walls are looked for. A clear edge is
    enough for them, since the inner face of a thin wall may be the stronger one, but they may not look like the table.
    """
    limit = np.inf if texture is None else MAX_WALL_EDGE
    result = np.zeros_like(mask)
    for grown, piece, strength, replaced in edges_of_pieces(mask, outer, image, limit):
        is_kept = strength > MIN_OUTER_EDGE and strength > MIN_EDGE_RATIO * replaced
        if texture is not None:
            is_clear = strength > CLEAR_OUTER_EDGE and strength > MIN_CLEAR_RATIO * replaced
            is_kept = (is_kept or is_clear) and texture[grown][piece].mean() > MIN_WALL_TEXTURE
        if is_kept:
            result[grown] |= piece
    return result


def edges_of_pieces(
    mask: np.ndarray, outer: np.ndarray, image: np.ndarray, limit: float = np.inf
) -> Iterator[tuple[tuple[slice, ...], np.ndarray, float, float]]:
    """Yield the pieces that `outer` adds to a mask, as `pieces_beside` does, with the mean edges along their contours.

    Of each the window, its pixels (h, w) bool there, and the mean slope of an image (H, W) across its new contour and
    across the old one, slopes above the limit counting as that.
    """
    outer_slope, inner_slope = (np.minimum(slope_across(image, area), limit) for area in (outer, mask))
    for grown, piece, new, old in pieces_beside(mask, outer, outer & ~mask):
        yield grown, piece, float(outer_slope[grown][new].mean()), float(inner_slope[grown][old].mean())


def pieces_beside(
    mask: np.ndarray, outer: np.ndarray, added: np.ndarray
) -> Iterator[tuple[tuple[slice, ...], np.ndarray, np.ndarray, np.ndarray]]:
    """Yield the connected pieces of MIN_PIECE_PX and more of what `outer` adds to a mask; all three (H, W) bool.

    Of each the window around it, its pixels (h, w) bool there, and those of its new contour and of the old one.
    """
    outer_contour, inner_contour = contour_pixels(outer) & ~ndimage.binary_dilation(mask), contour_pixels(mask)
    pieces, _ = ndimage.label(added)
    for number, window in enumerate(ndimage.find_objects(pieces), 1):
        grown = tuple(slice(max(0, side.start - 2), side.stop + 2) for side in window)
        piece = pieces[grown] == number
        near = ndimage.binary_dilation(piece)
        new, old = outer_contour[grown] & near, inner_contour[grown] & near
        if piece.sum() >= MIN_PIECE_PX and new.any() and old.any():
            yield grown, piece, new, old


def rim_offset(levels: np.ndarray, distance: np.ndarray, smooth: np.ndarray, used: np.ndarray) -> float | None:
    """Return the distance outward from a contour, pixels, at which levels are halfway from rim to table.

    Optics blur both in the same proportion, so that the true contour lies there if the levels are linear in the light
    and not clipped. It is the median of the shortest half of the distances along the contour (Rousseeuw 1984).

    Args:
        levels: (H, W), higher inside than outside.
        distance: (H, W), of `signed_distance` from the contour.
        smooth: (H, W), the same without the contour's steps, whose slope is the contour's normal.
        used: (H, W) bool, pixels beside which the contour counts.

    Returns:
        The distance, negative inside; None: too little of the contour stands out from the table.
    """
    rows, columns = np.nonzero((distance > -1.0) & (distance < 0.0) & used)
    if not len(rows):
        return None
    down, right = np.gradient(smooth)
    length = np.hypot(down, right)[rows, columns] + 1e-6
    steps = np.arange(-RIM_DEPTH_PX, TABLE_DISTANCES_PX[1] + PROFILE_STEP_PX / 2, PROFILE_STEP_PX)
    along = steps - distance[rows, columns][:, None]
    positions = (
        rows[:, None] + along * (down[rows, columns] / length)[:, None],
        columns[:, None] + along * (right[rows, columns] / length)[:, None],
    )
    profiles = ndimage.map_coordinates(levels, positions, order=1, mode="nearest")
    table = np.median(profiles[:, steps >= TABLE_DISTANCES_PX[0]], axis=1)
    summit = profiles[:, steps <= MAX_RIM_OFFSET_PX].argmax(axis=1)
    highest = profiles[np.arange(len(profiles)), summit]
    # The first sample beyond the rim that lies below halfway, and the last one above it.
    is_low = (profiles < 0.5 * (highest + table)[:, None]) & (np.arange(len(steps)) > summit[:, None])
    after = is_low.argmax(axis=1)
    is_clear = (highest > MIN_RIM_RATIO * table) & is_low.any(axis=1)
    if is_clear.mean() < MIN_RIM_SHARE:
        return None
    clear = np.flatnonzero(is_clear)
    upper, lower = profiles[clear, after[clear] - 1], profiles[clear, after[clear]]
    part = (upper - 0.5 * (highest + table)[clear]) / (upper - lower)
    offsets = np.sort(steps[after[clear] - 1] + PROFILE_STEP_PX * part)
    # A rim whose highest level lies farther in has its own edge there: the most frequent offset is the blur's.
    half = len(offsets) // 2
    shortest = int((offsets[half:] - offsets[: len(offsets) - half]).argmin())
    return float(np.median(offsets[shortest : shortest + half + 1]))


def without_blur(mask: np.ndarray, levels: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Return a mask (H, W) bool without the rim that is blur alone, for levels and pixels as in `rim_offset`.

    Half the level of a clipped highlight lies out in its blur, never inside the object, and so does a contour found
    there. The RMS residual over all frames is hardly clipped.
    """
    distance = signed_distance(mask)
    smooth = cv2.GaussianBlur(distance, (0, 0), RIM_SIGMA_PX)
    offset = rim_offset(levels, distance, smooth, used)
    return mask if offset is None or not -MAX_BLUR_PX <= offset < 0.0 else mask & (smooth <= offset)


def signed_distance(mask: np.ndarray) -> np.ndarray:
    """Return the distance (H, W) float32 of pixels' centres from the contour of a mask (H, W) bool, negative inside."""
    outside, inside = ndimage.distance_transform_edt(~mask), ndimage.distance_transform_edt(mask)
    return np.asarray(np.where(mask, 0.5 - inside, outside - 0.5), np.float32)
