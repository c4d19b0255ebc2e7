"""Depth with a body that is known beforehand: a glass seen through its opening, and bodies that are wrong."""

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import to_camera
from glint.tasks.algorithms.integration.bilateral import integrate
from glint.tasks.algorithms.integration.edges import grid_edges
from glint.tasks.algorithms.integration.expected_rises import expected_rises
from glint.tasks.algorithms.integration.known_body import attached_height, beside_body, known_body
from glint.tasks.algorithms.integration.search_limits import SearchLimits
from glint.tasks.algorithms.revolution.opening import Opening
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from glint.tasks.algorithms.silhouettes.reflection_axes import ReflectionAxis
from tests.tasks.algorithms.revolution.beaker import tumbler

SHAPE = (150, 110)
LIP_PX = 1.5


def glass(tilt: float = 20.0) -> SurfaceOfRevolution:
    """Return a tumbler at a tilt in degrees."""
    return tumbler(tilt, 50.0, 36.0)


def seen(surface: SurfaceOfRevolution) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return normals (H, W, 3), depth (H, W) and which pixels (H, W) show the far wall of an open glass."""
    rows, columns = (index.ravel().astype(float) for index in np.indices(SHAPE))
    x, y = to_camera(columns, rows, SHAPE[1], SHAPE[0])
    opening = Opening(surface, LIP_PX, np.ones(SHAPE, bool))
    normals, depths, is_far = opening.entries(x, y)
    return normals.reshape(*SHAPE, 3), depths.reshape(SHAPE), is_far.reshape(SHAPE)


def noisy(normals: np.ndarray, degrees: float = 1.5) -> np.ndarray:
    """Return normals (H, W, 3) turned at random by `degrees` about each of two axes."""
    turned = normals + np.radians(degrees) * np.random.default_rng(3).normal(size=normals.shape)
    turned[..., 2] = np.maximum(turned[..., 2], 0.05)
    return turned / np.linalg.norm(turned, axis=-1, keepdims=True)


def step_beyond(depth: np.ndarray, truth: np.ndarray, mask: np.ndarray, far: np.ndarray) -> float:
    """Return by how much the far wall lies off, against the near one, pixels."""
    error = depth - truth
    return abs(float(np.nanmedian(error[far]) - np.nanmedian(error[mask & ~far])))


def test_the_far_wall_of_a_glass_lies_where_its_profile_says() -> None:
    normals, truth, far = seen(glass())
    mask = np.isfinite(truth)
    result = integrate(noisy(normals), mask, body=truth + 17.0)
    assert result.follows_body
    assert step_beyond(result.depth, truth, mask, far) < 1.0
    error = (result.depth - truth)[mask]
    assert np.abs(error - np.median(error)).mean() < 1.0


def test_a_body_whose_edge_is_two_pixels_off_will_do() -> None:
    normals, truth, far = seen(glass())
    mask = np.isfinite(truth)
    rows = np.indices(SHAPE)[0]
    at_lip = far & np.roll(~far & mask, -2, 0)
    body = np.where(at_lip, truth + 30.0, truth) + 0.5 * np.sin(rows / 9.0)
    result = integrate(noisy(normals), mask, body=body)
    assert result.follows_body
    assert step_beyond(result.depth, truth, mask, far) < 2.0


@pytest.mark.parametrize("kind", ["half as deep", "another tilt", "a third of the pixels", "a closed end"])
def test_a_body_that_is_wrong_as_a_whole_changes_nothing(kind: str) -> None:
    normals, truth, far = seen(glass())
    mask, rows = np.isfinite(truth), np.indices(SHAPE)[0]
    body = {
        "half as deep": 0.5 * truth,
        "another tilt": truth - np.tan(np.radians(12.0)) * rows,
        "a third of the pixels": np.where(rows % 30 < 10, truth, np.nan),
        "a closed end": np.where(far, np.nanmax(truth), truth),
    }[kind]
    alone = integrate(noisy(normals), mask)
    result = integrate(noisy(normals), mask, body=body)
    assert not result.follows_body and np.array_equal(result.depth, alone.depth, equal_nan=True)


def test_an_opening_in_a_closed_end_is_not_believed() -> None:
    surface = glass()
    rows, columns = (index.ravel().astype(float) for index in np.indices(SHAPE))
    hits = surface.intersect(*to_camera(columns, rows, SHAPE[1], SHAPE[0]))
    normals, truth = surface.normals_at(hits).reshape(*SHAPE, 3), hits.depths.reshape(SHAPE)
    mask, (_, opened, far) = np.isfinite(truth), seen(surface)
    alone, result = (integrate(noisy(normals), mask, body=body) for body in (None, opened))
    assert step_beyond(alone.depth, truth, mask, far) < 1.0
    assert step_beyond(result.depth, truth, mask, far) < 1.0


@pytest.mark.parametrize("tilt", [0.0, 20.0])
def test_a_continuous_surface_needs_no_body(tilt: float) -> None:
    rows, columns = (index.ravel().astype(float) for index in np.indices(SHAPE))
    x, y = to_camera(columns, rows, SHAPE[1], SHAPE[0])
    heights = np.arange(-50.0, 50.5, 0.5)
    squares = np.maximum(48.0**2 - heights**2, 0.0)
    axis = ReflectionAxis(np.zeros(2), np.array([1.0, 0.0]), 1.0)
    ball = SurfaceOfRevolution(axis, np.radians(tilt), heights, squares, -heights)
    hits = ball.intersect(x, y)
    normals, depth = ball.normals_at(hits).reshape(*SHAPE, 3), hits.depths.reshape(SHAPE)
    mask = np.isfinite(depth) & (normals[..., 2] > 0.2)
    truth = np.sqrt(np.maximum(48.0**2 - x**2 - y**2, 0.0)).reshape(SHAPE)
    assert np.abs(depth - truth)[mask].max() < 0.1
    alone = integrate(noisy(normals), mask)
    # A wrong depth, of which nothing must be seen.
    result = integrate(noisy(normals), mask, body=np.where(mask, 0.3 * depth, np.nan))
    assert not result.follows_body and np.array_equal(result.depth, alone.depth, equal_nan=True)


def test_bodies_are_cropped_with_the_mask_and_checked() -> None:
    normals, truth, _ = seen(glass())
    mask = np.isfinite(truth)
    around = ((9, 4), (3, 12))
    wide = integrate(
        np.pad(noisy(normals), (*around, (0, 0))), np.pad(mask, around), body=np.pad(truth, around, constant_values=9.0)
    )
    result = integrate(noisy(normals), mask, body=truth)
    assert np.array_equal(wide.depth[9:-4, 3:-12], result.depth, equal_nan=True)
    with pytest.raises(ValueError, match="body"):
        integrate(normals, mask, body=truth[1:])


def test_a_body_is_known_on_coarse_grids_too() -> None:
    normals, truth, far = seen(glass())
    mask = np.isfinite(truth)
    result = integrate(noisy(normals), mask, body=truth, limits=SearchLimits(max_searched=3000))
    assert result.follows_body
    assert step_beyond(result.depth, truth, mask, far) < 2.0


def test_what_is_no_body_is_attached_along_most_of_its_border() -> None:
    mask = np.ones((40, 50), bool)
    depth = np.zeros(mask.shape)
    depth[:, 30:] = -20.0
    rest = np.zeros(mask.shape, bool)
    rest[15:25, 10:30] = True
    body = known_body(np.where(rest, np.nan, depth), mask)
    assert body is not None
    slope = 0.5
    normals = np.broadcast_to([0.0, 0.0, 1.0], (*mask.shape, 3)).copy()
    normals[rest] = np.array([-slope, 0.0, 1.0]) / np.hypot(1.0, slope)
    edges = grid_edges(normals, mask, np.ones(mask.shape), None, 0.01)
    # The pixels of the body beside it turn away: that must not count.
    normals[14, 10:30] = normals[25, 10:30] = [0.0, 0.999, 0.0447]
    steep = grid_edges(normals, mask, np.ones(mask.shape), None, 0.01)
    for given in (edges, steep):
        rises = expected_rises(beside_body(given, body))
        weights = np.where(rises.precision > 0.0, 1.0, 0.0)
        height = attached_height(rises, weights, body)
        assert np.array_equal(height[~rest], depth[~rest])
        assert np.allclose(np.diff(height[20, 10:30]), slope, atol=0.05)
        assert abs(np.median(height[rest])) < 1.5


def test_too_small_a_part_is_no_body() -> None:
    mask = np.ones((10, 10), bool)
    depth = np.full(mask.shape, np.nan)
    depth[:5] = 1.0
    assert known_body(depth, mask) is None and known_body(None, mask) is None
    depth[:7] = 1.0
    assert known_body(depth, mask) is not None
