"""Sectors of the light's direction in the image, and which of them reach a pixel of the table past the object.

A shadow lies away from the light: a point of the table is in the shadow of an object, or in the caustics there, only if
the line from its image in the direction of the light crosses the object's image, however high the light is and however
aslant the table.
"""

from collections.abc import Sequence

import cv2
import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.lighting.lights import find_lights
from glint.tasks.algorithms.lighting.spheres import CROP_MARGIN_RATIO, Sphere, crop_around

LIGHT_SECTORS = 12
"""Equal parts of the circle of directions in the image."""
MIN_FRAMES_SHARE = 0.25
"""Least share of the frames that a pixel keeps: where too few lights pass, those before which the least of the object
stands are added."""
FREE_PX = 1.0
"""Pixels of the object on a line up to which it passes the object."""


def sectors_of(frames: np.ndarray, spheres: Sequence[Sphere]) -> np.ndarray:
    """Return the sector (T,) int of the light in frames (T, H, W) uint8, 0 to LIGHT_SECTORS - 1; -1: unknown.

    spheres: chrome spheres in these pixels; the one that shows the light most often counts.
    """
    sectors = np.full(len(frames), -1)
    for sphere in spheres:
        crop, left, top = crop_around(frames, sphere, CROP_MARGIN_RATIO * sphere.radius)
        try:
            lights = find_lights(crop, sphere.in_crop(left, top)).lights
        except UnusableCapture:
            continue
        known = np.isfinite(lights[:, 0])
        if known.sum() > (sectors >= 0).sum():
            turn = np.arctan2(lights[:, 1], lights[:, 0], where=known, out=np.zeros(len(lights))) / (2.0 * np.pi)
            sectors = np.where(known, np.round(turn * LIGHT_SECTORS).astype(int) % LIGHT_SECTORS, -1)
    return sectors


def passing_sectors(mask: np.ndarray, frame_counts: np.ndarray) -> np.ndarray:
    """Return the sectors (LIGHT_SECTORS, H, W) bool whose lights reach each pixel past a mask (H, W) bool.

    Where these have fewer than MIN_FRAMES_SHARE of the frames, the sectors in whose light the least of the mask stands
    are added.

    frame_counts: (LIGHT_SECTORS,) int, number of frames of each sector.
    """
    crossed = np.stack([_crossed(mask, sector) for sector in range(LIGHT_SECTORS)]).round()
    crossed[frame_counts == 0] = np.inf
    order = np.argsort(crossed, axis=0, kind="stable")
    # Frames of the sectors that come before each one in the order.
    kept = np.cumsum(frame_counts[order], axis=0) - frame_counts[order]
    crossed = np.take_along_axis(crossed, order, axis=0)
    is_passing = ((kept < MIN_FRAMES_SHARE * frame_counts.sum()) | (crossed <= FREE_PX)) & np.isfinite(crossed)
    sectors = np.zeros(is_passing.shape, bool)
    np.put_along_axis(sectors, order, is_passing, axis=0)
    return sectors


def _crossed(mask: np.ndarray, sector: int) -> np.ndarray:
    """Return how many pixels of a mask (H, W) bool lie between each pixel and the light of a sector, (H, W) float32."""
    height, width = mask.shape
    side = int(np.ceil(np.hypot(height, width))) + 2
    # In the turned picture the light is on the right.
    turn = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), -360.0 * sector / LIGHT_SECTORS, 1.0)
    turn[:, 2] += (side - width) / 2, (side - height) / 2
    turned = cv2.warpAffine(mask.astype(np.float32), turn, (side, side))
    beyond = np.cumsum(turned[:, ::-1], axis=1)[:, ::-1] - turned
    return cv2.warpAffine(beyond, turn, (width, height), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
