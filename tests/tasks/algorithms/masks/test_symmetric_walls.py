"""Walls that a mask lacks, on pictures whose edges are known."""

import cv2
import numpy as np
import pytest
from scipy import ndimage

from glint.tasks.algorithms.masks.symmetric_walls import with_symmetric_walls
from tests.tasks.algorithms.overlap import overlap
from tests.tasks.algorithms.revolution.beaker import camera_positions

DIFFERENCE = 0.1


def vessel() -> np.ndarray:
    """Return the silhouette (H, W) bool of a tapering vessel whose axis leans."""
    x, y = camera_positions()
    across, along = x - 0.06 * y, y + 0.06 * x
    return (np.abs(along) < 70) & (np.abs(across + 8) < 34 + 0.12 * along)


def handle() -> np.ndarray:
    """Return the silhouette (H, W) bool of a handle at its right side."""
    x, y = camera_positions()
    ring = np.hypot(x - 32, y - 5)
    return (ring < 30) & (ring > 19) & ~vessel()


def table() -> np.ndarray:
    """Return the pixels (H, W) bool around vessel and handle."""
    return ~ndimage.binary_dilation(vessel() | handle(), iterations=6)


def contour_line(mask: np.ndarray) -> np.ndarray:
    """Return an image (H, W) with a line along the contour of a mask (H, W) bool, on a fainter texture."""
    line = (mask ^ ndimage.binary_erosion(mask)).astype(np.float32)
    texture = np.random.default_rng(0).normal(size=mask.shape).astype(np.float32)
    return cv2.GaussianBlur(5.0 * line, (0, 0), 0.8) + 0.3 * cv2.GaussianBlur(texture, (0, 0), 1.5)


def completed(mask: np.ndarray, line: np.ndarray, differing: np.ndarray) -> np.ndarray:
    everywhere = np.ones(mask.shape, bool)
    return with_symmetric_walls(mask, [line], DIFFERENCE * differing, table(), everywhere)


@pytest.mark.parametrize("handled", [False, True])
def test_a_wall_that_a_mask_lacks_is_added_and_no_second_handle(handled: bool) -> None:
    x, y = camera_positions()
    whole = vessel() | handle() if handled else vessel()
    core = whole & (x > -30) | whole & (y > 30)
    line = contour_line(whole)
    # The texture hides a part of the line on the side that the mask lacks.
    line[(np.abs(y) < 8) & (x < -30)] = 0.0
    mask = completed(core, line, core)
    assert overlap(core, whole) < 0.93 and overlap(mask, whole) > 0.98
    assert not (mask & ndimage.binary_dilation(handle()[:, ::-1]) & ~ndimage.binary_dilation(whole, iterations=2)).any()


def test_walls_that_a_mask_lacks_on_both_sides_are_found() -> None:
    x, _ = camera_positions()
    core = vessel() & (np.abs(x + 8) < 26)
    mask = completed(core, contour_line(vessel()), core)
    assert overlap(core, vessel()) < 0.85 and overlap(mask, vessel()) > 0.95


def test_nothing_is_added_without_edges() -> None:
    x, y = camera_positions()
    core = vessel() & ((x > -30) | (y > 30))
    assert np.array_equal(completed(core, np.zeros(core.shape, np.float32), core), core)


def test_nothing_is_added_where_the_object_may_not_be() -> None:
    x, y = camera_positions()
    core = vessel() & ((x > -30) | (y > 30))
    free = x > -30
    mask = with_symmetric_walls(core, [contour_line(vessel())], DIFFERENCE * core, table(), free)
    assert np.array_equal(mask & ~free, core & ~free)


def test_a_line_across_the_axis_is_no_wall() -> None:
    _, y = camera_positions()
    line = contour_line(vessel()) + cv2.GaussianBlur(5.0 * (np.abs(y + 82) < 0.6).astype(np.float32), (0, 0), 0.8)
    assert overlap(completed(vessel(), line, vessel()), vessel()) > 0.98
