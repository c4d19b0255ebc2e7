"""Large regions are integrated from coarse to fine: what grids of half the resolution keep, and what comes of them."""

import numpy as np
import pytest

from glint.tasks.algorithms.integration.bilateral import integrate
from glint.tasks.algorithms.integration.coarse_grid import NormalGrid, doubled, halved
from glint.tasks.algorithms.integration.edges import grid_edges
from glint.tasks.algorithms.integration.search_limits import SearchLimits
from tests.benchmarks.integration_scenes import FIELDS, traced, with_noise
from tests.benchmarks.integration_sheets import risers, stairs
from tests.benchmarks.integration_synthetic import error
from tests.tasks.algorithms.geometry.gradient_normals import from_gradients


def test_blocks_have_the_mean_normal_of_what_is_known_inside_the_mask() -> None:
    normals = np.zeros((3, 5, 3))
    normals[..., 2] = 1.0
    normals[0, 0], normals[0, 1] = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    mask = np.ones((3, 5), bool)
    mask[:2, 2:4], mask[0, 2] = False, True
    weight = np.ones((3, 5))
    weight[1, :2] = 0.0
    coarse = halved(NormalGrid(normals, mask, weight, None))
    assert coarse.mask.tolist() == [[True, False, True], [True, True, False]]
    assert np.allclose(coarse.normals[0, 0], np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0))
    assert coarse.weight[0, 0] == 0.5 and coarse.weight[0, 2] == 1.0 and np.isfinite(coarse.normals).all()


def test_what_lies_outside_the_mask_adds_nothing_to_a_block() -> None:
    normals, mask = np.tile([0.0, 0.0, 1.0], (2, 2, 1)), np.array([[True, True], [False, False]])
    normals[1] = 1.0, 0.0, 0.0
    coarse = halved(NormalGrid(normals, mask, np.array([[0.2, 0.4], [1.0, 1.0]]), None))
    assert coarse.mask[0, 0] and coarse.weight[0, 0] == pytest.approx(0.3)
    assert np.allclose(coarse.normals[0, 0], [0.0, 0.0, 1.0])


def test_the_depth_of_a_block_is_its_nearest() -> None:
    body = np.array([[1.0, 3.0, np.nan], [np.nan, 2.0, np.nan], [4.0, -5.0, -6.0]])
    mask = np.ones((3, 3), bool)
    coarse = halved(NormalGrid(np.ones((3, 3, 3)), mask, np.ones((3, 3)), None, body))
    assert coarse.body is not None
    assert np.array_equal(coarse.body, [[1.5, np.nan], [2.0, -3.0]], equal_nan=True)


def test_a_height_of_a_coarse_grid_is_that_of_its_pixels_at_twice_the_resolution() -> None:
    rows, columns = np.indices((7, 9)).astype(float)
    mask = np.ones((4, 5), bool)
    coarse_rows, coarse_columns = np.indices((4, 5))
    # A block's centre lies half a pixel beyond that of its first pixel.
    coarse = (3.0 * (2 * coarse_rows + 0.5) - (2 * coarse_columns + 0.5)) / 2.0
    height = doubled(np.where(mask, coarse, np.nan), mask, (7, 9))
    assert np.allclose(height[1:, 1:-1], (3.0 * rows - columns)[1:, 1:-1])


def test_a_height_goes_on_beyond_its_mask_as_it_is_nearby() -> None:
    mask = np.zeros((6, 6), bool)
    mask[:, :3] = True
    assert np.allclose(doubled(np.where(mask, 5.0, np.nan), mask, (12, 12)), 10.0)


def test_the_centre_of_a_block_is_that_of_its_four_pixels() -> None:
    camera = np.array([[300.0, 4.0, 31.0], [0.0, 280.0, 25.0], [0.0, 0.0, 1.0]])
    coarse = halved(NormalGrid(np.ones((4, 4, 3)), np.ones((4, 4), bool), np.ones((4, 4)), camera)).camera
    assert coarse is not None
    fine_ray, coarse_ray = (
        np.linalg.solve(matrix, place) for matrix, place in ((camera, (2.5, 0.5, 1.0)), (coarse, (1.0, 0.0, 1.0)))
    )
    assert np.allclose(fine_ray, coarse_ray)


def test_the_coarse_grid_of_a_perspective_plane_is_that_plane() -> None:
    camera = np.array([[300.0, 0.0, 31.0], [0.0, 280.0, 25.0], [0.0, 0.0, 1.0]])
    normal = from_gradients(np.array(0.4), np.array(-0.2))
    mask, weight = np.ones((40, 60), bool), np.ones((40, 60))
    fine = NormalGrid(np.broadcast_to(normal, (40, 60, 3)), mask, weight, camera)
    coarse = halved(fine)
    rises = [grid_edges(*grid[:4], 0.01).forward_rise[1] for grid in (fine, coarse)]
    # The rise between two blocks, in their pixels, is that of two pixels.
    assert np.allclose(rises[1][:, 0], (rises[0][::2, 1] + rises[0][1::2, 1]) / 2.0, atol=1e-3)


@pytest.mark.parametrize("noise", [0.0, 1.0])
@pytest.mark.parametrize("name", ["stairs", "arm", "arm P"])
def test_steps_found_on_a_coarse_grid_are_those_of_the_fine_one(name: str, noise: float) -> None:
    scene = stairs(128, 0.2, bend=0.6) if name == "stairs" else traced(FIELDS["arm"], 128, perspective=name == "arm P")
    scene = with_noise(scene, noise) if noise else scene
    whole = integrate(scene.normals, scene.mask, camera=scene.camera)
    coarse = integrate(scene.normals, scene.mask, camera=scene.camera, limits=SearchLimits(max_searched=6_000))
    plain = integrate(scene.normals, scene.mask, camera=scene.camera, method="least-squares")
    assert not np.array_equal(coarse.depth, whole.depth, equal_nan=True)
    # What runs along a step may lie a pixel or two beside it.
    assert error(scene, coarse.depth) < error(scene, whole.depth) + 0.4
    assert error(scene, coarse.depth) < 0.2 * error(scene, plain.depth)


def test_where_least_squares_is_right_a_coarse_grid_changes_nothing() -> None:
    scene = risers(128, 2, 3.0)
    coarse = integrate(scene.normals, scene.mask, limits=SearchLimits(max_searched=6_000))
    assert error(scene, coarse.depth) < 0.01
