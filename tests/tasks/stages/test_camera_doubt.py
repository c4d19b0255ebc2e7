"""Doubt of the camera by what is known of it, where the object's normals say nothing."""

import numpy as np
import pytest

from glint.storage.catalogue.loading import Region
from glint.tasks.algorithms.lighting.lights import Lights
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.near_light.focal_length_of_normals import InverseFocal
from glint.tasks.algorithms.near_light.positions import NearLight
from glint.tasks.stages import camera_doubt
from glint.tasks.stages.camera_doubt import (
    LEAST_FOCAL_WIDTHS,
    MAX_CENTRE_OFFSET,
    doubt_camera,
    doubt_given_camera,
    with_camera_of_spheres,
)
from glint.tasks.stages.capture_geometry import CaptureGeometry
from glint.tasks.stages.light_distance import DistanceResult

WIDTH, HEIGHT = 1001, 751
UNKNOWN = np.full((300, 400, 3), np.nan)


def geometry(focal: float | None = None, x: float = 500.0, y: float = 375.0) -> CaptureGeometry:
    """Return the geometry of a capture with a sphere at the left; focal, x, y: of its camera, None: not given."""
    camera = None if focal is None else np.array([[focal, 0.0, x], [0.0, focal, y], [0.0, 0.0, 1.0]])
    sphere = Sphere(120.0, 400.0, 40.0)
    return CaptureGeometry(
        (WIDTH, HEIGHT), Region(x=300, y=200, width=400, height=300), (sphere,), camera, None, "pixels"
    )


def test_a_camera_beside_a_single_sphere_may_be_as_near_as_the_light() -> None:
    vectors = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (4, 1))
    lights = Lights(vectors, vectors, np.zeros(4, np.uint8), np.ones(4, np.float32), np.full(4, np.nan, np.float32))
    least = LEAST_FOCAL_WIDTHS * WIDTH
    for distance, focal, is_near in (
        (None, least, False),
        (0.5 * least, 0.5 * least, True),
        (2.0 * least, least, True),
    ):
        near = None if distance is None else NearLight(500.0, 375.0, vectors, np.full(4, 1.0 / distance))
        measured = DistanceResult(lights, near, None, [], [])
        result, record = with_camera_of_spheres(geometry(), [lights], measured)
        assert result is measured and record is not None
        assert record["least_focal"] == pytest.approx(focal) and record["is_light_near"] == is_near
        assert with_camera_of_spheres(geometry(2000.0), [lights], measured) == (measured, None)


@pytest.mark.parametrize("is_light_near", [False, True])
def test_a_camera_that_nothing_excludes_as_near_is_doubted_by_its_least_focal_length(is_light_near: bool) -> None:
    costs = []
    for focal in (700.0, 1400.0):
        doubt = doubt_camera(geometry(), {"least_focal": focal, "is_light_near": is_light_near}, UNKNOWN, 0.0)
        (warning,) = doubt.warnings
        assert f"some {focal:.0f} pixels" in warning.message and warning.cause == "camera"
        assert warning.message.startswith("the light was near") == is_light_near
        assert warning.cost_deg == pytest.approx(np.degrees(np.sqrt(2.0) * np.median(doubt.half_vector_sd)))
        costs.append(warning.cost_deg)
    assert costs[0] == pytest.approx(2.0 * costs[1], rel=0.1)


def test_a_long_lens_costs_little_and_is_not_reported() -> None:
    record = {"least_focal": 4.0 * LEAST_FOCAL_WIDTHS * WIDTH, "is_light_near": False}
    doubt = doubt_camera(geometry(), record, UNKNOWN, 0.0)
    assert not doubt.warnings and 0.0 < doubt.half_vector_sd.max() < np.radians(2.5)


def test_a_principal_point_far_beside_the_middle_is_doubted_and_a_near_one_is_not() -> None:
    limit = MAX_CENTRE_OFFSET * WIDTH
    near = doubt_given_camera(geometry(2000.0, 500.0 + limit - 1.0), UNKNOWN, 0.0)
    assert not near.warnings and not near.half_vector_sd.any()
    for x, y in ((500.0 + limit + 1.0, 375.0), (500.0, 375.0 - limit - 1.0)):
        doubt = doubt_given_camera(geometry(2000.0, x, y), UNKNOWN, 0.0)
        (warning,) = doubt.warnings
        assert "151 pixels beside the middle" in warning.message and "in a picture of" not in warning.message
        turn = np.arctan((limit + 1.0) / 2000.0)
        assert warning.cost_deg == pytest.approx(np.degrees(turn))
        assert doubt.half_vector_sd == pytest.approx(turn / np.sqrt(2.0))


def test_the_middle_of_a_picture_of_another_resolution_is_recognized() -> None:
    (warning,) = doubt_given_camera(geometry(2000.0, 250.0, 187.5), UNKNOWN, 0.0).warnings
    assert "or in a picture of 501 x 376 pixels (times 1.998)" in warning.message


@pytest.mark.parametrize(("spheres_sd", "is_seen"), [(0.0, True), (0.07, True), (0.11, False)])
def test_normals_show_a_near_camera_if_no_misplaced_sphere_explains_them(
    monkeypatch: pytest.MonkeyPatch, spheres_sd: float, is_seen: bool
) -> None:
    monkeypatch.setattr(camera_doubt, "focal_length_of_normals", lambda normals, camera: InverseFocal(1 / 800, 1e-5))
    doubt = doubt_camera(geometry(), {"least_focal": 700.0, "is_light_near": False}, UNKNOWN, spheres_sd)
    (warning,) = doubt.warnings
    assert warning.message.startswith("only under a near camera") == is_seen
    assert ("[[800, 0, 500], [0, 800, 375], [0, 0, 1]]" in warning.message) == is_seen


def test_an_inverse_focal_length_that_no_camera_has_is_an_error_of_its_own_size(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    deviations = []
    for value in (0.0, -1.0 / 700.0):
        estimate = InverseFocal(value, 1e-5)
        monkeypatch.setattr(camera_doubt, "focal_length_of_normals", lambda normals, camera, it=estimate: it)
        doubt = doubt_camera(geometry(), {"least_focal": 700.0, "is_light_near": False}, UNKNOWN, 0.0)
        deviations.append(float(np.median(doubt.half_vector_sd)))
    assert deviations[1] > 2.0 * deviations[0] > 0.0
