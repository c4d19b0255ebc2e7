import numpy as np
import pytest

from glint.tasks.algorithms.masks.mask_regions import (
    CLOSE_SHARE,
    closed,
    filled,
    handle_openings,
    main_components,
    object_sizes,
)
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


def disc(x: float, y: float, radius: float) -> np.ndarray:
    return np.asarray(np.hypot(COLUMNS - x, ROWS - y) < radius)


@pytest.mark.parametrize(
    ("parts", "count"),
    [
        ([(40, 80, 30), (120, 80, 30)], 2),
        ([(40, 80, 30), (120, 80, 18)], 2),
        ([(40, 40, 20), (120, 40, 20), (80, 120, 25)], 3),
        ([(80, 60, 40), (80, 140, 12), (20, 140, 8)], 1),
        ([(60, 80, 30), (121, 80, 30)], 1),
        ([(80, 80, 40)], 1),
        ([], 0),
    ],
)
def test_parts_of_similar_size_are_objects(parts: list[tuple[float, float, float]], count: int) -> None:
    mask = np.any([disc(*part) for part in parts] + [np.zeros((160, 160), bool)], axis=0)
    sizes = object_sizes(mask, np.ones_like(mask))
    assert len(sizes) == count
    assert sizes == sorted((int(disc(*part).sum()) for part in parts), reverse=True)[:count] or count == 1


def test_a_foot_without_its_stem_is_no_object() -> None:
    """The foot of a wine glass seen obliquely, beside its bowl."""
    bowl = np.hypot((COLUMNS - 80.0) / 40.0, (ROWS - 50.0) / 45.0) < 1.0
    foot = np.hypot((COLUMNS - 80.0) / 36.0, (ROWS - 145.0) / 9.0) < 1.0
    assert len(object_sizes(bowl | foot, np.ones_like(bowl))) == 1


def test_a_sphere_that_a_mask_covers_neither_is_an_object_nor_divides_one() -> None:
    glass, sphere = disc(60, 60, 40), disc(130, 130, 25)
    assert object_sizes(glass | sphere, ~disc(130, 130, 32)) == [int(glass.sum())]
    beside = np.abs(COLUMNS - 60) >= 25
    assert object_sizes(glass, beside) == [int((glass & beside).sum())]


def test_what_lies_along_the_edge_of_the_frame_or_flashes_in_few_frames_is_no_main_component() -> None:
    glass, moment = disc(80, 90, 30), ROWS * 160 + COLUMNS
    flashing = glass & (COLUMNS > 80) & (ROWS > 90)
    arm, lamp = ROWS < 3, disc(20, 130, 12)
    assert np.array_equal(main_components(glass | arm, flashing | arm, moment), glass)
    once = np.where(lamp, moment % 3, moment)
    assert np.array_equal(main_components(glass | lamp, flashing | lamp, once), glass)
    # The same blob is a part of the object if it flashes under many lights.
    assert np.array_equal(main_components(glass | lamp, flashing | lamp, moment), glass | lamp)
    nothing = np.zeros_like(glass)
    assert not main_components(nothing, nothing, moment).any()


def test_holes_are_glass_if_they_are_small_or_behind_a_thin_line() -> None:
    ring = disc(80, 80, 50) & ~disc(80, 80, 25)
    assert np.array_equal(filled(ring, 0.0) & disc(80, 80, 20), np.zeros_like(ring))
    speck = disc(80, 80, 50) & ~disc(80, 80, 5)
    assert filled(speck, 0.0)[80, 80]
    line = disc(105, 80, 30) & ~disc(105, 80, 29)
    bowl = disc(55, 80, 30)
    assert filled(bowl | line, CLOSE_SHARE)[70:90, 95:125].all()


def test_gaps_narrower_than_twice_the_radius_are_closed() -> None:
    bars = (COLUMNS % 10 < 6) & (ROWS < 100)
    assert closed(bars, 2.0)[5:95, 5:150].all() and not closed(bars, 2.0)[104:].any()
    assert np.array_equal(closed(bars, 1.0), bars)
