"""Frames in which an arm covers a sphere, or the light itself stands before the object.

An arm before a sphere hides its static reflections (windows), and may cut the light's highlight, whose centre is then
wrong. A light before the object lights pixels that it covers; it reaches beyond the object, onto the border of the
object's region, where nothing else clips, or is a round saturated disc larger than highlights are.
"""

from typing import Any

import cv2
import numpy as np

from glint.tasks.algorithms.lighting.spheres import Sphere

REFLECTING_RATIO = 0.95
"""Radius, as a share of the sphere's, up to which static reflections are looked for: its contour is no reflection."""
MIN_REFLECTION_RATIO = 2.0
"""Level of a static reflection relative to the sphere's median level from which it is a window."""
MIN_REFLECTION_LEVEL_SHARE = 0.15
"""Level of a static reflection as a share of saturation, so that its absence is no noise."""
MIN_REFLECTION_PIXELS = 8
"""Pixels of static reflections below which their absence shows nothing."""
MAX_HIDDEN_LEVEL = 0.6
"""Level relative to the static one below which a reflection's pixel is hidden: exposure drifts by less."""
MAX_HIDDEN_SHARE = 0.5
"""Share of hidden pixels beyond which the sphere is covered."""
BACKGROUND_BORDER_PX = 3
"""Width of the border of the object's region that shows the background."""
CLIPPED_SHARE, MAX_DARK_SHARE = 0.9, 0.5
"""Levels as shares of saturation: from which a pixel shows the light, and below which its background does not."""
MAX_CLIPPED_BORDER_SHARE = 0.05
"""Share of the border that shows the light beyond which it stands before the object."""
MIN_DISC_RATIO, MIN_DISC_ROUNDNESS = 0.15, 0.8
"""Diameter of the light's own disc relative to the region's longer side, and its area relative to that of the smallest
circle around it: round highlights of glass domes have a diameter of 0.05 to 0.13, the flashes of walls and faces are
larger, but not round."""


def is_sphere_covered(frames: np.ndarray, background: np.ndarray, saturation: float, sphere: Sphere) -> np.ndarray:
    """Return whether static reflections of a sphere are hidden (T,) bool; False where it has none.

    Args:
        frames: (T, h, w) uint8 or uint16.
        background: (h, w), see `StaticBackground`.
        saturation: level of clipped pixels, likewise.
        sphere: in the frames' pixels.
    """
    rows, columns = np.indices(background.shape)
    disc = np.hypot(columns - sphere.x, rows - sphere.y) < REFLECTING_RATIO * sphere.radius
    level = max(
        MIN_REFLECTION_RATIO * float(np.median(background[disc])) if disc.any() else np.inf,
        MIN_REFLECTION_LEVEL_SHARE * saturation,
    )
    reflections = disc & (background > level)
    if reflections.sum() < MIN_REFLECTION_PIXELS:
        return np.zeros(len(frames), bool)
    hidden = frames[:, reflections] < MAX_HIDDEN_LEVEL * background[reflections]
    return np.asarray(hidden.mean(axis=1) > MAX_HIDDEN_SHARE)


def clipped_pixels(frame: np.ndarray) -> tuple[int, int]:
    """Count the clipped pixels of a frame (H, W) uint8 or uint16: all, and those of its border."""
    clipped = frame > _clipped_level(frame.dtype)
    inside = clipped[BACKGROUND_BORDER_PX:-BACKGROUND_BORDER_PX, BACKGROUND_BORDER_PX:-BACKGROUND_BORDER_PX]
    count = int(np.count_nonzero(clipped))
    return count, count - int(np.count_nonzero(inside))


def may_show_light(counts: np.ndarray, background: np.ndarray) -> np.ndarray:
    """Return whether `is_light_before_object` can hold of frames (T,) bool, by their `clipped_pixels` (T, 2).

    background: (H, W) of the frames' dtype. Of most captures few frames are left to be looked at.
    """
    border = np.count_nonzero(_dark_border(background, background.dtype))
    return np.asarray(
        (counts[:, 0] >= _least_disc(background.shape)) | (counts[:, 1] > MAX_CLIPPED_BORDER_SHARE * border)
    )


def is_light_before_object(frames: np.ndarray, background: np.ndarray) -> np.ndarray:
    """Return whether the light shows on the border of the object's region, or as a disc inside it (T,) bool.

    frames: (T, H, W) uint8 or uint16 of the region; background (H, W): their temporal median.
    """
    # What is bright all the time, such as a window behind the object, is no light.
    clipped = (frames > _clipped_level(frames.dtype)) & _is_dark(background, frames.dtype)
    border = _dark_border(background, frames.dtype)
    has_disc = np.array([_has_disc(image) for image in clipped], bool)
    return has_disc | (clipped[:, border].mean(axis=1) > MAX_CLIPPED_BORDER_SHARE) if border.any() else has_disc


def _clipped_level(dtype: np.dtype[Any]) -> Any:
    """Return the level, of the frames' dtype: levels are compared as integers."""
    return dtype.type(CLIPPED_SHARE * np.iinfo(dtype).max)


def _is_dark(background: np.ndarray, dtype: np.dtype[Any]) -> np.ndarray:
    return np.asarray(background < MAX_DARK_SHARE * np.iinfo(dtype).max)


def _dark_border(background: np.ndarray, dtype: np.dtype[Any]) -> np.ndarray:
    border = _is_dark(background, dtype)
    border[BACKGROUND_BORDER_PX:-BACKGROUND_BORDER_PX, BACKGROUND_BORDER_PX:-BACKGROUND_BORDER_PX] = False
    return border


def _least_disc(shape: tuple[int, ...]) -> float:
    """Return the pixels of the smallest disc of a light in a region of this shape."""
    return float(np.pi * (0.5 * MIN_DISC_RATIO * max(shape)) ** 2)


def _has_disc(clipped: np.ndarray) -> bool:
    """Return whether the clipped pixels (H, W) bool of a frame hold a large disc."""
    least = _least_disc(clipped.shape)
    if np.count_nonzero(clipped) < least:
        return False
    contours, _ = cv2.findContours(clipped.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    for contour in contours:
        # A contour runs through the centres of the pixels on the edge.
        area = cv2.contourArea(contour) + 0.5 * len(contour)
        _, radius = cv2.minEnclosingCircle(contour)
        if area >= least and area >= MIN_DISC_ROUNDNESS * np.pi * (radius + 0.5) ** 2:
            return True
    return False
