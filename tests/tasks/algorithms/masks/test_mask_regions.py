import numpy as np

from glint.tasks.algorithms.masks.mask_regions import handle_openings
from glint.tasks.algorithms.silhouettes.mirror_images import MirrorAxis, mirror_axes

ROWS, COLUMNS = np.indices((160, 160))
HALF_WIDTH = 34.0 - 6.0 * np.sin(np.pi * (ROWS - 20) / 120.0) - 4.0 * (ROWS > 110)
BODY = (np.abs(COLUMNS - 60.0) < HALF_WIDTH) & (ROWS >= 20) & (ROWS < 140)
RADIUS = np.hypot((COLUMNS - 88.0) / 22.0, (ROWS - 70.0) / 27.0)
OPENING = (RADIUS < 0.65) & ~BODY
MUG = BODY | (RADIUS < 1.0)
"""A mug whose mask covers the opening of its handle."""
AXIS = MirrorAxis(np.array([60.0, 80.0]), 0.0, 0.0)


def test_the_opening_of_a_handle_is_found() -> None:
    found = handle_openings(MUG, OPENING, AXIS)
    assert (found & OPENING).sum() > 0.9 * OPENING.sum() and not (found & ~OPENING).any()


def test_clear_walls_of_the_body_are_no_openings() -> None:
    wall = BODY & (np.abs(COLUMNS - 60.0) > 15.0)
    found = handle_openings(MUG, wall | OPENING, AXIS)
    assert (found & OPENING).sum() > 0.9 * OPENING.sum() and not (found & BODY & (COLUMNS < 84)).any()
    assert not handle_openings(MUG, wall, AXIS).any()


def test_what_a_handle_does_not_enclose_is_no_opening() -> None:
    assert not handle_openings(MUG, (RADIUS < 1.0) & ~BODY, AXIS).any()


def test_a_body_without_a_handle_has_no_opening() -> None:
    assert not handle_openings(BODY, BODY & (ROWS > 50) & (ROWS < 90), AXIS).any()


def test_specks_and_shapes_without_a_body_have_no_opening() -> None:
    assert not handle_openings(MUG, OPENING & (ROWS % 2 == 0), AXIS).any()
    corner = (ROWS > 20) & (ROWS < 120) & (COLUMNS > 20) & ((COLUMNS < 50) | (ROWS > 100)) & (COLUMNS < 140)
    shown = corner & (ROWS > 104) & (ROWS < 114) & (COLUMNS > 60) & (COLUMNS < 100)
    assert not any(handle_openings(corner, shown, axis).any() for axis in mirror_axes(corner))
    assert not handle_openings(np.zeros_like(MUG), OPENING, AXIS).any()
