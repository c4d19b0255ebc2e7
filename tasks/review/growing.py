"""A mask grown from a pixel that a person clicked: what is connected with it and looks alike, near the object."""

import cv2
import numpy as np

from glint.storage.errors import InputError
from glint.storage.export.image_files import encode_png
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.review.pictures import frame_image, level_image

NEIGHBOURHOOD = 0.5
"""Share of the mask's longer side by which what is grown may lie outside of the mask's bounding box: an estimate that
misses more than that is better painted again."""
MEDIAN_SIDE_PX = 3
"""Side in pixels of the median filter before growing, and of the closing after it: noise of a pixel is no edge."""


def grow(context: CaptureContext, picture: str, x: int, y: int, tolerance: int, mask: np.ndarray) -> bytes:
    """Return what grows from the pixel (x, y) of the full frame as PNG of the full frame, white on black.

    picture: a frame's number or a level's name (`pictures.LEVELS`), on which a person looks; tolerance: by how many
    levels of 255 a pixel may differ from the one that was clicked; mask: (H, W) bool, the one in use, around which the
    growth stays; empty: anywhere.

    Raises:
        InputError: there is no such picture, or the pixel lies too far from the mask.
        StoreError: the store cannot be read.
    """
    image = frame_image(context, int(picture)) if picture.isdecimal() else level_image(context, picture)
    if not (0 <= x < image.shape[1] and 0 <= y < image.shape[0]):
        raise InputError(f"the pixel {x}, {y} lies outside the frame", f"it is {image.shape[1]} x {image.shape[0]}")
    rows, columns = _neighbourhood(mask)
    if not (rows.start <= y < rows.stop and columns.start <= x < columns.stop):
        raise InputError(f"the pixel {x}, {y} lies far from the mask", "paint there with brush or polygon")
    return encode_png(grown_region(image, x, y, tolerance, rows, columns))


def grown_region(image: np.ndarray, x: int, y: int, tolerance: int, rows: slice, columns: slice) -> np.ndarray:
    """Return the pixels (H, W) bool connected with (x, y) whose level in `image`, (H, W) uint8, is within `tolerance`.

    rows, columns: the part of the image outside of which nothing grows.
    """
    part = cv2.medianBlur(np.ascontiguousarray(image[rows, columns]), MEDIAN_SIDE_PX)
    # floodFill wants a rim of one pixel around its mask, and writes there the value in the flags' second byte.
    reached = np.zeros((part.shape[0] + 2, part.shape[1] + 2), np.uint8)
    flags = 4 | cv2.FLOODFILL_FIXED_RANGE | cv2.FLOODFILL_MASK_ONLY | (255 << 8)
    cv2.floodFill(part, reached, (x - columns.start, y - rows.start), 0, tolerance, tolerance, flags)
    kernel = np.ones((MEDIAN_SIDE_PX, MEDIAN_SIDE_PX), np.uint8)
    closed = cv2.morphologyEx(reached[1:-1, 1:-1], cv2.MORPH_CLOSE, kernel)
    whole = np.zeros(image.shape, bool)
    whole[rows, columns] = closed > 0
    return whole


def _neighbourhood(mask: np.ndarray) -> tuple[slice, slice]:
    """Return the rows and columns near a mask (H, W) bool, all where it is empty."""
    height, width = mask.shape
    if not mask.any():
        return slice(0, height), slice(0, width)
    x, y, w, h = cv2.boundingRect(mask.astype(np.uint8))
    margin = round(NEIGHBOURHOOD * max(w, h))
    return (
        slice(max(0, y - margin), min(height, y + h + margin)),
        slice(max(0, x - margin), min(width, x + w + margin)),
    )
