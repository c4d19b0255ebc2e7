"""Circles that a person gave beside those that the frames show: which is used, and how well it is known."""

from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.sphere_checks.given_circle import confirm_sphere, judged
from tests.tasks.algorithms.lighting.chrome_table import Scene, assert_near, render


def test_a_given_circle_that_is_wrong_is_corrected_and_a_right_one_kept() -> None:
    truth = Sphere(150.3, 110.8, 50.0)
    frames = render(Scene([truth]))
    wrong = confirm_sphere(frames, Sphere(153.3, 110.8, 47.0))
    assert wrong.is_clear
    assert wrong.is_corrected
    assert wrong.sphere.centre_sd > wrong.fit.centre_sd, "the given circle speaks against the fit"
    assert_near(wrong.sphere, truth, 0.015)
    right = confirm_sphere(frames, truth)
    assert not right.is_corrected
    assert (right.sphere.x, right.sphere.y, right.sphere.radius) == (truth.x, truth.y, truth.radius)
    assert right.sphere.centre_sd > 0.0


def sphere_with_a_stronger_edge_inside(hidden_deg: float) -> tuple[np.ndarray, Sphere]:
    """Frames of a disc whose contour vanishes over an arc, before a darker disc that touches its other side."""
    generator, (rows, columns) = np.random.default_rng(0), np.mgrid[:220, :300]
    contour, inner = Sphere(150.0, 110.0, 50.0), Sphere(154.0, 110.0, 46.0)
    image = np.ones(rows.shape)
    image[np.hypot(columns - contour.x, rows - contour.y) < contour.radius] = 0.5
    image[np.abs(np.degrees(np.arctan2(rows - contour.y, contour.x - columns))) < 0.5 * hidden_deg] = 1.0
    image[np.hypot(columns - inner.x, rows - inner.y) < inner.radius] = 0.3
    levels = generator.uniform(60.0, 200.0, (16, 1, 1))
    frames = np.clip(image * levels + generator.normal(0.0, 2.0, (16, *image.shape)), 0.0, 255.0).astype(np.uint8)
    return frames, contour


@pytest.mark.parametrize("hidden_deg", [108.0, 130.0])
def test_a_given_circle_around_a_stronger_one_stands_and_is_doubted(hidden_deg: float) -> None:
    frames, contour = sphere_with_a_stronger_edge_inside(hidden_deg)
    confirmed = confirm_sphere(frames, contour)
    assert confirmed.fit.distance(contour) > 3.0
    assert not confirmed.is_corrected and (confirmed.sphere.x, confirmed.sphere.radius) == (contour.x, contour.radius)
    assert confirmed.sphere.centre_sd > 2.0 and confirmed.sphere.radius_sd > 2.0


def test_a_given_circle_where_nothing_is_seen_is_doubted() -> None:
    frames = np.random.default_rng(0).normal(90.0, 2.0, (12, 220, 300)).clip(0, 255).astype(np.uint8)
    confirmed = confirm_sphere(frames, Sphere(150.0, 110.0, 50.0))
    assert not confirmed.is_clear
    assert confirmed.sphere.centre_sd == pytest.approx(1.0)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("radius", [1e-6, 0.5, 2.0, 8.0])
def test_however_small_a_given_circle_is_something_finite_is_measured(radius: float) -> None:
    frames = list(np.random.default_rng(0).integers(0, 255, (32, 80, 90)).astype(np.uint8))
    fit = confirm_sphere(frames, Sphere(40.0, 30.0, radius)).fit
    assert np.isfinite([fit.x, fit.y, fit.radius, fit.score]).all() and abs(fit.radius - radius) < radius


GIVEN, NEAR, FAR = (
    Sphere(50.0, 50.0, 40.0),
    Sphere(52.0, 50.0, 39.0, 0.4, 0.4, 0.4),
    Sphere(55.0, 50.0, 36.0, 0.4, 0.4, 0.4),
)


def test_a_fit_farther_from_a_given_circle_than_hands_err_is_another_edge() -> None:
    """By hand nobody is off by a sixth of the radius: what is seen there is another edge."""
    near, far = (judged(GIVEN, fit, 0.5 * fit.score) for fit in (NEAR, FAR))
    assert near.is_corrected and not near.is_disputed
    assert far.is_disputed and not far.is_corrected
    assert (far.sphere.x, far.sphere.radius) == (GIVEN.x, GIVEN.radius)
    assert far.sphere.centre_sd > 0.05 * GIVEN.radius, "the clearer circle speaks against the given one"
    assert judged(GIVEN, FAR, 0.0).is_corrected, "nothing is seen at the given circle"


def test_of_a_small_circle_a_pixel_is_no_large_error() -> None:
    given, fit = Sphere(50.0, 50.0, 10.0), Sphere(51.2, 50.0, 10.0, 0.4, 0.2, 0.2)
    assert judged(given, fit, 0.5 * fit.score).is_corrected
    larger = [replace(circle, x=4.0 * circle.x, radius=4.0 * circle.radius) for circle in (given, fit)]
    assert judged(larger[0], larger[1], 0.5 * fit.score).is_disputed


def test_a_fit_that_replaces_a_circle_of_nearly_its_contrast_is_doubted() -> None:
    clear, doubted = (judged(GIVEN, NEAR, ratio * NEAR.score).sphere for ratio in (0.0, 0.6))
    assert doubted.centre_sd > 1.05 * clear.centre_sd and doubted.radius_sd > 1.02 * clear.radius_sd


@pytest.mark.parametrize(("radius", "is_corrected"), [(28.5, False), (31.5, True)])
def test_a_fit_inside_the_given_circle_must_be_clearer_than_one_around_it(radius: float, is_corrected: bool) -> None:
    given, fit = Sphere(50.0, 50.0, 30.0), Sphere(50.0, 50.0, radius, 0.5, 0.1, 0.1)
    assert judged(given, fit, 0.85 * fit.score).is_corrected == is_corrected
