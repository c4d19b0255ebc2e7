"""Contour of a chrome sphere: changes of levels along rays, and of how much they vary over time."""

import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.lighting.contour import MIN_VARIATION_FRAMES, fit_contour
from glint.tasks.algorithms.lighting.pyramid import log_frames

RADIUS = 50.0
CENTRE = 80.0


def disc(x: float, radius: float) -> np.ndarray:
    """Return the share (160, 160), 0..1, of each pixel that a disc around (x, CENTRE) covers."""
    rows, columns = np.mgrid[:160, :160]
    return np.clip(radius + 0.5 - np.hypot(columns - x, rows - CENTRE), 0.0, 1.0)


def frames_of(level_x: float, variation_x: float, count: int, *, constant: bool = False) -> np.ndarray:
    """Return frames (T, 160, 160) with a static edge around level_x; beyond the circle around variation_x levels vary
    with the light, within it a quarter as much."""
    generator = np.random.default_rng(1)
    light = np.zeros(count) if constant else np.sin(2.0 * np.pi * (np.arange(count) + 0.5) / count)
    static = 100.0 - 12.0 * disc(level_x, RADIUS)
    gain = 1.0 - 0.75 * disc(variation_x, RADIUS)
    frames = static * (1.0 + 0.12 * light[:, None, None] * gain) + generator.normal(0.0, 1.0, (count, 160, 160))
    return np.stack([cv2.GaussianBlur(frame, (0, 0), 1.0) for frame in frames])


def offset_percent(frames: np.ndarray) -> float:
    """Return how far the fit's centre lies to the right of CENTRE, in percent of the radius."""
    fit = fit_contour(log_frames(list(frames)), CENTRE + 0.5, CENTRE - 0.5, RADIUS + 0.5)
    return (fit.x - CENTRE) / RADIUS * 100.0


def test_the_variation_over_time_pulls_the_centre_from_a_wrong_edge_of_levels() -> None:
    few = offset_percent(frames_of(CENTRE + 0.45, CENTRE, MIN_VARIATION_FRAMES - 1, constant=True))
    many = offset_percent(frames_of(CENTRE + 0.45, CENTRE, 24))
    assert few == pytest.approx(0.9, abs=0.3)
    assert many < 0.75 * few


def test_a_variation_that_ends_elsewhere_does_not_move_the_contour() -> None:
    assert offset_percent(frames_of(CENTRE, CENTRE - 3.0, 24)) == pytest.approx(0.0, abs=0.5)


def test_without_variation_the_levels_decide() -> None:
    assert offset_percent(frames_of(CENTRE, CENTRE, 24, constant=True)) == pytest.approx(0.0, abs=0.5)
