import numpy as np

from glint.tasks.algorithms.masks.handle_openings import handle_openings

ROWS, COLUMNS = np.indices((160, 160))
HALF_WIDTH = 34.0 - 6.0 * np.sin(np.pi * (ROWS - 20) / 120.0) - 4.0 * (ROWS > 110)
BODY = (np.abs(COLUMNS - 60.0) < HALF_WIDTH) & (ROWS >= 20) & (ROWS < 140)
RADIUS = np.hypot((COLUMNS - 88.0) / 22.0, (ROWS - 70.0) / 27.0)
OPENING = (RADIUS < 0.65) & ~BODY
MUG = BODY | (RADIUS < 1.0)
"""A mug whose mask covers the opening of its handle."""


def test_the_opening_of_a_handle_is_found() -> None:
    found = handle_openings(MUG, OPENING)
    assert (found & OPENING).sum() > 0.9 * OPENING.sum() and not (found & ~OPENING).any()


def test_clear_walls_of_the_body_are_no_openings() -> None:
    wall = BODY & (np.abs(COLUMNS - 60.0) > 15.0)
    found = handle_openings(MUG, wall | OPENING)
    assert (found & OPENING).sum() > 0.9 * OPENING.sum() and not (found & BODY & (COLUMNS < 84)).any()
    assert not handle_openings(MUG, wall).any()


def test_what_a_handle_does_not_enclose_is_no_opening() -> None:
    assert not handle_openings(MUG, (RADIUS < 1.0) & ~BODY).any()


def test_a_body_without_a_handle_has_no_opening() -> None:
    assert not handle_openings(BODY, BODY & (ROWS > 50) & (ROWS < 90)).any()


def test_specks_and_shapes_without_a_body_have_no_opening() -> None:
    assert not handle_openings(MUG, OPENING & (ROWS % 2 == 0)).any()
    corner = (ROWS > 20) & (ROWS < 120) & (COLUMNS > 20) & ((COLUMNS < 50) | (ROWS > 100)) & (COLUMNS < 140)
    assert not handle_openings(corner, corner & (ROWS > 104) & (ROWS < 114) & (COLUMNS > 60) & (COLUMNS < 100)).any()
    assert not handle_openings(np.zeros_like(MUG), OPENING).any()
