"""Distances of points to a silhouette agree with the field's samples where the points are seen."""

from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.multiview.silhouette_distance import silhouette_distance
from glint.tasks.algorithms.multiview.view import SilhouetteMask, View
from glint.tasks.algorithms.registration.turntable import Turntable
from tests.tasks.algorithms.multiview.figurine import FRAME, full_view

PINHOLE = np.array([[200.0, 3.0, 47.0], [0.0, 210.0, 44.0], [0.0, 0.0, 1.0]])


@pytest.fixture
def view() -> View:
    """A tilted view of an ellipse, in a region whose origin is not that of the frame."""
    rows, columns = np.mgrid[: FRAME[1], : FRAME[0]]
    mask = ((columns - 50) / 30) ** 2 + ((rows - 40) / 18) ** 2 < 1.0
    rotation, translation = Turntable(3.0, 10.0, 5.0, np.array([70.0])).pose(0)
    shown = replace(full_view("view"), silhouette=SilhouetteMask(mask), origin=(3, -2), pixel_size=1.3)
    return shown.with_pose(rotation, translation)


@pytest.mark.parametrize("matrix", [None, PINHOLE])
def test_distances_are_those_of_the_projections(view: View, matrix: np.ndarray | None) -> None:
    """Also far beyond the field, and behind the camera."""
    if matrix is not None:
        view = replace(view, matrix=matrix, pixel_size=1.0).with_pose(view.rotation, np.array([3.0, 1.0, -200.0]))
    points = np.random.default_rng(0).normal(0.0, 90.0, (50, 20, 3))
    flat = points.reshape(-1, 3)
    expected = view.silhouette.distance.at(*view.project(flat)) * view.footprint(flat)
    distances = silhouette_distance(view, points)
    assert distances.shape == points.shape[:-1] and (distances < 0.0).any()
    assert distances.ravel() == pytest.approx(expected, abs=1e-10)
