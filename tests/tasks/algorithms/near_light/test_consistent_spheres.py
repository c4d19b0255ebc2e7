from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.perspective import Cone, view_vectors
from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.near_light.consistent_spheres import consistent_spheres
from tests.tasks.algorithms.lighting.chrome_sphere import light_direction

SHAPE, COUNT = (120, 500), 32
LEFT, RIGHT = Sphere(60.4, 61.2, 40.0), Sphere(440.7, 58.9, 40.0)
CAMERA = np.array([[500.0, 0.0, 250.0], [0.0, 500.0, 60.0], [0.0, 0.0, 1.0]])


def swept(distance: float = np.inf, camera: np.ndarray | None = None) -> np.ndarray:
    """Draw frames (T, H, W) uint8 of both spheres under a light that moves over the hemisphere.

    distance: of the light from the frame's middle, in pixels.
    """
    frames = np.full((COUNT, *SHAPE), 60, np.uint8)
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    for sphere in (LEFT, RIGHT):
        if camera is None:
            nx, ny = (columns - sphere.x) / sphere.radius, (sphere.y - rows) / sphere.radius
            on_sphere = np.hypot(nx, ny) < 1.0
            normals = np.stack([nx, ny, np.sqrt(np.maximum(1.0 - nx**2 - ny**2, 0.0))], axis=-1)
            view = np.broadcast_to([0.0, 0.0, 1.0], normals.shape)
        else:
            view = view_vectors(camera, SHAPE, 0, 0)
            cone = Cone.from_ellipse(sphere.x, sphere.y, sphere.radius, camera)
            normals, on_sphere = cone.normals(view), cone.sines(view) < 1.0
        reflected = 2.0 * (normals * view).sum(axis=-1, keepdims=True) * normals - view
        places = sphere.radius * normals + [sphere.x - SHAPE[1] / 2, SHAPE[0] / 2 - sphere.y, 0.0]
        for number, frame in enumerate(frames):
            direction = light_direction(137.5 * number, 60.0 * np.sqrt((number + 0.5) / COUNT))
            lit = (reflected * unit(direction - places / distance)).sum(axis=-1) > np.cos(np.radians(8.0))
            frame[on_sphere] = np.where(lit, 255, 25)[on_sphere]
    return frames


def test_spheres_on_both_sides_of_a_near_camera_agree_under_its_matrix() -> None:
    assert consistent_spheres(swept(camera=CAMERA), [LEFT, RIGHT], CAMERA) == ([LEFT, RIGHT], [])


@pytest.mark.parametrize("distance", [np.inf, 5.0 * SHAPE[1], 2.0 * SHAPE[1]])
def test_spheres_agree_whatever_the_distance_of_the_light(distance: float) -> None:
    assert consistent_spheres(swept(distance), [LEFT, RIGHT]) == ([LEFT, RIGHT], [])


@pytest.mark.parametrize(
    ("right", "down", "ratio"), [(-10.0, 0.0, 1.0), (0.0, 10.0, 1.0), (0.0, 0.0, 1.6), (14.0, 0.0, 1.0)]
)
def test_a_misplaced_circle_contradicts_the_other_whatever_the_distance_of_the_light(
    right: float, down: float, ratio: float
) -> None:
    wrong = replace(RIGHT, x=RIGHT.x + right, y=RIGHT.y + down, radius=ratio * RIGHT.radius)
    for distance in (np.inf, 4.0 * SHAPE[1]):
        kept, (contradicted,) = consistent_spheres(swept(distance), [LEFT, wrong])
        assert kept == [LEFT]
        assert (contradicted.sphere, contradicted.reference) == (wrong, LEFT)
        assert contradicted.angle_deg > 6.0 and not contradicted.is_outvoted
        assert f"({wrong.x:.0f}, {wrong.y:.0f}) is left out" in str(contradicted)


def test_two_spheres_outvote_a_third_whatever_their_order() -> None:
    wrong = replace(RIGHT, y=RIGHT.y + 10.0)
    kept, (contradicted,) = consistent_spheres(swept(), [wrong, LEFT, RIGHT])
    assert kept == [LEFT, RIGHT]
    assert contradicted.sphere == wrong and contradicted.is_outvoted


def test_one_sphere_or_few_frames_contradict_nothing() -> None:
    wrong = replace(RIGHT, y=RIGHT.y + 10.0)
    assert consistent_spheres(swept(), [wrong]) == ([wrong], [])
    assert consistent_spheres(swept()[:3], [LEFT, wrong]) == ([LEFT, wrong], [])
