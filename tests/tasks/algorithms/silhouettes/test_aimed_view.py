import numpy as np
import pytest

from glint.tasks.algorithms.geometry.perspective import CAMERA_FLIP, rotate_to_view, view_vectors
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.silhouettes.aimed_view import AimedView
from glint.tasks.algorithms.silhouettes.reflection_axes import reflection_axes
from tests.tasks.algorithms.revolution.cylinder import CAMERA, SHAPE, seen_cylinder

FOCAL, RADIUS = 380.0, 60.0
CENTRE = 400.0 * np.array([110.0, -40.0, -FOCAL]) / np.linalg.norm([110.0, 40.0, FOCAL])
"""Of the ball, camera frame: far beside the principal point."""


def ball(view: np.ndarray, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return normals (H, W, 3) relative to the rays, and lengths (H, W) of these, for view vectors (H, W, 3)."""
    along = -view @ centre
    root = along**2 - (centre @ centre - RADIUS**2)
    distance = np.where(root > 0.0, along - np.sqrt(np.maximum(root, 0.0)), np.nan)
    return rotate_to_view((-view * distance[..., None] - centre) / RADIUS, view), distance


def aimed_ball() -> tuple[AimedView, np.ndarray, np.ndarray]:
    """Return the aimed view of a ball, and its normals (H, W, 3) and distances (H, W) along the axis as filmed."""
    view = view_vectors(CAMERA, SHAPE, 0.0, 0.0)
    normals, distance = ball(view, CENTRE)
    return AimedView.at(np.isfinite(distance), CAMERA), normals, distance * view[..., 2]


def ball_as_aimed(aimed: AimedView) -> tuple[np.ndarray, np.ndarray]:
    """Return normals (H', W', 3) and z (H', W') in pixels as the aimed camera sees the ball, by formula."""
    height, width = aimed.silhouette.shape
    y, x = np.mgrid[:height, :width] - np.array([(height - 1) / 2, (width - 1) / 2])[:, None, None]
    ray = np.stack([x, -y, np.full(x.shape, -aimed.focal)], axis=-1)
    view = -ray / np.linalg.norm(ray, axis=-1, keepdims=True)
    normals, distance = ball(view, (aimed.rotation @ (CENTRE * CAMERA_FLIP)) * CAMERA_FLIP)
    # In units in which the ball is as far away as the focal length is long.
    return normals, aimed.focal * (1.0 - distance * view[..., 2] / np.linalg.norm(CENTRE))


def test_the_aimed_view_is_that_of_a_camera_that_looks_at_the_object() -> None:
    aimed, normals, _ = aimed_ball()
    silhouette, shown = aimed.silhouette, aimed.normals(normals)
    expected, _ = ball_as_aimed(aimed)
    rows, columns = np.nonzero(silhouette)
    assert rows.mean() == pytest.approx((silhouette.shape[0] - 1) / 2, abs=4)
    assert columns.mean() == pytest.approx((silhouette.shape[1] - 1) / 2, abs=4)
    assert (silhouette != np.isfinite(expected[..., 0])).sum() < 0.01 * silhouette.sum()
    assert silhouette.sum() == pytest.approx(np.isfinite(normals[..., 0]).sum(), rel=0.01)
    error = angles(shown, expected)[expected[..., 2] > 0.5]
    assert np.nanmean(error) < 0.5 and np.nanmax(error) < 1.5


def test_normals_come_back_as_they_were() -> None:
    aimed, normals, _ = aimed_ball()
    mask = np.isfinite(normals[..., 0])
    back = aimed.normals_back(aimed.normals(normals))
    assert np.array_equal(np.isfinite(back[..., 0]), mask)
    central = normals[..., 2] > 0.5
    assert np.mean(angles(back, normals)[central]) < 0.5


def test_depths_come_back_as_heights_in_the_camera_s_image() -> None:
    aimed, normals, distance = aimed_ball()
    mask = np.isfinite(distance)
    heights, expected = aimed.heights_back(ball_as_aimed(aimed)[1]), -FOCAL * np.log(distance)
    known = mask & np.isfinite(heights) & (normals[..., 2] > 0.3)
    assert known.sum() > 5000
    difference = (heights - expected)[known]
    assert np.abs(difference - difference.mean()).max() < 0.2


def test_a_solid_of_revolution_beside_the_principal_point_is_symmetric_in_the_aimed_view_alone() -> None:
    mask = np.isfinite(seen_cylinder(20.0, 12.0)[1])
    there, here = reflection_axes(AimedView.at(mask, CAMERA).silhouette), reflection_axes(mask)
    assert there and there[0].iou > 0.985
    assert not here or here[0].iou < there[0].iou - 0.005
