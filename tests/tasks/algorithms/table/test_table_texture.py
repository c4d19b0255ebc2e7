"""Evidence of textures that are not the table's, on patterns drawn from noise."""

import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.table.table_texture import MAX_TEXTURE_RATIO, texture_ratio

SIZE, CENTRE, RADIUS = 240, 120.0, 60.0
ROOT_AREA = float(np.sqrt(np.pi) * RADIUS)


def distance() -> np.ndarray:
    """Return the distance (H, W) of pixels from the middle of the picture."""
    rows, columns = np.mgrid[:SIZE, :SIZE]
    return np.hypot(columns - CENTRE, rows - CENTRE)


def streaks(seed: int = 0) -> np.ndarray:
    """Return levels (H, W) of a table with streaks along its rows."""
    noise = np.random.default_rng(seed).normal(size=(SIZE, SIZE)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), sigmaX=9.0, sigmaY=2.0)
    return np.clip(80.0 + 25.0 * smooth / smooth.std(), 20.0, 160.0)


@pytest.mark.parametrize("refracted", [streaks(1).T, cv2.GaussianBlur(streaks(1), (0, 0), 5.0)])
def test_a_turned_or_a_blurred_pattern_is_not_the_tables(refracted: np.ndarray) -> None:
    levels, is_table = streaks(), distance() > RADIUS + 10.0
    levels[distance() < RADIUS] = refracted[distance() < RADIUS]
    ratio = texture_ratio(levels, is_table, ROOT_AREA)
    assert ratio[distance() < RADIUS - 5.0].mean() > 0.2 and ratio[is_table].mean() < -0.1


def test_the_mirror_image_of_an_oblique_pattern_is_not_the_tables() -> None:
    oblique = np.stack([np.roll(row, number) for number, row in enumerate(streaks().T)])
    levels, is_table = oblique.copy(), distance() > RADIUS + 10.0
    levels[distance() < RADIUS] = oblique[:, ::-1][distance() < RADIUS]
    assert texture_ratio(levels, is_table, ROOT_AREA)[distance() < RADIUS - 5.0].mean() > 0.2


def test_what_lies_beside_the_object_is_still_the_table() -> None:
    levels, is_table = streaks(), distance() > RADIUS + 10.0
    levels[distance() < RADIUS] = streaks(1).T[distance() < RADIUS]
    ratio = texture_ratio(levels, is_table, ROOT_AREA)
    assert ratio[(distance() > RADIUS + 1.0) & (distance() < RADIUS + 5.0)].mean() < 0.1


def test_another_table_with_the_same_pattern_is_no_evidence() -> None:
    levels, is_table = streaks(), distance() > RADIUS + 10.0
    levels[distance() < RADIUS] = streaks(2)[distance() < RADIUS]
    assert texture_ratio(levels, is_table, ROOT_AREA)[distance() < RADIUS - 10.0].mean() < 0.0


def test_a_table_without_any_pattern_has_a_bounded_ratio() -> None:
    levels, is_table = np.full((SIZE, SIZE), 60.0), distance() > RADIUS + 20.0
    levels[distance() < RADIUS] = streaks()[distance() < RADIUS]
    ratio = texture_ratio(levels, is_table, ROOT_AREA)
    assert ratio[distance() < RADIUS - 10.0].min() == pytest.approx(MAX_TEXTURE_RATIO)
    assert ratio[is_table].max() < 0.0


def test_without_a_table_there_is_no_evidence() -> None:
    assert not texture_ratio(streaks(), distance() < 3.0, ROOT_AREA).any()


def test_a_small_object_has_no_texture() -> None:
    levels, is_table = streaks(), distance() > 30.0
    levels[~is_table] = streaks(1).T[~is_table]
    assert not texture_ratio(levels, is_table, 60.0).any()
