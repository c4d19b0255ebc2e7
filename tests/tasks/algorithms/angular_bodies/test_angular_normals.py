"""Normals of square vessels that candidates show: closed, open, and with a neck."""

import numpy as np
import pytest

from glint.tasks.algorithms.angular_bodies.angular_normals import AngularVesselSearch, vessel_normals
from glint.tasks.algorithms.geometry.perspective import rotate_to_view, view_vectors
from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from glint.tasks.algorithms.sections.rounded_polygon import RoundedPolygon
from glint.tasks.algorithms.silhouettes.reflection_axes import ReflectionAxis
from tests.tasks.algorithms.angular_bodies.square_vessel import CAMERA, INVERSE_FOCAL, SHAPE, SquareVessel
from tests.tasks.algorithms.prisms.block import shown
from tests.tasks.algorithms.revolution.beaker import camera_positions, tumbler

UPRIGHT = ReflectionAxis(np.zeros(2), np.array([1.0, 0.0]), 1.0)


def body_of(vessel: SquareVessel, mask: np.ndarray) -> SurfaceOfRevolution:
    """The vessel's own body, as though it had been found."""
    width, rounding = vessel.half_depth / vessel.half_width, vessel.corner / vessel.half_width
    section = RoundedPolygon(4, float(np.radians(vessel.turn)), rounding, width)
    return SurfaceOfRevolution.from_silhouette(
        mask, UPRIGHT, float(np.radians(vessel.tilt)), inverse_focal=vessel.inverse_focal, section=section
    )


def errors(vessel: SquareVessel) -> np.ndarray:
    """Degrees (N,) from the normals of the vessel's pixels to those of its own body, candidates given."""
    truth = vessel.render()
    mask = np.isfinite(truth[..., 0])
    rays = view_vectors(CAMERA, SHAPE, 0.0, 0.0) if vessel.inverse_focal else None
    relative = rotate_to_view(truth, rays)
    result = vessel_normals(body_of(vessel, mask), mask, rotate_to_view(shown(truth), rays))
    assert result is not None
    assert result.tangents is None
    return angles(result.normals, relative)[mask]


@pytest.mark.parametrize("inverse_focal", [0.0, INVERSE_FOCAL])
@pytest.mark.parametrize("half_depth", [36.0, 26.0])
def test_a_body_has_the_normals_of_its_vessel(half_depth: float, inverse_focal: float) -> None:
    error = errors(SquareVessel(half_depth=half_depth, taper=3.0, inverse_focal=inverse_focal))
    assert np.median(error) < 0.5
    assert error.mean() < 3.0


@pytest.mark.parametrize("taper", [5.0, 0.0])
def test_through_an_opening_the_far_wall_is_seen(taper: float) -> None:
    vessel = SquareVessel(tilt=32.0, taper=taper, wall=5.0)
    error = errors(vessel)
    assert error.mean() < 6.0
    assert (error < 5.0).mean() > 0.85


@pytest.mark.parametrize(("beside_deg", "is_open"), [(0.0, True), (4.5, False)])
def test_an_end_is_open_if_the_far_wall_is_seen_in_its_place(beside_deg: float, is_open: bool) -> None:
    vessel = SquareVessel(tilt=32.0)
    truth, hollow = vessel.render(), SquareVessel(tilt=32.0, wall=1.0).render()
    mask, is_top = np.isfinite(truth[..., 0]), truth[..., 1] > 0.8
    # Through the top of a block of glass its far walls show the light as they do in an empty vessel, but beside.
    beside = unit(hollow + np.array([0.0, np.tan(np.radians(beside_deg)), 0.0]))
    candidates, far = shown(truth), shown(beside)
    assert np.isfinite(far[0, is_top, 0]).mean() > 0.3
    candidates[:, is_top] = far[:, is_top]
    result = vessel_normals(body_of(vessel, mask), mask, candidates)
    assert result is not None
    seen = hollow if is_open else truth
    assert np.nanmedian(angles(result.normals, seen)[is_top]) < 3.0


def test_a_neck_is_round() -> None:
    vessel = SquareVessel(tilt=15.0, half_height=40.0, neck=(14.0, 16.0))
    error = errors(vessel)
    assert error.mean() < 4.5
    without = SquareVessel(tilt=15.0, half_height=40.0).render()
    truth = vessel.render()
    is_neck = np.isnan(without[..., 0]) & np.isfinite(truth[..., 0])
    mask = np.isfinite(truth[..., 0])
    assert np.median(error[is_neck[mask]]) < 8.0


def test_a_square_vessel_is_found_in_a_view() -> None:
    truth = SquareVessel(tilt=30.0, taper=5.0, wall=5.0).render()
    mask = np.isfinite(truth[..., 0])
    vessel = AngularVesselSearch(shown(truth), mask, None).best
    assert vessel is not None
    error = angles(vessel.normals, truth)[mask]
    assert np.median(error) < 2.0
    assert error.mean() < 7.0
    # Their differences are those of the surface, seen from the front.
    assert np.isfinite(vessel.depths[mask]).mean() > 0.95


def test_a_round_vessel_is_no_square_one() -> None:
    x, y = camera_positions()
    normals = tumbler(25.0, 60.0, 38.0).normals(x.ravel(), y.ravel()).reshape(*x.shape, 3)
    mask = np.isfinite(normals[..., 0])
    assert AngularVesselSearch(shown(normals), mask, None).best is None


def test_without_candidates_there_is_no_vessel() -> None:
    mask = np.ones((30, 20), bool)
    assert AngularVesselSearch(np.full((1, 30, 20, 3), np.nan, np.float32), mask, None).best is None
