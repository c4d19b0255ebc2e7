"""Given spheres against what the frames show: the clearest edge nearby, and the shapes of the highlights."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.sphere_checks.foreshortening import circle_of_highlights
from glint.tasks.algorithms.sphere_checks.given_circle import ConfirmedSphere
from glint.tasks.algorithms.sphere_checks.rival_circle import radius_lacking
from glint.tasks.stages import sphere_confirmation
from glint.tasks.stages.sphere_confirmation import confirm_given
from tests.tasks.algorithms.lighting.chrome_table import Scene, assert_near, render
from tests.tasks.algorithms.sphere_checks.mirrored_lamp import lamps, mirrored_lamp


def end_fits_at(monkeypatch: pytest.MonkeyPatch, confirmed: ConfirmedSphere) -> None:
    """Let the fits of all given circles end at the same one."""
    monkeypatch.setattr(sphere_confirmation, "confirm_sphere", lambda frames, sphere, camera=None: confirmed)


def mislead_fits(monkeypatch: pytest.MonkeyPatch, centre_sd: float) -> None:
    """Let fits of given circles all end at an edge inside the sphere."""
    edge = Sphere(55.0, 60.8, 28.0, 0.4, centre_sd, 0.2)
    confirmed = ConfirmedSphere(edge, edge, is_clear=True, is_corrected=True)
    end_fits_at(monkeypatch, confirmed)


@pytest.fixture
def misled_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    mislead_fits(monkeypatch, 0.2)


@pytest.mark.parametrize(("centre_sd", "stands"), [(1.2, True), (2.5, False)])
def test_a_given_circle_stands_against_a_fit_that_the_highlights_nearly_contradict(
    monkeypatch: pytest.MonkeyPatch, centre_sd: float, stands: bool
) -> None:
    mislead_fits(monkeypatch, centre_sd)
    truth = Sphere(58.3, 60.8, 30.4)
    (used,), _ = confirm_given(mirrored_lamp(truth, lamps(120)), [truth], None)
    assert (used.distance(truth) < 0.5 and abs(used.radius - truth.radius) < 0.5) == stands


@pytest.mark.usefixtures("misled_fit")
def test_a_given_circle_stands_against_a_fit_that_the_highlights_contradict() -> None:
    truth = Sphere(58.3, 60.8, 30.4)
    (used,), (warning,) = confirm_given(mirrored_lamp(truth, lamps(120)), [truth], None)
    assert (used.x, used.y, used.radius) == (truth.x, truth.y, truth.radius)
    assert "is used as it is: a clearer circle, at (55.0, 60.8)" in warning.message


@pytest.mark.parametrize(("edge_x", "is_refuted"), [(55.0, True), (58.3, False)])
def test_what_the_highlights_refute_leaves_no_doubt_about_a_given_circle(
    monkeypatch: pytest.MonkeyPatch, edge_x: float, is_refuted: bool
) -> None:
    edge, truth = Sphere(edge_x, 60.8, 28.0, 0.4, 0.3, 0.2), Sphere(58.3, 60.8, 30.4)
    beside = replace(truth, centre_sd=3.0, radius_sd=1.5)
    confirmed = ConfirmedSphere(beside, edge, is_clear=True, is_corrected=False, given_contrast=1.0)
    end_fits_at(monkeypatch, confirmed)
    (used,), _ = confirm_given(mirrored_lamp(truth, lamps(120)), [truth], None)
    assert used.distance(truth) == 0.0 and used.radius == truth.radius
    assert (used.centre_sd < 1.5 and used.radius_sd < 1.0) == is_refuted


@pytest.mark.usefixtures("misled_fit")
def test_where_the_highlights_contradict_both_neither_passes_as_right() -> None:
    truth, given = Sphere(58.3, 60.8, 30.4), Sphere(66.3, 60.8, 30.4)
    (used,), (warning,) = confirm_given(mirrored_lamp(truth, lamps(120)), [given], None)
    assert used.distance(truth) < max(2.0 * used.centre_sd, 0.03 * truth.radius)
    assert warning.message.startswith("the sphere given at (66.3, 60.8) with radius 30.4 contradicts the shapes of the")
    assert warning.message.endswith("and correct `spheres` in the catalogue")


@pytest.mark.usefixtures("misled_fit")
def test_a_given_circle_without_an_edge_of_its_own_gives_way_to_one_that_the_highlights_allow() -> None:
    """It is too small about the true centre: the highlights, whose radius is an upper bound, do not contradict it."""
    truth, given = Sphere(58.3, 60.8, 30.4), Sphere(58.3, 60.8, 27.9)
    frames = mirrored_lamp(truth, lamps(120))
    (used,), (warning,) = confirm_given(frames, [given], None)
    assert used.distance(truth) < 0.02 * truth.radius and abs(used.radius - truth.radius) < 0.02 * truth.radius
    assert "which is used: correct `spheres`" in warning.message


def test_a_corrected_radius_is_doubted_no_further_than_hands_err(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blurred highlights allow a far larger sphere, but whoever drew the circle saw none."""
    truth = Sphere(58.3, 60.8, 30.4, 0.4, 0.2, 0.2)
    confirmed = ConfirmedSphere(truth, truth, is_clear=True, is_corrected=True)
    end_fits_at(monkeypatch, confirmed)
    frames = np.stack([cv2.GaussianBlur(frame, (0, 0), 2.0) for frame in mirrored_lamp(truth, lamps(120))])
    shapes = circle_of_highlights(frames, truth)
    assert shapes is not None and radius_lacking(truth, shapes) > 0.15 * truth.radius
    given = replace(truth, radius=0.97 * truth.radius)
    (used,), _ = confirm_given(frames, [given], None)
    assert used.radius == truth.radius and 0.2 < used.radius_sd < 0.05 * truth.radius


@pytest.mark.parametrize(("right", "radius_ratio"), [(0.0, 1.0), (1.5, 0.95), (-1.5, 1.04)])
def test_where_the_contour_is_hidden_the_rim_tells_a_right_circle_from_a_wrong_one(
    right: float, radius_ratio: float
) -> None:
    truth = Sphere(150.3, 110.7, 36.0)
    frames = render(Scene([truth], tilt_deg=40.0, reflectance=0.95, texture=0.05, frames=48))
    given = replace(truth, x=truth.x + right, radius=radius_ratio * truth.radius)
    (used,), warnings = confirm_given(frames, [given], None)
    assert_near(used, truth, 0.015)
    assert max(used.centre_sd, used.radius_sd) < 0.02 * truth.radius
    if given == truth:
        assert (used.x, used.radius) == (truth.x, truth.radius)
        assert warnings == []
    else:
        assert "which is used: correct `spheres`" in str(warnings[0])
