"""Faceted bodies that are hollow: what is seen through the opening at their end, or that there is none."""

import numpy as np
import pytest

from glint.tasks.algorithms.facets.faceted_normals import FacetSearch
from glint.tasks.algorithms.geometry.vectors import angles, to_camera
from tests.tasks.algorithms.prisms.block import SHAPE, Block, shown

TUMBLER = Block(slope=30.0, lean=-5.0, half_height=50.0, turns=(12.0, 57.0, 102.0, 147.0, 192.0, 237.0, 282.0, 327.0))
WALL_RADIUS = 47.0


def render_tumbler() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return normals (H, W, 3) and z (H, W) of a tumbler with a round hollow, and where its far wall is seen."""
    normals, depths, _ = TUMBLER.render()
    rows, columns = np.indices(SHAPE).astype(float)
    x, y = to_camera(columns, rows, SHAPE[1], SHAPE[0])
    c, s = np.cos(np.radians(TUMBLER.slope)), np.sin(np.radians(TUMBLER.slope))
    # Where rays cross the plane of the upper end, towards the camera from the axis.
    forward = c * (TUMBLER.half_height - c * y) / s - s * y
    is_far = np.isfinite(depths) & (np.hypot(x, forward) < WALL_RADIUS)
    far = -np.sqrt(np.maximum(WALL_RADIUS**2 - x**2, 0.0))
    inward = -np.stack([x, -s * far, c * far], axis=-1) / WALL_RADIUS
    return np.where(is_far[..., None], inward, normals), np.where(is_far, (far + s * y) / c, depths), is_far


@pytest.fixture(scope="module")
def tumbler() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return render_tumbler()


def test_the_far_wall_is_seen_through_the_opening(tumbler: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    truth, depths, is_far = tumbler
    mask = np.isfinite(depths)
    best, *_ = FacetSearch(shown(truth), mask, None).likeliest
    error = angles(best.normals, truth)
    assert error[mask].mean() < 6.0
    assert np.median(error[is_far]) < 6.0
    assert (best.faces[is_far] == -1).mean() > 0.8
    difference = (best.depths - depths)[mask]
    assert np.nanmedian(np.abs(difference - np.nanmedian(difference))) < 2.0


def test_a_closed_end_stays_closed() -> None:
    truth, depths, _ = TUMBLER.render()
    mask = np.isfinite(depths)
    best, *_ = FacetSearch(shown(truth), mask, None).likeliest
    assert angles(best.normals, truth)[mask].mean() < 5.0
    assert (best.faces[mask] >= 0).mean() > 0.95
