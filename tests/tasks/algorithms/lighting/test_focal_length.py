"""The elongation of a sphere's contour tells a near camera from a distant one."""

import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.lighting.focal_length import focal_length_of_ellipse, measure_elongation
from glint.tasks.algorithms.lighting.spheres import Sphere
from tests.tasks.algorithms.lighting.chrome_sphere import light_direction, sphere_frame

SPHERE = Sphere(80.0, 75.0, 50.0)
TO_THE_LEFT = (-220.0, 75.0)


def _frames(elongation: float) -> list[np.ndarray]:
    """Frames of a sphere that is stretched along x about its centre."""
    ratio = (1.0 + elongation) / (1.0 - elongation)
    matrix = np.array([[ratio, 0.0, SPHERE.x * (1.0 - ratio)], [0.0, 1.0, 0.0]])
    round_frames = [
        sphere_frame(SPHERE, [light_direction(azimuth, 40.0)], (150, 160), seed=azimuth)
        for azimuth in range(0, 360, 60)
    ]
    return [cv2.warpAffine(frame, matrix, frame.shape[::-1], borderMode=cv2.BORDER_REPLICATE) for frame in round_frames]


@pytest.mark.parametrize("elongation", [0.0, 0.03, 0.06])
def test_the_elongation_is_measured_within_its_deviation(elongation: float) -> None:
    measured = measure_elongation(_frames(elongation), SPHERE, TO_THE_LEFT)
    assert measured.deviation < 0.01
    assert abs(measured.value - elongation) < 2.0 * measured.deviation


def test_only_an_ellipse_towards_the_centre_speaks_for_a_near_camera() -> None:
    # tan 27 degrees: an elongation of 0.06.
    assert measure_elongation(_frames(0.06), SPHERE, TO_THE_LEFT).near_camera_nats(0.5) > 2.0
    assert measure_elongation(_frames(0.0), SPHERE, TO_THE_LEFT).near_camera_nats(0.5) < -2.0
    assert measure_elongation(_frames(0.06), SPHERE, (80.0, 400.0)).near_camera_nats(0.5) < -2.0


@pytest.mark.parametrize(("elongation", "expected"), [(0.0, None), (0.06, 0.98)])
def test_the_focal_length_is_that_of_the_elongation(elongation: float, expected: float | None) -> None:
    frames = _frames(elongation)
    measured = measure_elongation(frames, SPHERE, TO_THE_LEFT)
    levels = np.median(frames, axis=0), np.max(frames, axis=0)
    focal = focal_length_of_ellipse(*levels, measured, SPHERE, TO_THE_LEFT, 600.0)
    assert focal is None if expected is None else focal == pytest.approx(expected, rel=0.25)
