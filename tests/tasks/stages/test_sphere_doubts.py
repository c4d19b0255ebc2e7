"""Doubt of spheres: small ones that were found, and what their fits leave uncertain in the half vectors."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glint.storage.catalogue.loading import load
from glint.tasks.algorithms.lighting.lights import ACCEPTED, BEHIND, Lights, merge_spheres
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.near_light.half_vector_error import spheres_error
from glint.tasks.stages.sphere_doubts import circles_error, inner_edge_error, sphere_doubts, sweep_error
from tests.tasks.make_context import make_context, perform_all

HALF_VECTORS = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]], np.float32)
UNKNOWN = np.full(2, np.nan, np.float32)
LIGHTS = Lights(HALF_VECTORS, HALF_VECTORS, np.full(2, ACCEPTED, np.uint8), UNKNOWN, UNKNOWN)


def doubts(sphere: Sphere, *, is_given: bool = False) -> list[str]:
    """Return the messages of the warnings about a single sphere."""
    return [warning.message for warning in sphere_doubts([sphere], LIGHTS, is_near=False, is_given=is_given)]


def lights_behind(count: int) -> Lights:
    """Return 100 lights, so many of which lie behind the object."""
    reason = np.where(np.arange(100) < count, BEHIND, ACCEPTED).astype(np.uint8)
    vectors, unknown = np.tile(HALF_VECTORS[:1], (100, 1)), np.full(100, np.nan, np.float32)
    return Lights(vectors, vectors, reason, unknown, unknown)


def test_a_small_sphere_is_doubted_unless_it_was_given() -> None:
    assert any("radius of 17.0 pixels" in message for message in doubts(Sphere(0.0, 0.0, 17.0, 0.3)))
    assert doubts(Sphere(0.0, 0.0, 17.0, 1.0)) == []
    assert doubts(Sphere(0.0, 0.0, 40.0, 0.3)) == []


def test_a_badly_known_contour_is_doubted_with_a_remedy_that_helps() -> None:
    assert "or give `spheres`" in doubts(Sphere(0.0, 0.0, 40.0, 0.3, 0.8, 0.8))[0]
    assert "or a larger sphere" in doubts(Sphere(0.0, 0.0, 40.0, 1.0, 0.8, 0.8), is_given=True)[0]
    assert doubts(Sphere(0.0, 0.0, 40.0, 1.0, 0.3, 0.3), is_given=True) == []


def test_whoever_gave_a_circle_that_a_fit_replaces_is_not_told_to_give_one() -> None:
    badly_known, small = Sphere(0.0, 0.0, 40.0, 0.3, 0.8, 0.8), Sphere(0.0, 0.0, 17.0, 0.3)
    for sphere in (badly_known, small):
        (message,) = doubts(sphere, is_given=True)
        assert "give `spheres`" not in message
    for is_given, remedy in ((True, "or correct `spheres`"), (False, "or give `spheres`")):
        (warning,) = sphere_doubts([Sphere(0.0, 0.0, 40.0)], lights_behind(30), is_near=False, is_given=is_given)
        assert remedy in warning.message


def test_of_several_causes_the_most_costly_one_is_told() -> None:
    for centre_sd, start in ((0.8, "30% of the highlights"), (8.0, "the contour of the chrome sphere")):
        sphere = Sphere(0.0, 0.0, 40.0, 1.0, centre_sd, 0.8)
        (warning,) = sphere_doubts([sphere], lights_behind(30), is_near=False, is_given=True)
        assert warning.message.startswith(start)


def test_of_two_spheres_the_worse_one_is_named() -> None:
    spheres = [Sphere(10.0, 20.0, 40.0, 1.0, 2.0, 2.0), Sphere(30.0, 50.0, 40.0, 0.3, 3.0, 3.0)]
    (warning,) = sphere_doubts(spheres, LIGHTS, is_near=False, is_given=True)
    assert warning.message.startswith("the contour of the chrome sphere at (30.0, 50.0) is known to 7.5% of its radius")


@pytest.mark.parametrize(("behind", "is_told"), [(9, False), (12, True)])
def test_many_highlights_near_the_contour_tell_of_a_circle_inside_the_sphere(behind: int, is_told: bool) -> None:
    warnings = sphere_doubts([Sphere(0.0, 0.0, 40.0)], lights_behind(behind), is_near=False, is_given=False)
    assert [f"{behind}% of the highlights" in warning.message for warning in warnings] == [True] * is_told
    assert np.degrees(inner_edge_error(lights_behind(behind))) == pytest.approx(4.95 * is_told, abs=0.01)


@pytest.mark.parametrize("radius", [16.0, 22.0])
def test_the_half_vectors_of_a_circle_inside_the_sphere_are_not_trusted(
    simulated: Path, tmp_path: Path, radius: float
) -> None:
    given = load(simulated).objects[0].captures[0].spheres[0]
    work = make_context(simulated, tmp_path / "store", spheres=[{"x": given.x, "y": given.y, "radius": radius}])
    perform_all(work, "lights")
    is_inside = radius < 0.8 * given.radius
    assert (work.load("lights").read("half_vector_sd").min() > np.radians(4.0)) == is_inside


@pytest.mark.parametrize(("angle", "is_near", "is_told"), [(1.5, False, True), (1.5, True, False), (0.5, False, False)])
def test_spheres_that_disagree_are_told_unless_a_near_light_explains_it(
    angle: float, is_near: bool, is_told: bool
) -> None:
    lights = replace(LIGHTS, inter_sphere_angle=np.full(2, angle, np.float32))
    spheres = [Sphere(0.0, 0.0, 40.0), Sphere(200.0, 0.0, 40.0)]
    warnings = sphere_doubts(spheres, lights, is_near=is_near, is_given=True)
    assert ["disagree on the half vectors by 3.0 degrees" in warning.message for warning in warnings] == [
        True
    ] * is_told


@pytest.mark.parametrize(("radius", "score", "error_deg"), [(17.0, 0.3, 14.1), (17.0, 1.0, 0.0), (40.0, 0.3, 0.0)])
def test_the_half_vectors_of_a_small_sphere_that_was_found_are_not_trusted(
    radius: float, score: float, error_deg: float
) -> None:
    error = circles_error([Sphere(0.0, 0.0, radius, score)], LIGHTS, is_near=False)
    assert np.degrees(error) == pytest.approx(error_deg, abs=0.1)


@pytest.mark.parametrize(
    ("angle", "is_near", "error_deg"), [(1.5, False, 1.06), (1.5, True, 0.0), (0.5, False, 0.0), (np.nan, False, 0.0)]
)
def test_spheres_that_disagree_are_trusted_less_by_what_they_disagree(
    angle: float, is_near: bool, error_deg: float
) -> None:
    spheres = [Sphere(0.0, 0.0, 40.0), Sphere(200.0, 0.0, 40.0)]
    lights = replace(LIGHTS, inter_sphere_angle=np.full(2, angle, np.float32))
    assert np.degrees(circles_error(spheres, lights, is_near=is_near)) == pytest.approx(error_deg, abs=0.01)


@pytest.mark.parametrize("is_near", [False, True])
def test_a_sphere_that_the_others_outvote_is_named(is_near: bool) -> None:
    spheres = [Sphere(x, 5.0, 40.0) for x in (0.0, 200.0, 400.0)]
    turned = replace(LIGHTS, half_vectors=np.array([[0.0, 0.28, 0.96], [0.6, 0.28, 0.75]], np.float32))
    by_sphere = [LIGHTS, turned, LIGHTS]
    merged = merge_spheres(by_sphere, spheres)
    warnings = sphere_doubts(spheres, merged, is_near=is_near, is_given=True, by_sphere=by_sphere)
    assert ["the sphere at (200.0, 5.0) is left out" in warning.message for warning in warnings] == [True] * (
        not is_near
    )


@pytest.mark.parametrize(("deviation", "is_told"), [(0.3, True), (0.45, False)])
def test_spheres_may_disagree_by_what_their_contours_leave_open(deviation: float, is_told: bool) -> None:
    lights = replace(LIGHTS, inter_sphere_angle=np.full(2, 1.5, np.float32))
    spheres = [Sphere(x, 0.0, 40.0, 1.0, deviation, deviation) for x in (0.0, 200.0)]
    assert bool(sphere_doubts(spheres, lights, is_near=False, is_given=True)) == is_told


def test_the_error_grows_towards_the_rim_and_falls_with_a_second_sphere() -> None:
    sphere = Sphere(0.0, 0.0, 50.0, 0.3, 0.5, 0.5)
    single, pair = (spheres_error([sphere] * count, HALF_VECTORS[:, 2]) for count in (1, 2))
    assert single[0] == pytest.approx(0.01) and single[1] > 1.1 * single[0]
    assert pair == pytest.approx(single / np.sqrt(2.0))
    assert sweep_error([], LIGHTS) == 0.0
