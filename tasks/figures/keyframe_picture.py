"""Draw a keyframe enlarged, with a grid in which a user reads the positions of highlights."""

import cv2
import numpy as np

from glint.storage.footage.luma import eight_bits

GRID_PX, LABELLED_GRID_PX = 10, 50
"""Pixels between the lines of the grid, and between those that are numbered."""
TITLE_PX, LABEL_PX = 26, 46
"""Height of the title's line and width of the margins that hold the numbers."""
GRID_COLOUR, TEXT_COLOUR = (255, 190, 60), (20, 20, 20)


def draw_keyframe(frame: np.ndarray, number: int, left: int, top: int, width: int = 1400) -> np.ndarray:
    """Return a picture (h, w, 3) uint8 RGB of a region's frame, with a grid that counts the full frame's pixels.

    A pixel's number is that of its centre, as the markup file expects it.

    Args:
        frame: the region's luma (H, W) uint8 or uint16.
        number: of the frame, for the title.
        left: column of the region's first pixel in the full frame.
        top: row of the region's first pixel in the full frame.
        width: approximate width in pixels of the enlarged region.
    """
    zoom = max(2, round(width / frame.shape[1]))
    enlarged = cv2.resize(eight_bits(frame), None, fx=zoom, fy=zoom, interpolation=cv2.INTER_NEAREST)
    picture = cv2.cvtColor(enlarged, cv2.COLOR_GRAY2RGB)
    _draw_grid(picture, frame.shape, left, top, zoom)
    # The picture's first row lies below the title's line and the numbers of the columns.
    first_row = TITLE_PX + LABEL_PX - 20
    canvas = np.full((picture.shape[0] + LABEL_PX + TITLE_PX, picture.shape[1] + LABEL_PX, 3), 255, np.uint8)
    canvas[first_row : first_row + picture.shape[0], LABEL_PX:] = picture
    for column in range(left - left % -LABELLED_GRID_PX, left + frame.shape[1], LABELLED_GRID_PX):
        _write(canvas, str(column), LABEL_PX + (column - left) * zoom, 44)
    for row in range(top - top % -LABELLED_GRID_PX, top + frame.shape[0], LABELLED_GRID_PX):
        _write(canvas, str(row), 4, first_row + (row - top) * zoom + zoom // 2 + 5)
    _write(canvas, f"frame {number}: x to the right, y down, pixels of the full frame", LABEL_PX, 18)
    return canvas


def _draw_grid(picture: np.ndarray, shape: tuple[int, ...], left: int, top: int, zoom: int) -> None:
    """Blend the lines of the grid into the enlarged picture of a region (H, W), in place."""
    for axis, start in ((1, left), (0, top)):
        for position in range(start - start % -GRID_PX, start + shape[axis], GRID_PX):
            pixel = (position - start) * zoom + zoom // 2
            line = np.s_[:, pixel] if axis == 1 else np.s_[pixel, :]
            opacity = 0.45 if position % LABELLED_GRID_PX == 0 else 0.18
            picture[line] = (picture[line] * (1 - opacity) + np.array(GRID_COLOUR) * opacity).astype(np.uint8)


def _write(picture: np.ndarray, text: str, x: int, y: int) -> None:
    cv2.putText(picture, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.5, TEXT_COLOUR, 1, cv2.LINE_AA)
