"""Frames of a table on which a lamp moves, with an object that stays, moves, or is exchanged."""

import numpy as np
import pytest

from glint.tasks.algorithms.frames.scene_change import scene_change

ROWS, COLUMNS = np.mgrid[:90, :160]
TABLE = 60.0 + 8.0 * np.random.default_rng(0).normal(size=(90, 160))


def frames(places: list[float], count: int = 120, is_one_sided: bool = False) -> np.ndarray:
    """Frames (T, H, W) of a textured square at columns that take turns over the capture, under a lamp that moves.

    is_one_sided: whether the lamp stays on the left first, and on the right then.
    """
    noise = np.random.default_rng(1)
    texture = 30.0 * np.random.default_rng(2).normal(size=(40, 40))
    stack = []
    for number in range(count):
        picture = TABLE.copy()
        left = round(places[number * len(places) // count])
        picture[25:65, left : left + 40] += texture
        across = np.cos(0.3 * number)
        if is_one_sided:
            across = np.copysign(abs(across), 2 * number - count)
        lamp = 80.0 + 60.0 * across, 45.0 + 40.0 * np.sin(0.41 * number)
        picture *= 0.6 + 0.6 * np.exp(-np.hypot(COLUMNS - lamp[0], ROWS - lamp[1]) / 80.0)
        stack.append(picture + noise.normal(0.0, 2.0, picture.shape))
    return np.stack(stack).clip(0.0, 255.0).astype(np.uint8)


@pytest.mark.parametrize(("places", "first"), [([50.0, 56.0], 60), ([50.0, 50.0, 50.0, 90.0], 90)])
def test_an_object_that_was_moved_is_another_scene(places: list[float], first: int) -> None:
    change = scene_change(frames(places))
    assert change is not None and abs(change - first) <= 1


@pytest.mark.parametrize("is_one_sided", [False, True])
def test_a_lamp_that_moves_changes_no_scene(is_one_sided: bool) -> None:
    assert scene_change(frames([50.0], is_one_sided=is_one_sided)) is None


def test_few_or_dark_frames_show_no_change() -> None:
    assert scene_change(frames([50.0, 90.0], count=24)) is None
    assert scene_change(np.zeros((80, 20, 30), np.uint8)) is None
