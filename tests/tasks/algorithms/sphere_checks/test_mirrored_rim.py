"""The contour of a chrome sphere by what its rim mirrors: the law of reflection, and circles beside the contour."""

from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.sphere_checks.mirrored_rim import settled_rim, with_mirrored_rim
from glint.tasks.algorithms.sphere_checks.rim_evidence import mirrored_radius
from tests.tasks.algorithms.lighting.chrome_table import Scene, assert_near, render

TRUTH = Sphere(150.3, 110.7, 36.0, score=0.3)
BRIGHT_RIM = 0.95
"""Reflectance of a rim that is as bright as the table."""


@pytest.fixture(scope="module", params=[10.0, 40.0])
def hidden(request: pytest.FixtureRequest) -> np.ndarray:
    """Frames of a sphere whose contour has no edge of its own."""
    scene = Scene([TRUTH], tilt_deg=request.param, reflectance=BRIGHT_RIM, texture=0.05, frames=48)
    return render(scene)


@pytest.mark.parametrize("tilt_deg", [0.0, 35.0])
def test_the_mirrored_radius_obeys_the_law_of_reflection(tilt_deg: float) -> None:
    tilt, generator = np.radians(tilt_deg), np.random.default_rng(0)
    normal = np.array([0.0, np.sin(tilt), np.cos(tilt)])
    turn, radius = generator.uniform(0.0, 2.0 * np.pi, 50), generator.uniform(0.9, 1.0, 50)
    point = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1.0 - radius**2)], axis=1)
    view = np.array([0.0, 0.0, -1.0])
    mirrored = view - 2.0 * (point @ view)[:, None] * point
    # The sphere about the origin lies on the plane normal . p = -1.
    place = point + (-(1.0 + point @ normal) / (mirrored @ normal))[:, None] * mirrored
    expected = np.hypot(place[:, 0], place[:, 1])
    result = mirrored_radius(radius[:, None], np.sin(turn)[:, None], tilt)[:, 0]
    np.testing.assert_allclose(result, expected, rtol=1e-9)
    np.testing.assert_allclose(np.arctan2(place[:, 1], place[:, 0]), np.arctan2(point[:, 1], point[:, 0]), atol=1e-9)


def test_the_contour_mirrors_what_lies_at_it_and_the_middle_no_table() -> None:
    at_contour = mirrored_radius(np.ones(3), np.array([-1.0, 0.0, 1.0]), 0.5)
    np.testing.assert_allclose(at_contour, 1.0, atol=1e-9)
    assert np.isnan(mirrored_radius(np.array([0.5]), np.array([0.0]), 0.0)).all()


@pytest.mark.parametrize("factor", [0.95, 1.02])
def test_a_circle_beside_a_hidden_contour_is_corrected(hidden: np.ndarray, factor: float) -> None:
    beside = replace(TRUTH, x=TRUTH.x + 0.9, y=TRUTH.y - 0.9, radius=factor * TRUTH.radius)
    result = with_mirrored_rim(hidden, beside)
    assert_near(result, TRUTH, 0.015)
    assert max(result.centre_sd, result.radius_sd) < 0.02 * TRUTH.radius
    assert result.score == beside.score


def test_a_given_circle_may_lie_outside_the_contour(hidden: np.ndarray) -> None:
    outside = replace(TRUTH, x=TRUTH.x - 1.0, radius=1.055 * TRUTH.radius)
    assert with_mirrored_rim(hidden, outside) is outside
    fit = settled_rim(hidden, outside, shrinkage=0.07)
    assert fit is not None
    assert_near(fit.sphere, TRUTH, 0.015)


@pytest.mark.parametrize("factor", [0.76, 0.86])
def test_the_contour_around_the_mirror_image_of_the_horizon_is_found(hidden: np.ndarray, factor: float) -> None:
    inside = replace(TRUTH, y=TRUTH.y - (1.0 - factor) * TRUTH.radius, radius=factor * TRUTH.radius)
    assert settled_rim(hidden, inside) is None
    assert_near(with_mirrored_rim(hidden, inside), TRUTH, 0.015)


@pytest.mark.parametrize("factor", [0.7, 0.77, 0.86])
def test_a_circle_far_inside_is_not_replaced_by_one_still_farther_inside(hidden: np.ndarray, factor: float) -> None:
    inside = replace(TRUTH, radius=factor * TRUTH.radius)
    result = with_mirrored_rim(hidden, inside)
    assert result is inside or result.radius > inside.radius


def test_a_contour_with_an_edge_of_its_own_is_left_to_it() -> None:
    frames = render(Scene([TRUTH], reflectance=0.7, frames=48))
    beside = replace(TRUTH, radius=0.98 * TRUTH.radius)
    assert with_mirrored_rim(frames, beside) is beside


def test_clear_circles_and_perspective_ones_are_left_as_they_are(hidden: np.ndarray) -> None:
    beside = replace(TRUTH, radius=0.95 * TRUTH.radius)
    clear = replace(beside, score=0.5)
    assert with_mirrored_rim(hidden, clear) is clear
    camera = np.array([[900.0, 0.0, 150.0], [0.0, 900.0, 110.0], [0.0, 0.0, 1.0]])
    assert with_mirrored_rim(hidden, beside, camera) is beside


@pytest.mark.parametrize(
    "sphere", [TRUTH, *(Sphere(3.0, 4.0, radius, score=0.2) for radius in (1e-6, 8.0, 10.0, 25.0, 140.0))]
)
def test_frames_that_show_nothing_change_nothing(sphere: Sphere) -> None:
    for frames in (np.zeros((12, 220, 300), np.uint8), np.full((1, 220, 300), 255, np.uint8)):
        assert with_mirrored_rim(frames, sphere) is sphere
