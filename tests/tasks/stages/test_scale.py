"""Scale of a capture: from the circle that is used, and warnings where what gives it contradicts itself."""

from pathlib import Path

import numpy as np
import pytest

from glint.storage.catalogue import models
from glint.storage.catalogue.loading import load
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.stages.scale import scale_of
from tests.tasks.make_context import make_context, perform_all


def spheres(*pairs: tuple[float, float]) -> tuple[list[models.Sphere], list[Sphere]]:
    """Return spheres, given and measured, of these radii in pixels and diameters in millimetres."""
    given = [models.Sphere(x=50.0, y=50.0, radius=radius, diameter_mm=diameter) for radius, diameter in pairs]
    return given, [Sphere(50.0, 50.0, radius) for radius, _ in pairs]


def test_the_circle_that_is_used_gives_the_scale(simulated: Path, tmp_path: Path) -> None:
    (sphere,) = load(simulated).objects[0].captures[0].spheres
    given = sphere.model_dump() | {"radius": 1.25 * sphere.radius}
    work = make_context(simulated, tmp_path / "store", spheres=[given])
    (record,) = perform_all(work, "survey")
    assert sphere.diameter_mm is not None and any("correct `spheres`" in str(warning) for warning in record.warnings)
    expected = sphere.diameter_mm / (2.0 * sphere.radius)
    assert work.load("survey").record["pixel_size"] == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize(
    ("measured", "radius_sd", "is_used"), [(19.52, 0.22, False), (18.0, 0.22, True), (18.0, 1.2, False)]
)
def test_a_given_radius_holds_unless_the_measured_one_differs_by_more_than_it_is_uncertain(
    measured: float, radius_sd: float, is_used: bool
) -> None:
    given, _ = spheres((20.0, 25.0))
    scale = scale_of(None, given, [Sphere(50.6, 50.7, measured, 0.25, 0.43, radius_sd)], None)
    assert scale.pixel_size == pytest.approx(25.0 / (2.0 * (measured if is_used else 20.0)))


def test_under_perspective_the_scale_is_that_of_the_plane_through_the_spheres_centre() -> None:
    focal, centre, radius_mm = 800.0, np.array([350.0, -220.0, 1000.0]), 12.5
    camera = np.array([[focal, 0.0, 500.0], [0.0, focal, 300.0], [0.0, 0.0, 1.0]])
    # The contour: rays at the sphere's angular radius about its centre.
    axis, sine = centre / np.linalg.norm(centre), radius_mm / np.linalg.norm(centre)
    across = np.cross(axis, [0.0, 1.0, 0.0]) / np.linalg.norm(np.cross(axis, [0.0, 1.0, 0.0]))
    turns = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)[:, None]
    rays = np.sqrt(1.0 - sine**2) * axis + sine * (np.cos(turns) * across + np.sin(turns) * np.cross(axis, across))
    x, y = (focal * rays[:, :2] / rays[:, 2:] + camera[:2, 2]).T
    area = 0.5 * abs(float(x @ np.roll(y, 1) - y @ np.roll(x, 1)))
    seen = Sphere(float(x.mean()), float(y.mean()), float(np.sqrt(area / np.pi)))
    given = models.Sphere(x=seen.x, y=seen.y, radius=seen.radius, diameter_mm=2.0 * radius_mm)
    assert scale_of(None, [given], [seen], camera).pixel_size == pytest.approx(centre[2] / focal, rel=1e-3)


def test_scales_that_agree_are_averaged_without_a_warning() -> None:
    scale = scale_of(None, *spheres((30.0, 25.0), (20.0, 17.0)), None)
    assert scale.pixel_size == pytest.approx((25 / 60 + 17 / 40) / 2) and not scale.warnings
    assert scale_of(0.42, *spheres((30.0, 25.0)), None).warnings == []
    assert scale_of(None, *spheres(), None).unit == "pixels"


@pytest.mark.parametrize(
    ("pixel_size", "pairs", "text"),
    [
        (None, [(30.0, 25.0), (30.0, 12.5)], "the spheres contradict each other: 0.417 and 0.208 mm per pixel"),
        (1.7, [(30.0, 25.0)], "`pixel_size` 1.7 contradicts the sphere's 0.417 mm per pixel"),
        (None, [(30.0, 2.5)], "`diameter_mm` 2.5 is that of a grain: give it in millimetres"),
        (None, [(30.0, 0.025)], "`diameter_mm` 0.025 is that of a grain: give it in millimetres"),
        (None, [(30.0, 2500.0)], "`diameter_mm` 2500 is more than any chrome sphere has"),
        (None, [(3.0, 400.0)], "`diameter_mm` 400 makes the object 16 m large"),
        (33.3, [(3.0, 200.0)], "`pixel_size` 33.3 makes the object 7.99 m large"),
    ],
)
def test_scales_that_contradict_are_told(pixel_size: float | None, pairs: list[tuple[float, float]], text: str) -> None:
    (warning,) = scale_of(pixel_size, *spheres(*pairs), None, 240.0).warnings
    assert text in warning.message and warning.cause == "scale" and warning.cost_deg == 0.0


@pytest.mark.parametrize(
    ("pixel_size", "text"),
    [
        (
            0.00033,
            "the object 79.2 micrometres large: give the millimetres that one pixel covers; if metres were meant",
        ),
        (0.00033, "it is 0.33"),
        (330.0, "the object 79.2 m large: give the millimetres that one pixel covers; if micrometres were meant"),
        (330.0, "it is 0.33"),
        (1.25e4, "the object 3 km large: give the millimetres that one pixel covers"),
        (1.25e-5, "the object 3 micrometres large: give the millimetres that one pixel covers"),
        (0.05, "the chrome sphere 3 mm in diameter: give the millimetres that one pixel covers"),
    ],
)
def test_a_scale_that_makes_things_of_impossible_size_is_told(pixel_size: float, text: str) -> None:
    """Nobody gave the sphere's diameter, but it is known to be that of a chrome sphere."""
    (warning,) = scale_of(pixel_size, [], [Sphere(50.0, 50.0, 30.0)], None, 240.0).warnings
    assert f"`pixel_size` {pixel_size:.3g} makes " in warning.message and text in warning.message
    assert not warning.message.endswith("covers") or pixel_size in (1.25e4, 1.25e-5, 0.05)


@pytest.mark.parametrize(
    ("pixel_size", "extent", "radius"), [(0.02, 240.0, 110.0), (8.0, 370.0, 4.0), (0.33, 240.0, 38.0)]
)
def test_beads_and_windows_have_a_possible_size(pixel_size: float, extent: float, radius: float) -> None:
    for camera in (None, np.array([[5e3, 0.0, 500.0], [0.0, 5e3, 300.0], [0.0, 0.0, 1.0]])):
        assert not scale_of(pixel_size, [], [Sphere(500.0, 300.0, radius)], camera, extent).warnings
    assert not scale_of(pixel_size, [], [], None, extent).warnings, "lights may be known"


@pytest.mark.parametrize(
    ("length_mm", "is_told", "is_metres"),
    [
        (0.0095, True, False),
        (0.0105, True, True),
        (0.99, True, True),
        (1.01, True, False),
        (2.9, True, False),
        (3.1, False, False),
        (2990.0, False, False),
        (3010.0, True, False),
    ],
)
def test_metres_were_meant_where_they_lead_to_a_usual_size(length_mm: float, is_told: bool, is_metres: bool) -> None:
    warnings = scale_of(length_mm / 200.0, (), (), None, 200.0).warnings
    assert len(warnings) == is_told
    assert any("if metres were meant" in str(warning) for warning in warnings) == is_metres


@pytest.mark.parametrize(("diameter_mm", "is_told"), [(3.9, True), (4.1, False), (499.0, False), (501.0, True)])
def test_diameters_that_no_chrome_sphere_has_are_told(diameter_mm: float, is_told: bool) -> None:
    given = models.Sphere(x=50.0, y=50.0, radius=20.0, diameter_mm=diameter_mm)
    warnings = scale_of(None, [given], [Sphere(50.0, 50.0, 20.0)], None).warnings
    assert any(f"`diameter_mm` {diameter_mm:g} is" in str(warning) for warning in warnings) == is_told
