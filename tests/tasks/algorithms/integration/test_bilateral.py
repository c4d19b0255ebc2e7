from pathlib import Path

import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.integration.bilateral import Method, integrate
from glint.tasks.algorithms.integration.edges import bilateral_weights, compare_sides, grid_edges, step_price
from tests.benchmarks.integration_scenes import FIELDS, traced, with_noise
from tests.benchmarks.integration_sheets import risers, stairs
from tests.benchmarks.integration_synthetic import step_error
from tests.pictures import read_picture
from tests.tasks.algorithms.geometry.gradient_normals import from_gradients

METHODS: tuple[Method, ...] = ("bilateral", "least-squares")


def grid(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """x to the right and y upwards of a region, from its centre."""
    rows, columns = np.indices((height, width))
    return columns - (width - 1) / 2.0, (height - 1) / 2.0 - rows


def sphere(size: int, radius: float, reach: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normals, mask and height of a cap: the pixels within `reach` of the radius."""
    x, y = grid(size, size)
    mask = np.hypot(x, y) < reach * radius
    height = np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0.0))
    normals = np.where(mask[..., None], np.stack([x, y, height], axis=-1) / radius, np.nan)
    return normals, mask, height


def deviation(depth: np.ndarray, truth: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Depth less truth, less its median."""
    difference = (depth - truth)[where]
    return difference - np.median(difference)


@pytest.mark.parametrize("method", METHODS)
def test_a_plane_is_exact_and_grows_towards_the_camera(method: Method) -> None:
    x, y = grid(30, 41)
    normals = np.broadcast_to(from_gradients(np.array(0.7), np.array(-0.3)), (30, 41, 3))
    mask = np.hypot(x, y) < 14
    result = integrate(normals, mask, method=method)
    assert np.abs(deviation(result.depth, 0.7 * x - 0.3 * y, mask)).max() < 1e-3
    assert np.isnan(result.depth[~mask]).all() and result.depth.dtype == np.float32
    assert abs(np.nanmean(result.depth)) < 1e-4
    assert result.energy < 1e-6 and not result.perspective


@pytest.mark.parametrize(("reach", "bound"), [(0.9, 0.05), (0.999, 0.6)])
@pytest.mark.parametrize("method", METHODS)
def test_a_sphere_is_recovered_up_to_its_rim(method: Method, reach: float, bound: float) -> None:
    normals, mask, height = sphere(121, 55.0, reach)
    errors = deviation(integrate(normals, mask, method=method).depth, height, mask)
    assert np.abs(errors).mean() < bound


def test_components_are_labelled_and_each_has_mean_zero() -> None:
    mask = np.zeros((12, 30), bool)
    mask[2:10, 2:10] = mask[3:9, 15:28] = mask[11, 29] = True
    normals = np.broadcast_to(from_gradients(np.array(0.5), np.array(0.0)), (12, 30, 3))
    result = integrate(normals, mask)
    assert result.components.max() == 3 and (result.components > 0).sum() == mask.sum()
    for name in (1, 2, 3):
        assert abs(result.depth[result.components == name].mean()) < 1e-4
    assert result.depth[11, 29] == 0.0
    assert np.allclose(np.diff(result.depth[5, 2:10]), 0.5, atol=1e-3)


def test_diagonal_neighbours_are_components_of_their_own() -> None:
    mask = np.eye(2, dtype=bool)
    result = integrate(np.broadcast_to([0.0, 0.0, 1.0], (2, 2, 3)), mask)
    assert sorted(result.components[mask]) == [1, 2]


@pytest.mark.parametrize("method", METHODS)
def test_a_hole_does_not_bend_the_surface(method: Method) -> None:
    normals, mask, height = sphere(101, 60.0, 0.8)
    mask &= np.hypot(*grid(101, 101)) > 20
    normals[~mask] = (1.0, 0.0, 0.0)
    errors = deviation(integrate(normals, mask, method=method).depth, height, mask)
    assert np.abs(errors).max() < 0.2


def handle() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A sphere with a rod in front of it: normals, mask, height and where the rod is."""
    normals, mask, height = sphere(121, 70.0, 0.8)
    x, y = grid(121, 121)
    rod = (np.abs(x - 8) < 9) & (y < 25) & mask
    profile = np.sqrt(81.0 - np.clip(x - 8, -9, 9) ** 2)
    normals[rod] = np.stack([(x - 8) / 9, np.zeros_like(x), profile / 9], axis=-1)[rod]
    return normals, mask, np.where(rod, 85.0 + profile, height), rod


@pytest.mark.long
def test_bilateral_steps_where_a_handle_stands_in_front_and_least_squares_does_not() -> None:
    normals, mask, height, rod = handle()
    body = mask & ~rod
    bent = np.abs(deviation(integrate(normals, mask, method="least-squares").depth, height, body)).mean()
    kept = np.abs(deviation(integrate(normals, mask, method="bilateral").depth, height, body)).mean()
    assert kept < 0.5 * bent


def camera(skew: float = 0.0) -> np.ndarray:
    return np.array([[300.0, skew, 31.0], [0.0, 320.0, 22.0], [0.0, 0.0, 1.0]])


def rays(height: int, width: int, skew: float = 0.0) -> np.ndarray:
    """Directions (H, W, 3) of the pixels in the camera frame, z = -1."""
    rows, columns = np.indices((height, width))
    k = camera(skew)
    up = -(rows - k[1, 2]) / k[1, 1]
    right = (columns - k[0, 2] + skew * up) / k[0, 0]
    return np.stack([right, up, -np.ones_like(right)], axis=-1)


@pytest.mark.parametrize("skew", [0.0, 12.0])
@pytest.mark.parametrize("method", METHODS)
def test_a_plane_under_perspective_is_exact(method: Method, skew: float) -> None:
    normal = np.array([0.4, -0.3, 0.8]) / np.linalg.norm([0.4, -0.3, 0.8])
    truth = -500.0 * normal[2] / (rays(50, 70, skew) @ normal)
    mask = np.ones((50, 70), bool)
    mask[:9, :9] = False
    result = integrate(np.broadcast_to(normal, (50, 70, 3)), mask, method=method, camera=camera(skew))
    ratio = (result.depth / truth)[mask]
    assert result.perspective and np.ptp(ratio) < 1e-5 * ratio.mean()
    assert abs(np.log(result.depth[mask]).mean()) < 1e-5
    nearer = result.height(500.0)
    assert np.corrcoef(nearer[mask], truth[mask])[0, 1] < -0.999


def test_a_sphere_under_perspective() -> None:
    directions = rays(50, 70)
    centre, radius = np.array([-5.0, 2.0, -400.0]), 40.0
    along, square = directions @ centre, (directions**2).sum(axis=-1)
    root = along**2 - square * (centre @ centre - radius**2)
    mask = root > 0.1 * root.max()
    distance = (along - np.sqrt(np.maximum(root, 0.0))) / square
    normals = (directions * distance[..., None] - centre) / radius
    result = integrate(normals, mask, camera=camera())
    scaled = result.depth[mask] * np.median(distance[mask] / result.depth[mask])
    assert np.abs(scaled - distance[mask]).mean() < 0.02 * radius


def test_confidence_decides_between_true_and_false_normals() -> None:
    x, y = grid(40, 40)
    mask = np.hypot(x, y) < 19
    normals = np.broadcast_to(from_gradients(np.array(0.2), np.array(0.1)), (40, 40, 3)).copy()
    false = (np.abs(x) < 6) & (y > 0)
    normals[false] = from_gradients(np.array(-1.5), np.array(1.0))
    truth = 0.2 * x + 0.1 * y
    for method in METHODS:
        blind = np.abs(deviation(integrate(normals, mask, method=method).depth, truth, mask & ~false)).mean()
        weighed = integrate(normals, mask, confidence=np.where(false, 0.001, 0.9), method=method)
        assert np.abs(deviation(weighed.depth, truth, mask & ~false)).mean() < 0.2 * blind


def test_the_energy_is_a_mean_over_the_mask_and_confidences_are_relative() -> None:
    normals, mask, _ = sphere(41, 20.0, 0.8)
    normals = np.where(mask[..., None], normals, [0.0, 0.0, 1.0])
    normals += 0.05 * np.random.default_rng(0).normal(size=normals.shape)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    confidence = np.where(np.arange(41) > 20, 0.5, 1.0) * np.ones((41, 41))
    single = integrate(normals, mask, confidence=confidence, method="least-squares")
    gap = np.zeros((41, 60), bool)
    pair = integrate(
        np.hstack([normals, np.zeros((41, 60, 3)), normals]),
        np.hstack([mask, gap, mask]),
        confidence=np.hstack([confidence, gap, confidence]) / 1e5,
        method="least-squares",
    )
    assert single.energy > 1e-4 and pair.energy == pytest.approx(single.energy, rel=1e-3)
    assert np.allclose(pair.depth[:, :41][mask], single.depth[mask], atol=1e-2)


def test_pixels_of_little_weight_hardly_choose_between_their_sides() -> None:
    mask = np.ones((1, 3), bool)
    height = np.array([[0.0, 0.0, 2.0]])
    chosen = []
    for weight in (1.0, 0.01):
        edges = grid_edges(np.broadcast_to([0.0, 0.0, 1.0], (1, 3, 3)), mask, np.full((1, 3), weight), None, 0.01)
        difference, _, _ = compare_sides(edges, height, 0.5, 1.0)
        bilateral = bilateral_weights(difference, 5.0)
        chosen.append(bilateral[1, 0, 1])
    assert chosen[0] < 1e-6 and 0.4 < chosen[1] < 0.5


def test_a_crease_is_no_discontinuity_and_a_step_is() -> None:
    mask = np.ones((1, 4), bool)
    slope = np.array([0.5, 0.5, -0.5, -0.5])[None]
    edges = grid_edges(from_gradients(slope, np.zeros((1, 4))), mask, np.ones((1, 4)), None, 0.01)
    roof = np.array([[0.0, 0.5, 0.7, 0.2]])
    assert step_price(edges, roof, 0.0) < 1e-3
    assert step_price(edges, roof + np.array([[0, 0, 3.0, 3.0]]), 0.0) == 1.0
    unsure = edges._replace(weight=np.array([[1.0, 1.0, 0.01, 1.0]]))
    assert step_price(unsure, roof + np.array([[0, 0, 3.0, 3.0]]), 0.0) < 0.05


def test_a_step_is_the_cheaper_the_more_the_near_side_tilts_towards_the_far_one() -> None:
    mask = np.ones((1, 4), bool)
    slope = np.array([-0.7, -0.7, 0.0, 0.0])[None]
    edges = grid_edges(from_gradients(slope, np.zeros((1, 4))), mask, np.ones((1, 4)), None, 0.01)
    continuous = np.array([[0.0, -0.7, -1.05, -1.05]])
    # The first two pixels fall towards the last two: they hide those behind them, and show their back to those before.
    behind, before = (continuous + np.array([[0.0, 0.0, step, step]]) for step in (-3.0, 3.0))
    assert step_price(edges, behind, 0.0) == step_price(edges, before, 0.0) == 1.0
    tilt = np.sin(np.arctan(0.7))
    assert np.isclose(step_price(edges, behind, 2.0), np.exp(-2.0 * tilt))
    assert np.isclose(step_price(edges, before, 2.0), 1.0), "the near side is level there"
    turned = grid_edges(from_gradients(-slope, np.zeros((1, 4))), mask, np.ones((1, 4)), None, 0.01)
    assert np.isclose(step_price(turned, -continuous - np.array([[0, 0, 3.0, 3.0]]), 2.0), np.exp(2.0 * tilt))


@pytest.mark.parametrize(
    ("field", "share"),
    [
        pytest.param("bowl", 0.5, id="a bowl is cut at the near lip and not at the far one"),
        pytest.param("boxes", 0.3, id="faces stay together and solids come apart", marks=pytest.mark.long),
    ],
)
def test_what_hides_something_is_cut_from_it(field: str, share: float) -> None:
    scene = traced(FIELDS[field], 64)
    errors = {}
    for method in METHODS:
        depth = integrate(scene.normals, scene.mask, method=method).depth
        errors[method] = np.abs(deviation(depth, scene.height, scene.piece)).mean()
    assert errors["bilateral"] < share * errors["least-squares"]


@pytest.mark.parametrize("degrees", [0.0, 1.0])
def test_steps_that_fade_out_of_a_slope_have_their_height(degrees: float) -> None:
    scene = with_noise(stairs(64, 0.2, bend=0.6), degrees)
    assert step_error(scene, integrate(scene.normals, scene.mask).depth) < 0.02
    assert step_error(scene, integrate(scene.normals, scene.mask, method="least-squares").depth) > 0.9


def test_steep_risers_are_no_steps() -> None:
    scene = with_noise(risers(48, 2, 3.0), 1.0)
    for method in METHODS:
        depth = integrate(scene.normals, scene.mask, method=method).depth
        assert np.abs(deviation(depth, scene.height, scene.mask)).max() < 0.02 * np.ptp(scene.height)


def test_missing_normals_and_confidences_follow_their_neighbours() -> None:
    normals, mask, height = sphere(81, 60.0, 0.6)
    normals[38:43, 38:43] = np.nan
    confidence = np.where(mask, 0.8, np.nan)
    confidence[30, 30] = np.nan
    result = integrate(normals, mask, confidence=confidence)
    assert np.isfinite(result.depth[mask]).all()
    assert np.abs(deviation(result.depth, height, mask)).max() < 0.3


def test_rim_normals_in_the_image_plane_stay_finite() -> None:
    normals, mask, height = sphere(61, 28.0, 1.0)
    rim = mask & (np.hypot(*grid(61, 61)) > 27.0)
    normals[rim, 2] = 0.0
    result = integrate(normals, mask)
    assert np.abs(deviation(result.depth, height, mask & ~rim)).mean() < 1.0


def test_the_result_does_not_depend_on_what_lies_outside_the_mask() -> None:
    normals, mask, _ = sphere(61, 30.0, 0.8)
    first = integrate(np.where(mask[..., None], normals, np.nan), mask)
    second = integrate(np.where(mask[..., None], normals, 1.0), mask)
    assert np.array_equal(first.depth, second.depth, equal_nan=True)


def test_bad_input_is_refused() -> None:
    normals, mask, _ = sphere(21, 10.0, 0.8)
    with pytest.raises(UnusableCapture, match="empty"):
        integrate(normals, np.zeros_like(mask))
    with pytest.raises(UnusableCapture, match="normal"):
        integrate(np.full_like(normals, np.nan), mask)
    with pytest.raises(ValueError, match="agree"):
        integrate(normals, mask[:-1])
    with pytest.raises(ValueError, match="agree"):
        integrate(normals, mask, confidence=np.ones(3))
    with pytest.raises(ValueError, match="camera"):
        integrate(normals, mask, camera=np.eye(2))
    with pytest.raises(ValueError, match="unknown method"):
        integrate(normals, mask, method="poisson")  # type: ignore[arg-type]


def test_a_mask_without_usable_confidence_is_integrated_all_the_same() -> None:
    x, _ = grid(9, 9)
    normals = np.broadcast_to(from_gradients(np.array(0.3), np.array(0.0)), (9, 9, 3))
    result = integrate(normals, np.ones((9, 9), bool), confidence=np.zeros((9, 9)))
    assert np.allclose(result.depth, 0.3 * x, atol=1e-3)


@pytest.mark.shared
@pytest.mark.parametrize(
    ("name", "bound"),
    [
        *(("bear", 0.367), ("cow", 0.096), ("pot2", 0.175)),
        *(pytest.param(*large, marks=pytest.mark.slow) for large in (("buddha", 0.619), ("pot1", 0.698))),
    ],
)
def test_measured_objects_under_perspective(shared_data: Path, name: str, bound: float) -> None:
    """Mean absolute error in millimetres after scaling by the median ratio, the one freedom under perspective."""
    folder = shared_data / "real" / "diligent" / name
    normals = read_picture(folder / "normal_map.png")[..., ::-1] / 65535 * 2 - 1
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    mask = read_picture(folder / "mask.png", cv2.IMREAD_GRAYSCALE) > 0
    truth = np.load(folder / "depth_gt.npz")["depth_gt"].astype(float)
    depth = integrate(normals, mask, camera=np.loadtxt(folder / "K.txt")).depth
    known = mask & np.isfinite(truth)
    scale = np.median(truth[known] / depth[known])
    assert np.abs(scale * depth - truth)[known].mean() < bound


@pytest.mark.parametrize("radius", [20, 60])
def test_the_depth_of_a_sphere_does_not_run_away_at_its_contour(radius: int) -> None:
    y, x = np.mgrid[-radius - 2 : radius + 3, -radius - 2 : radius + 3].astype(float)
    mask = x**2 + y**2 < radius**2
    height = np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0.0))
    normals = np.stack([x, -y, height], axis=-1) / radius
    # The occluding contour's own normals, as the labelling gives them at the rim, are perpendicular to the view.
    rim = mask & (x**2 + y**2 > (radius - 1) ** 2)
    normals[rim] = np.stack([x, -y, np.zeros_like(x)], axis=-1)[rim] / np.hypot(x, y)[rim][:, None]
    depth = integrate(normals, mask).depth
    error = (depth - height)[mask]
    assert np.ptp(depth[mask]) < 1.05 * radius and np.abs(error - np.median(error)).max() < 0.25 * radius
