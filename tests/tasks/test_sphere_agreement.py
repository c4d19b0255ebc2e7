"""Spheres of an object's captures: the odd one is named, a missing one offered, a moved camera is no contradiction."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.sphere_agreement import CaptureSpheres, deviating_spheres, sphere_offer, sphere_warnings
from tests.tasks.make_context import make_context

SIZE = 640, 480
CIRCLE = Sphere(500.0, 240.0, 40.0)


def views(*spheres: Sphere) -> dict[str, CaptureSpheres]:
    return {f"view-{number}": CaptureSpheres(SIZE, [sphere]) for number, sphere in enumerate(spheres)}


def test_the_view_that_fits_the_sphere_elsewhere_is_named() -> None:
    good = [Sphere(500.0 + 0.1 * number, 240.0, 40.0 - 0.1 * number) for number in range(5)]
    found = deviating_spheres(views(*good, Sphere(500.0, 241.0, 34.8)))
    assert list(found) == ["view-5"]
    assert found["view-5"][0].cause == "sphere" and found["view-5"][0].cost_deg == pytest.approx(7.2, abs=0.5)
    assert "in 5 captures of the object" in found["view-5"][0].message
    assert "y: 240.0, radius: 39.8}]`" in found["view-5"][0].message


def test_views_of_a_camera_that_was_moved_are_not_compared() -> None:
    moved = [Sphere(500.0 + 5.0 * number, 240.0, 40.0) for number in range(6)]
    assert deviating_spheres(views(*moved)) == {}


def test_few_views_and_other_cameras_show_nothing() -> None:
    odd = Sphere(500.0, 241.0, 36.0)
    assert deviating_spheres(views(CIRCLE, CIRCLE, odd)) == {}
    captures = views(CIRCLE, CIRCLE, CIRCLE, CIRCLE) | {"other": CaptureSpheres((1920, 1080), [odd])}
    assert deviating_spheres(captures) == {}


def test_a_sphere_that_is_hardly_known_is_offered_the_circle_of_the_others() -> None:
    known, weak = replace(CIRCLE, centre_sd=0.2), replace(CIRCLE, x=500.6, centre_sd=1.0)
    warnings = sphere_warnings(views(known, weak, known))
    assert list(warnings) == ["view-1"]
    assert "known to 2.5% of its radius only" in warnings["view-1"][0].message
    assert "`spheres: [{x: 500.0, y: 240.0, radius: 40.0}]`" in warnings["view-1"][0].message
    assert sphere_warnings(views(known, weak)) == {}, "one sibling proves no rig"
    assert sphere_warnings(views(known, weak, replace(known, x=520.0))) == {}, "the camera was moved"


def test_a_capture_without_a_sphere_is_offered_those_of_its_siblings(tmp_path: Path, simulated: Path) -> None:
    cv2.imwrite(str(tmp_path / "0.png"), np.zeros((SIZE[1], SIZE[0]), np.uint8))
    cv2.imwrite(str(tmp_path / "1.png"), np.zeros((SIZE[1], SIZE[0]), np.uint8))
    refused = make_context(simulated, tmp_path / "store", frames=str(tmp_path / "*.png"), spheres=[])
    second = Sphere(100.0, 300.0, 30.0)
    pair = {name: CaptureSpheres(SIZE, [CIRCLE, second]) for name in ("a", "b")}
    offer = sphere_offer(refused, pair)
    assert "`spheres: [{x: 500.0, y: 240.0, radius: 40.0}, {x: 100.0, y: 300.0, radius: 30.0}]`" in offer
    assert sphere_offer(refused, views(CIRCLE)) == ""
    assert sphere_offer(refused, {name: CaptureSpheres((1920, 1080), [CIRCLE]) for name in ("a", "b")}) == ""
