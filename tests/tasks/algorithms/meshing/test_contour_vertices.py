import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.integration.contour_margin import contour_of
from glint.tasks.algorithms.meshing.contour_vertices import boundary_vertices, moves_to_contour
from glint.tasks.algorithms.meshing.depth_mesh import Surface, mesh_from_depth


def sphere(radius: float, centre: tuple[float, float] = (0.3, -0.2)) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Height, mask and normals of a sphere; its outermost pixels have the normals of its contour."""
    size = int(radius) + 5
    y, x = np.mgrid[-size : size + 1, -size : size + 1].astype(float)
    x, y = x - centre[0], y - centre[1]
    mask = x**2 + y**2 <= radius**2
    height = np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0.0))
    normals = np.stack([x, -y, height], axis=-1) / radius
    return np.where(mask, height, np.nan), mask, np.where(mask[..., None], normals, np.nan)


def areas_in_view(mesh: Surface) -> np.ndarray:
    """Signed areas of a mesh's triangles as the camera sees them."""
    a, b, c = (mesh.vertices[mesh.triangles[:, corner], :2].astype(float) for corner in range(3))
    first, second = b - a, c - a
    return 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


@pytest.mark.parametrize("radius", [20.4, 60.7])
def test_a_sphere_ends_at_its_contour(radius: float) -> None:
    mesh = mesh_from_depth(*sphere(radius))
    boundary = mesh.vertices[boundary_vertices(mesh.triangles)]
    centre = np.array([0.3, 0.2])
    distance = np.hypot(*(boundary[:, :2] - centre).T)
    assert np.abs(distance.mean() - radius) < 0.15 and distance.std() < 0.12
    # It is at its contour that a sphere is as high as its centre.
    assert np.abs(np.median(boundary[:, 2])) < 0.1 * radius


@pytest.mark.parametrize("radius", [20.4, 60.7])
def test_no_triangle_is_turned_over_and_the_mesh_covers_the_disc(radius: float) -> None:
    areas = areas_in_view(mesh_from_depth(*sphere(radius)))
    assert areas.min() > 0.1 and areas.sum() == pytest.approx(np.pi * radius**2, rel=0.02)


def test_the_edge_of_the_array_is_no_contour_and_holes_of_a_pixel_stay() -> None:
    mask = np.ones((30, 30), bool)
    mask[15, 15] = False
    numbers = np.array([0, 29, 15 * 30 + 14, 14 * 30 + 15])
    assert np.abs(moves_to_contour(np.zeros((30, 30)), mask, contour_of(mask), numbers)).max() == 0.0


def test_a_flat_plate_ends_at_its_own_height() -> None:
    mask = np.zeros((40, 40), bool)
    mask[10:30, 10:30] = True
    vertices = np.array([20 * 40 + 10, 10 * 40 + 20])
    right, down, closer = moves_to_contour(np.full((40, 40), 7.0), mask, contour_of(mask), vertices)
    assert right[0] == pytest.approx(-0.5, abs=0.05) and down[1] == pytest.approx(-0.5, abs=0.05)
    assert np.abs(closer).max() < 1e-5


def test_a_corner_that_lies_outside_of_the_smooth_contour_stays() -> None:
    mask = np.zeros((40, 40), bool)
    mask[10:30, 10:30] = True
    contour = contour_of(mask)
    assert contour.distance[10, 10] < 0.0
    moves = moves_to_contour(np.full((40, 40), 7.0), mask, contour, np.array([10 * 40 + 10]))
    assert np.abs(moves).max() == 0.0


def test_no_triangle_is_turned_over_on_thin_and_ragged_parts() -> None:
    noise = cv2.GaussianBlur(np.random.default_rng(3).normal(size=(80, 80)), (0, 0), 2.0)
    mesh = mesh_from_depth(np.zeros((80, 80)), noise > 0.0, np.broadcast_to([0.0, 0.0, 1.0], (80, 80, 3)))
    assert areas_in_view(mesh).min() > 0.0
