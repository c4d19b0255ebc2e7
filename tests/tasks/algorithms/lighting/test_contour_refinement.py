"""Contour of a chrome sphere in spite of shadows beside it and an object that its rim mirrors."""

import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.lighting.circles import sample_rays
from glint.tasks.algorithms.lighting.contour import MIN_VARIATION_FRAMES, ContourFit, fit_contour
from glint.tasks.algorithms.lighting.contour_refinement import deviation_evidence, refine_contour
from glint.tasks.algorithms.lighting.pyramid import log_frames

SIZE, CENTRE, RADIUS = 160, 80.0, 50.0
ROWS, COLUMNS = np.mgrid[:SIZE, :SIZE]
DISTANCE = np.hypot(COLUMNS - CENTRE, ROWS - CENTRE)
ANGLE = np.degrees(np.arctan2(ROWS - CENTRE, COLUMNS - CENTRE))
COVER = np.clip(RADIUS + 0.5 - DISTANCE, 0.0, 1.0)


def log_sequence(table: np.ndarray, rim: np.ndarray) -> list[np.ndarray]:
    """Return log frames of a sphere with a rim (T, H, W) before a table (T, H, W), with blur and noise."""
    generator = np.random.default_rng(4)
    frames = COVER * rim + (1.0 - COVER) * table
    blurred = [cv2.GaussianBlur(frame, (0, 0), 1.0) for frame in frames]
    return log_frames([frame + generator.normal(0.0, 1.0, frame.shape) for frame in blurred])


def fits(frames: list[np.ndarray]) -> tuple[ContourFit, ContourFit]:
    """Return the fit of a contour near the true one, and the refined fit."""
    fit = fit_contour(frames, CENTRE + 0.4, CENTRE - 0.4, RADIUS + 0.4)
    return fit, refine_contour(frames, fit)


def error(fit: ContourFit) -> float:
    """Return the distance of the fit's centre from the true one in pixels."""
    return float(np.hypot(fit.x - CENTRE, fit.y - CENTRE))


def centre_deviation(fit: ContourFit) -> float:
    """Return the stated standard deviation of the fit's centre in pixels."""
    return float(np.sqrt(np.trace(fit.covariance[:2, :2])))


def table_levels(count: int) -> np.ndarray:
    """Return a table (T, H, W) with static texture that the light brightens and dims as a whole."""
    generator = np.random.default_rng(2)
    texture = cv2.GaussianBlur(generator.normal(0.0, 12.0, (SIZE, SIZE)), (0, 0), 1.5)
    light = 1.0 + 0.2 * np.sin(2.0 * np.pi * (np.arange(count) + 0.5) / count)
    return np.asarray((100.0 + texture) * light[:, None, None])


def test_deviations_show_where_the_mirror_image_of_an_object_ends() -> None:
    table = table_levels(32)
    levels = table.mean(axis=(1, 2)) / table[0].mean()
    rim = 0.85 * cv2.GaussianBlur(table[0], (0, 0), 6.0) * levels[:, None, None]
    lit = np.random.default_rng(3).uniform(0.4, 1.4, 32)[:, None, None]
    is_object = np.abs(ANGLE) > 120.0
    samples = sample_rays(log_sequence(table, np.where(is_object, 100.0 * lit, rim)), CENTRE, CENTRE, 44.0, 62.0)
    evidence, weight = deviation_evidence(samples, RADIUS)
    toward = np.abs((np.degrees(samples.angles) + 180.0) % 360.0 - 180.0)
    assert weight[toward > 135.0].min() == 1.0
    assert weight[toward < 105.0].max() == 0.0
    edges = samples.radii[evidence[toward > 135.0].argmax(axis=1)]
    # Evidence saturates, so that its maximum is broad, and lies outside its middle.
    assert np.median(edges) == pytest.approx(RADIUS, abs=1.25)
    assert np.ptp(edges) <= 1.5


def test_shadows_beside_the_sphere_do_not_pull_the_contour() -> None:
    table = table_levels(32)
    # In a third of the frames a shadow lies to the right, which a crescent of the rim mirrors.
    shadow = (np.arange(32) % 3 == 0)[:, None, None] & (np.abs(ANGLE) < 60.0) & (DISTANCE > RADIUS - 2.0)
    shade = np.where(shadow, 0.15, 1.0)
    first, refined = fits(log_sequence(table * shade, 0.85 * table * shade))
    assert error(refined) < 0.6 * error(first)


def test_a_clear_contour_is_not_moved_away() -> None:
    table = table_levels(32)
    first, refined = fits(log_sequence(table, 0.7 * table))
    assert error(refined) < error(first)
    assert refined.radius == pytest.approx(first.radius, abs=0.15)


def test_a_contour_that_shows_along_an_arc_is_less_certain() -> None:
    table = table_levels(32)
    _, whole = fits(log_sequence(table, 0.7 * table))
    _, part = fits(log_sequence(table, table * np.where(np.abs(ANGLE) < 60.0, 0.7, 1.0)))
    assert centre_deviation(part) > 2.0 * centre_deviation(whole)
    assert error(whole) < 3.0 * centre_deviation(whole)
    assert error(part) < 3.0 * centre_deviation(part)


def test_a_few_stills_are_not_refined() -> None:
    first, refined = fits(log_sequence(table_levels(MIN_VARIATION_FRAMES - 1), 0.7 * table_levels(5)))
    assert refined is first
