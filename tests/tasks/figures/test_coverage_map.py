import numpy as np

from glint.tasks.algorithms.lighting.coverage import coverage
from glint.tasks.figures.coverage_map import draw_coverage
from tests.tasks.algorithms.lighting.light_sweep import sweep


def test_the_picture_marks_the_gap_red() -> None:
    half_vectors = sweep(8000, lambda lights: lights[:, 0] > 0)
    picture = draw_coverage(coverage(half_vectors), half_vectors, size=400)
    assert picture.shape == (400, 400, 3) and picture.dtype == np.uint8
    red = (picture[..., 0].astype(int) - picture[..., 1] > 120).sum(axis=0)
    assert red[:180].sum() > 1000 and red[230:].sum() == 0


def test_a_capture_without_any_light_can_be_drawn() -> None:
    half_vectors = np.full((10, 3), np.nan)
    assert draw_coverage(coverage(half_vectors), half_vectors).shape == (640, 640, 3)
