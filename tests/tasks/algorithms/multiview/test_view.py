"""A view's silhouette: its distance, computed once, and its pixels, also where the region crops the object."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.multiview.view import SilhouetteDistance, rotation_about_y
from tests.tasks.algorithms.multiview.figurine import full_view


def disc(radius: float, size: int = 64) -> np.ndarray:
    """A disc (size, size) bool in the middle."""
    rows, columns = np.indices((size, size)) - (size - 1) / 2
    return np.hypot(rows, columns) < radius


def test_the_distance_to_a_disc_is_that_to_its_circle() -> None:
    distance = SilhouetteDistance.from_mask(disc(20.0))
    columns = np.array([31.5 + 10.0, 31.5 + 20.0, 31.5 + 30.0, 31.5 + 50.0])
    measured = distance.at(columns, np.full(4, 31.5))
    assert np.abs(measured - [-10.0, 0.0, 10.0, 30.0]).max() < 0.4
    gradient = distance.gradient(columns[:2], np.full(2, 31.5))
    assert np.allclose(gradient, [[1.0, 0.0, 0.0]] * 2, atol=0.075)


def test_a_cropped_object_continues_outside_the_region() -> None:
    mask = disc(20.0)[:, :40]
    distance = SilhouetteDistance.from_mask(mask)
    assert distance.at(np.array([50.0]), np.array([31.5]))[0] < -5.0
    columns, _ = full_view("view").with_mask(mask).silhouette_pixels(40)
    assert mask[:, 39].sum() == 38 and (columns == 39).sum() == 2, "only where the silhouette meets the border"


def test_the_distance_is_computed_once() -> None:
    view = full_view("view").with_mask(disc(20.0, 96))
    posed = view.with_pose(rotation_about_y(30.0), np.zeros(3)).with_normals(view.normals, view.confidence)
    assert posed.silhouette.distance is view.silhouette.distance
    assert view.with_mask(disc(10.0, 96)).silhouette.distance is not view.silhouette.distance


def test_an_object_that_fills_its_region_has_no_silhouette() -> None:
    view = full_view("front-3")
    with pytest.raises(UnusableCapture, match="the mask of front-3 fills its region"):
        view.silhouette_pixels(40)
    with pytest.raises(UnusableCapture, match="the mask of front-3 is empty"):
        view.with_mask(np.zeros_like(view.mask)).silhouette_pixels(40)


SKEWED = np.array([[400.0, 12.0, 45.0], [0.0, 380.0, 50.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("matrix", [None, SKEWED])
def test_rays_lead_back_to_their_pixels_and_start_from_the_pose(matrix: np.ndarray | None) -> None:
    """From any pose, through a camera with skew too."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", [20.0, -35.0, 50.0], degrees=True).as_matrix()
    pose[:3, 3] = 30.0, -80.0, 400.0
    view = full_view("view", matrix).with_camera_to_world(pose)
    assert np.allclose(view.camera_to_world, pose)
    columns, rows = np.array([0.0, 20.0, 90.0]), np.array([3.0, 70.0, 11.0])
    starts, directions = view.rays(columns, rows)
    for distance in (200.0, 500.0):
        assert np.allclose(view.project(starts + distance * directions), [columns, rows])
    assert np.allclose(view.view_vectors(starts + 300.0 * directions), -directions)
    if matrix is None:
        assert np.allclose((starts - pose[:3, 3]) @ directions[0], 0.0)
    else:
        assert np.allclose(starts, pose[:3, 3])
    assert np.allclose(view.to_world(np.array([0.0, 0.0, 1.0])), pose[:3, 2])
