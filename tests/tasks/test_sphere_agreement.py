"""Spheres of a turntable's views: the odd one is named, a camera that moved is not."""

import pytest

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.sphere_agreement import CaptureSpheres, deviating_spheres

SIZE = 640, 480


def views(*spheres: Sphere) -> dict[str, CaptureSpheres]:
    return {f"view-{number}": CaptureSpheres(SIZE, [sphere]) for number, sphere in enumerate(spheres)}


def test_the_view_that_fits_the_sphere_elsewhere_is_named() -> None:
    good = [Sphere(500.0 + 0.1 * number, 240.0, 40.0 - 0.1 * number) for number in range(5)]
    found = deviating_spheres(views(*good, Sphere(500.0, 241.0, 34.8)))
    assert list(found) == ["view-5"]
    assert found["view-5"][0].cause == "sphere" and found["view-5"][0].cost_deg == pytest.approx(7.2, abs=0.5)
    assert "in 5 captures of the object" in found["view-5"][0].message


def test_views_of_a_camera_that_was_moved_are_not_compared() -> None:
    moved = [Sphere(500.0 + 5.0 * number, 240.0, 40.0) for number in range(6)]
    assert deviating_spheres(views(*moved)) == {}


def test_few_views_and_other_cameras_show_nothing() -> None:
    circle, odd = Sphere(500.0, 240.0, 40.0), Sphere(500.0, 241.0, 36.0)
    assert deviating_spheres(views(circle, circle, odd)) == {}
    captures = views(circle, circle, circle, circle) | {"other": CaptureSpheres((1920, 1080), [odd])}
    assert deviating_spheres(captures) == {}
