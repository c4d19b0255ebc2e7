"""Rendered captures: geometry, energy, highlights where they must be, determinism."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from glint.storage.catalogue.loading import load
from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of
from glint.tasks.algorithms.multiview.view import rotation_about_y
from glint.tasks.algorithms.near_light.table_plane import TablePlane
from glint.tasks.algorithms.simulation.environment import Environment
from glint.tasks.algorithms.simulation.light_path import light_path
from glint.tasks.algorithms.simulation.ray_tracing import Paths, Scene, refraction
from glint.tasks.algorithms.simulation.renderer import prepare_renderer
from glint.tasks.algorithms.simulation.shapes import build_solids
from glint.tasks.algorithms.simulation.solids import GLASS, sphere
from glint.tasks.simulation.simulate import PRESETS, SHAPES, CaptureOptions, simulate
from tests.benchmarks.overlapping_limbs import depth_steps

RADIUS = 30.0


@pytest.fixture(scope="module")
def grid() -> tuple[np.ndarray, np.ndarray]:
    y, x = np.mgrid[36:-37:-1, -36:37]
    return x.astype(float), y.astype(float)


@pytest.fixture(scope="module")
def traced(grid: tuple[np.ndarray, np.ndarray]) -> tuple[Scene, Paths]:
    scene = Scene([sphere(np.zeros(3), RADIUS, GLASS)])
    return scene, scene.trace(*grid, 2, np.random.default_rng(0))


def test_truth_of_a_sphere(grid: tuple[np.ndarray, np.ndarray], traced: tuple[Scene, Paths]) -> None:
    truth = traced[0].truth(*grid)
    x, y = grid
    inside = np.hypot(x, y) < RADIUS - 1
    z = np.sqrt(np.maximum(RADIUS**2 - x**2 - y**2, 0))
    assert angles(truth.normals, np.stack([x, y, z], axis=-1) / RADIUS)[inside].max() < 0.1
    np.testing.assert_allclose(truth.depth[inside], z[inside], atol=0.15)
    assert np.isnan(truth.depth[np.hypot(x, y) > RADIUS + 1]).all()


def test_light_is_neither_made_nor_lost(traced: tuple[Scene, Paths], grid: tuple[np.ndarray, np.ndarray]) -> None:
    total = np.bincount(traced[1].pixel, traced[1].weight, grid[0].size)
    assert total.max() < 1.0 + 1e-5
    assert total.mean() > 0.98


def test_fresnel_at_normal_incidence_and_total_reflection() -> None:
    down, up = np.array([[0.0, 0.0, -1.0]]), np.array([[0.0, 0.0, 1.0]])
    refracted, reflectance = refraction(down, up)
    np.testing.assert_allclose(refracted[0], down[0], atol=1e-9)
    assert reflectance[0] == pytest.approx(0.04)
    steep = np.array([[np.sin(1.0), 0.0, np.cos(1.0)]])
    assert refraction(steep, up)[1][0] == 1.0


def test_the_direct_highlight_lies_where_the_normal_is_the_half_vector(
    traced: tuple[Scene, Paths], grid: tuple[np.ndarray, np.ndarray]
) -> None:
    scene, paths = traced
    environment = Environment.random(TablePlane(np.array([0.0, 0.0, 1.0]), -80.0), np.random.default_rng(0))
    renderer = prepare_renderer(paths, environment, grid[0].shape, np.radians(5.4))
    light = np.array([0.5, 0.3, np.sqrt(1 - 0.34)])
    half_vector = half_vectors_of(light)
    near = angles(scene.truth(*grid).normals, half_vector) < 1.5
    dark, lit = renderer.render(np.full(3, np.nan)), renderer.render(light)
    assert (lit - dark)[near].min() > 1.0
    assert np.allclose(dark, renderer.static)


@pytest.mark.parametrize("distance", [None, 300.0])
def test_a_table_seen_aslant_is_lit_by_the_cosine_of_its_own_normal(
    traced: tuple[Scene, Paths], grid: tuple[np.ndarray, np.ndarray], distance: float | None
) -> None:
    _, paths = traced
    table = TablePlane(np.array([0.0, 0.8, 0.6]), -60.0)
    environment = Environment.random(table, np.random.default_rng(0))
    renderer = prepare_renderer(paths, environment, grid[0].shape, np.radians(5.4))
    corner, dark = (2, 2), renderer.render(np.full(3, np.nan))

    def brightness(light: np.ndarray) -> float:
        return float((renderer.render(light, distance) - dark)[corner])

    point = table.points(grid[0][corner], grid[1][corner])
    lights = np.array([[0.0, 0.8, 0.6], [0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])
    to_light = lights - (0.0 if distance is None else point / distance)
    expected = to_light @ table.normal / np.linalg.norm(to_light, axis=1) ** (1 if distance is None else 3)
    shown = np.array([brightness(light) for light in lights])
    np.testing.assert_allclose(shown / shown[0], expected / expected[0], rtol=1e-3)
    assert brightness(np.array([0.0, -0.8, 0.6])) == 0.0


def test_the_light_path_is_dense_enough_and_seeded() -> None:
    lights = light_path(2000, np.random.default_rng(3))
    np.testing.assert_array_equal(lights, light_path(2000, np.random.default_rng(3)))
    front = lights[lights[:, 2] > 0]
    assert 0.95 < len(front) / 2000 < 1.0
    half_vectors = half_vectors_of(front)
    middle = half_vectors[half_vectors[:, 2] > np.cos(np.radians(40))]
    near = (angles(middle[::20, None], half_vectors[None]) < 1.5).sum(axis=1)
    assert 2 <= np.median(near) <= 12
    gap = light_path(2000, np.random.default_rng(3), missing_quarter=True)
    azimuth = np.degrees(np.arctan2(gap[:, 1], gap[:, 0]))[np.isfinite(gap[:, 0]) & (gap[:, 2] > 0) & (gap[:, 2] < 0.9)]
    histogram = np.histogram(azimuth, bins=36, range=(-180, 180))[0]
    assert (histogram < 3).sum() >= 7


@pytest.mark.long
@pytest.mark.parametrize("shape", SHAPES)
def test_each_shape_fills_its_region(shape: str) -> None:
    solids = build_solids(shape, 120, 110)
    outer = np.concatenate([solid.vertices for solid in solids if not solid.inner])
    extent = np.ptp(outer, axis=0)[:2]
    assert (extent <= [104.5, 94.5]).all() and (np.isclose(extent, [104, 94], atol=0.5)).any()
    x, y = np.meshgrid(np.arange(-60.0, 61), np.arange(55.0, -56, -1))
    truth = Scene(solids).truth(x, y)
    mask = np.isfinite(truth.depth)
    assert mask.mean() > 0.15
    np.testing.assert_allclose(np.linalg.norm(truth.normals[mask], axis=-1), 1.0, atol=1e-4)
    assert (truth.normals[mask][:, 2] >= 0).all()


def test_the_jug_has_a_hole(grid: tuple[np.ndarray, np.ndarray]) -> None:
    x, y = np.meshgrid(np.arange(-70.0, 71), np.arange(105.0, -106, -1))
    mask = np.isfinite(Scene(build_solids("jug", 140, 210)).truth(x, y).depth).astype(np.uint8)
    outlines, _ = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    assert max(len(outline) for outline in outlines[1:]) > 30


@pytest.mark.long
@pytest.mark.parametrize(("shape", "overlaps"), [("puppy", True), ("elephant", True), ("hemisphere", False)])
def test_limbs_of_figurines_stand_before_the_body(shape: str, overlaps: bool) -> None:
    x, y = np.meshgrid(np.arange(-60.0, 61), np.arange(55.0, -56, -1))
    depth = Scene(build_solids(shape, 120, 110)).truth(x, y).depth
    steps = depth_steps(depth) | depth_steps(depth.T).T
    assert steps.sum() > 100 if overlaps else steps.sum() < 10


@pytest.mark.long
def test_the_same_seed_gives_the_same_files(tmp_path: Path) -> None:
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        simulate("fish", tmp_path / name, CaptureOptions(frames=12, scale=0.25, sphere_radius=20.0, seed=seed))
    for file in ("video.mp4", "markup.json", "truth/lights.npy", "truth/normals.npy", "truth/depth.npy"):
        first, second = ((tmp_path / name / "fish" / "front" / file).read_bytes() for name in "ab")
        assert first == second, file
    different = (tmp_path / "c" / "fish" / "front" / "video.mp4").read_bytes()
    assert different != (tmp_path / "a" / "fish" / "front" / "video.mp4").read_bytes()


@pytest.mark.long
def test_views_turn_about_one_axis_and_agree_with_the_model(tmp_path: Path) -> None:
    import trimesh

    options = CaptureOptions(frames=6, scale=0.25, sphere_radius=20.0, views=3)
    record = simulate("bird", tmp_path, options)
    entry = load(record.catalogue).object("bird")
    assert [capture.pose.turntable for capture in entry.captures if capture.pose] == [0.0, 120.0, 240.0]
    model = trimesh.load(str(entry.truth_model))
    assert model.extents[1] > 5


@pytest.mark.long
@pytest.mark.parametrize("free_poses", [False, True])
def test_near_views_lie_in_their_regions_and_agree_with_the_model(tmp_path: Path, free_poses: bool) -> None:
    import trimesh

    options = CaptureOptions(frames=2, scale=0.3, sphere_radius=20.0, rays=1, views=3, focal=1.0, free_poses=free_poses)
    entry = load(simulate("bird", tmp_path, options).catalogue).object("bird")
    corners = trimesh.load(str(entry.truth_model)).vertices
    assert len(entry.captures) == options.views
    for capture in entry.captures:
        assert capture.camera is not None and capture.region is not None and capture.pose is not None
        matrix, pose = np.array(capture.camera.matrix), np.eye(4)
        if free_poses:
            pose = np.array(capture.pose.camera_to_world)
        else:
            # The axis is where a pixel covers so many millimetres; the region's centre is on it.
            pose[:3, :3] = rotation_about_y(capture.pose.turntable or 0.0).T
            middle = (capture.region.x + (capture.region.width - 1) / 2 - matrix[0, 2]) * 25.0 / 40.0
            pose[:3, 3] = pose[:3, :3] @ [-middle, 0.0, matrix[0, 0] * 25.0 / 40.0]
        seen = (corners - pose[:3, 3]) @ pose[:3, :3]
        columns = matrix[0, 2] - matrix[0, 0] * seen[:, 0] / seen[:, 2] - capture.region.x
        rows = matrix[1, 2] + matrix[1, 1] * seen[:, 1] / seen[:, 2] - capture.region.y
        picture = cv2.imread(str(capture.mask), cv2.IMREAD_GRAYSCALE)
        assert picture is not None
        mask = np.asarray(picture) > 0
        assert not (mask[[0, -1]].any() or mask[:, [0, -1]].any())
        for positions, is_inside in ((columns, mask.any(axis=0)), (rows, mask.any(axis=1))):
            shown = np.flatnonzero(is_inside)
            assert abs(positions.min() - shown[0]) < 1.6 and abs(positions.max() - shown[-1]) < 1.6


@pytest.mark.long
def test_shapes_are_added_to_a_catalogue_and_replaced(tmp_path: Path) -> None:
    options = CaptureOptions(frames=4, scale=0.2, sphere_radius=15.0)
    for shape in ("cylinder", "hemisphere", "cylinder"):
        simulate(shape, tmp_path, options)
    assert sorted(entry.id for entry in load(tmp_path / "catalogue.yaml").objects) == ["cylinder", "hemisphere"]
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_what_cannot_be_simulated_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="teapot"):
        simulate("teapot", tmp_path, CaptureOptions())
    assert set(PRESETS) < set(SHAPES)


@pytest.mark.parametrize(
    "option",
    [
        {"crf": 99},
        {"seed": -1},
        {"noise": np.inf},
        {"sphere_radius": np.inf},
        {"sphere_diameter": np.inf},
        {"focal": np.inf},
        {"light_distance": np.nan},
        {"exposure_drift": np.nan},
    ],
)
def test_an_option_out_of_its_range_is_named(option: dict[str, Any]) -> None:
    (name,) = option
    with pytest.raises(ValueError, match=f"{name}=.* cannot be simulated"):
        CaptureOptions(**option)
