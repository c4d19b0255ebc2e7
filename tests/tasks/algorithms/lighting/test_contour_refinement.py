"""Contour of a chrome sphere in spite of shadows beside it and an object that its rim mirrors."""

import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.lighting.contour import MIN_VARIATION_FRAMES, ContourFit, fit_contour
from glint.tasks.algorithms.lighting.contour_refinement import refine_contour
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


def table_levels(count: int) -> np.ndarray:
    """Return a table (T, H, W) with static texture that the light brightens and dims as a whole."""
    generator = np.random.default_rng(2)
    texture = cv2.GaussianBlur(generator.normal(0.0, 12.0, (SIZE, SIZE)), (0, 0), 1.5)
    light = 1.0 + 0.2 * np.sin(2.0 * np.pi * (np.arange(count) + 0.5) / count)
    return np.asarray((100.0 + texture) * light[:, None, None])


def test_an_object_in_the_rim_does_not_pull_the_contour():
    table = table_levels(32)
    rim = 0.85 * cv2.GaussianBlur(table[0], (0, 0), 6.0) * (table.mean(axis=(1, 2)) / table[0].mean())[:, None, None]
    lit = np.random.default_rng(3).uniform(0.3, 3.0, 32)[:, None, None]
    # The mirrored object ends 1.5 pixels inside the contour, as a part of the rim mirrors the table before it.
    is_object = (np.abs(ANGLE) > 140.0) & (DISTANCE < RADIUS - 1.5)
    first, refined = fits(log_sequence(table, np.where(is_object, 250.0 * lit, rim)))
    assert error(refined) < 0.75 * error(first)
    assert error(refined) < 0.1


def test_shadows_beside_the_sphere_do_not_pull_the_contour():
    table = table_levels(32)
    rim = 0.8 * table
    # In a third of the frames a shadow lies to the right, which a crescent of the rim mirrors.
    shadow = (np.arange(32) % 3 == 0)[:, None, None] & (np.abs(ANGLE) < 60.0) & (DISTANCE > RADIUS - 2.0)
    shade = np.where(shadow, 0.15, 1.0)
    first, refined = fits(log_sequence(table * shade, rim * shade))
    assert error(refined) < 0.75 * error(first)


def test_a_clear_contour_stays_where_it_is():
    table = table_levels(32)
    first, refined = fits(log_sequence(table, 0.7 * table))
    assert error(first) < 0.1
    assert error(refined) < 0.1
    assert refined.radius == pytest.approx(first.radius, abs=0.15)


def test_a_few_stills_are_not_refined():
    first, refined = fits(log_sequence(table_levels(MIN_VARIATION_FRAMES - 1), 0.7 * table_levels(5)))
    assert refined is first


def test_fits_that_disagree_are_told_by_the_covariance():
    table = table_levels(32)
    shade = np.where((np.abs(ANGLE) < 100.0) & (DISTANCE > RADIUS - 3.0), 0.2, 1.0)
    half = np.where((np.arange(32) % 2 == 0)[:, None, None], shade, 1.0)
    first, refined = fits(log_sequence(table * half, 0.8 * table * half))
    assert refined.covariance.trace() > first.covariance.trace() * 0.5
    assert np.all(np.linalg.eigvalsh(refined.covariance) > 0.0)
