"""Initial normals of silhouettes whose surfaces are known."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.evaluation.metrics import normal_errors
from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.prior.silhouette import initial_normals
from tests.pictures import read_picture


def disc(size: int, radius: float, hole: float = 0.0) -> np.ndarray:
    rows, columns = np.mgrid[:size, :size] - (size - 1) / 2
    distance = np.hypot(rows, columns)
    return (distance < radius) & (distance >= hole)


def test_a_circle_is_inflated_to_a_sphere() -> None:
    mask = disc(81, 36.0)
    rows, columns = np.mgrid[:81, :81] - 40.0
    flat = np.stack([columns, -rows], axis=-1) / 36.0
    height = np.sqrt(np.maximum(1 - (flat**2).sum(axis=-1, keepdims=True), 0))
    found = initial_normals(mask)
    inner = disc(81, 30.0)
    assert angles(found.normals, np.concatenate([flat, height], axis=-1))[inner].mean() < 3.0
    assert (found.normals[found.contour][:, 2] < 0.35).all()
    assert np.isnan(found.normals[~mask]).all()


def test_normals_at_a_hole_point_into_it() -> None:
    found = initial_normals(disc(101, 46.0, 20.0))
    rows, columns = np.mgrid[:101, :101] - 50.0
    outward = unit(np.stack([columns, -rows], axis=-1))
    inner = found.contour & (np.hypot(rows, columns) < 30)
    assert inner.any()
    assert ((found.normals[..., :2] * outward).sum(axis=-1)[inner] < -0.8).all()


def test_components_do_not_influence_one_another() -> None:
    component = disc(41, 17.0)
    normals = initial_normals(np.hstack([component, component])).normals
    np.testing.assert_allclose(normals[:, :41], normals[:, 41:], atol=2e-2)


def test_marks_are_hard_constraints() -> None:
    mask, marked = disc(61, 27.0), unit(np.array([0.4, -0.2, 1.0]))
    marks = Marks(np.array([[30, 30], [0, 0]]), np.stack([marked, marked]), np.array([1, 1]))
    assert angles(initial_normals(mask, marks=marks).normals[30, 30], marked) < 0.5


def test_an_empty_mask_is_refused() -> None:
    with pytest.raises(ValueError, match="empty"):
        initial_normals(np.zeros((5, 5), bool))


def test_a_mask_that_fills_the_region_has_no_contour_and_faces_the_camera() -> None:
    found = initial_normals(np.ones((20, 30), bool))
    assert not found.contour.any()
    np.testing.assert_allclose(found.normals, np.broadcast_to((0.0, 0.0, 1.0), (20, 30, 3)), atol=1e-6)


def test_false_marks_are_no_constraints() -> None:
    mask, marked = disc(61, 27.0), unit(np.array([0.4, -0.2, 1.0]))
    false = Marks(np.array([[30, 30]]), marked[None], np.array([0]))
    np.testing.assert_array_equal(initial_normals(mask, marks=false).normals, initial_normals(mask).normals)


@pytest.mark.shared
@pytest.mark.parametrize(("name", "whole"), [("hemisphere", 0.019), ("cylinder", 0.125), ("duck", 0.117)])
def test_silhouettes_alone_are_as_good_as_plain_inflation(shared_data: Path, name: str, whole: float) -> None:
    folder = shared_data / "captures" / name / "front"
    mask = read_picture(folder / "mask.png", cv2.IMREAD_GRAYSCALE) > 0
    error = normal_errors(initial_normals(mask).normals, np.load(folder / "truth" / "normals.npy"), mask)
    assert error.squared < 1.15 * whole and error.missing == 0


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 2)])
def test_a_mask_that_fills_a_region_of_few_pixels_has_no_contour_and_faces_the_camera(shape: tuple[int, int]) -> None:
    found = initial_normals(np.ones(shape, bool))
    assert not found.contour.any()
    np.testing.assert_allclose(found.normals, np.broadcast_to([0.0, 0.0, 1.0], (*shape, 3)), atol=1e-6)
