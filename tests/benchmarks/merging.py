"""Ways to merge many views into one surface, measured on the same views: the choice of `tasks/algorithms/multiview`.

    python -m tests.benchmarks.merging [--shape fish] [--views 6]             (simulated into a temporary folder)
    python -m tests.benchmarks.merging CATALOGUE --store STORE [--object ID]  (`glint run` was there; with truth_model)

All ways take the poses of the stored model and the labels stored for each view, so that they differ in merging alone;
the last row is the stored model itself, whose views were labelled anew against the first. Depth maps are those of the
single views: as they are; shifted to the hull; solved on their overlaps, by an offset and by a quadratic drift for each
view; or, free of such errors, those of our model as each view sees it. Seconds are of one process, solving included;
memory is what it gains at its peak.
"""

import argparse
import multiprocessing
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import open3d
import psutil
from scipy.spatial import cKDTree

from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.tasks.algorithms.evaluation.mesh_metrics import ModelScore, score_model
from glint.tasks.algorithms.multiview.mesh import Model, vertex_normals
from glint.tasks.algorithms.multiview.poisson import align_depth, merge_depth_maps, oriented_points
from glint.tasks.algorithms.multiview.raycast import raycast
from glint.tasks.algorithms.multiview.reconstruction import reconstruct_surface
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.multiview.visual_hull import hull_model
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.references import load_catalogue
from glint.tasks.evaluation.models import load_registered_views, load_true_mesh, without_steep_normals
from glint.tasks.model.model import perform_model
from glint.tasks.model.model_key import STAGE, model_key
from glint.tasks.pipeline import warm_up
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from tests.tasks.make_context import perform_all

o3d: Any = open3d
"""Its annotations refuse tuples and arrays, which it takes."""
TRUNCATED = 4.0
"""Cells from a surface within which the TSDF is integrated."""
BLOCK = 16
"""Cells along each side of a block of the grid."""
LEAST = 0.02
"""Confidence that even a guess has."""
FAR, ALIKE = 0.06, 0.8
"""Overlaps: most distance of two points, as a share of the object's size, and least cosine of their normals."""
DRIFT = 0.02
"""Drift expected of a depth map, as a share of the object's size."""
ROUNDS = 12

Depths = list[np.ndarray]


def tsdf(views: Sequence[View], depths: Depths, cell: float) -> Model:
    """Confidence-weighted TSDF of depth maps (H, W) on a grid of voxel blocks; outside masks is empty space."""
    points = np.concatenate([oriented_points(view, depth)[0] for view, depth in zip(views, depths, strict=True)])
    grid = o3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight"), (o3d.core.float32, o3d.core.float32), ((1), (1)), cell, BLOCK, 20_000
    )
    cloud = o3d.t.geometry.PointCloud(o3d.core.Tensor.from_numpy(points.astype(np.float32)))
    blocks = grid.compute_unique_block_coordinates(cloud, TRUNCATED)
    grid.hashmap().activate(blocks)
    positions, _ = grid.hashmap().find(blocks)
    places, indices = grid.voxel_coordinates_and_flattened_indices(positions)
    world, at = places.numpy().astype(float), indices.numpy()
    total, weights = np.zeros(len(world)), np.zeros(len(world))
    for view, depth in zip(views, depths, strict=True):
        distance, weight = _seen(view, depth, world, TRUNCATED * cell)
        total, weights = total + weight * distance, weights + weight
    value = np.divide(total, weights, out=np.ones_like(total), where=weights > 0) / (TRUNCATED * cell)
    for name, values in (("tsdf", value), ("weight", weights)):
        stored = grid.attribute(name).reshape((-1, 1))
        stored[o3d.core.Tensor(at)] = o3d.core.Tensor(values.astype(np.float32)[:, None])
    mesh = grid.extract_triangle_mesh(weight_threshold=1e-4).to_legacy()
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles, np.int64)
    unseen = np.zeros(len(vertices))
    return Model(vertices, triangles, vertex_normals(vertices, triangles), unseen, unseen.astype(int), cell)


def _seen(view: View, depth: np.ndarray, world: np.ndarray, most: float) -> tuple[np.ndarray, np.ndarray]:
    """Signed distances (N,) of points (N, 3) from a view's surface, positive before it, and their weights (N,)."""
    columns, rows = (np.round(values).astype(int) for values in view.project(world))
    inside = (columns >= 0) & (rows >= 0) & (columns < view.mask.shape[1]) & (rows < view.mask.shape[0])
    row, column = np.where(inside, rows, 0), np.where(inside, columns, 0)
    empty = ~(inside & view.mask[row, column])
    cosine = np.nan_to_num(view.normals[row, column, 2])
    # Along the ray a slanting surface is further away than it is.
    distance = (world @ view.rotation[2] + view.translation[2] - depth[row, column]) * np.maximum(cosine, 0.1)
    known = ~empty & np.isfinite(distance) & (distance > -most) & without_steep_normals(view).mask[row, column]
    weight = np.where(known, np.maximum(np.nan_to_num(view.confidence[row, column]), LEAST) ** 2 * cosine, 0.0)
    return np.where(empty, most, np.clip(np.nan_to_num(distance), -most, most)), np.where(empty, 1.0, weight)


def solved(views: Sequence[View], depths: Depths, drift: bool) -> Depths:
    """Depth maps moved until they agree where they overlap: an offset each, or a quadratic of column and row.

    Robust least squares of the distance of each point from the tangent planes of the nearest points of other views.
    """
    wanted = [without_steep_normals(view) for view in views]
    size = max(float(np.hypot(*view.mask.shape)) * view.pixel_size for view in views)
    bases = [_basis(view.mask.shape, drift) for view in views]
    terms = bases[0].shape[2]
    change = np.zeros((len(views), terms))
    for _ in range(ROUNDS):
        clouds = [
            oriented_points(view, depth + basis @ step)
            for view, depth, basis, step in zip(wanted, depths, bases, change, strict=True)
        ]
        rows = [basis[view.mask & np.isfinite(depth)] for view, depth, basis in zip(wanted, depths, bases, strict=True)]
        prior = np.tile(np.r_[1e-3, np.full(terms - 1, 1.0)] / (DRIFT * size), len(views)) ** 2
        matrix, right = np.diag(prior), -prior * change.ravel()
        for first in range(len(views)):
            for second in range(len(views)):
                if first != second:
                    _pull(matrix, right, (first, second), clouds, rows, [view.rotation[2] for view in views], size)
        change += np.linalg.solve(matrix, right).reshape(change.shape)
    return [depth + np.float32(basis @ step) for depth, basis, step in zip(depths, bases, change, strict=True)]


def _basis(shape: tuple[int, ...], drift: bool) -> np.ndarray:
    """Changes (H, W, K) that a depth map may undergo."""
    row, column = np.meshgrid(*(np.linspace(-1.0, 1.0, edge) for edge in shape), indexing="ij")
    terms = [np.ones(shape)] + ([column, row, column**2, column * row, row**2] if drift else [])
    return np.stack(terms, axis=-1)


def _pull(
    matrix: np.ndarray,
    right: np.ndarray,
    pair: tuple[int, int],
    clouds: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]],
    rows: Sequence[np.ndarray],
    axes: Sequence[np.ndarray],
    size: float,
) -> None:
    """Add the equations of one view's points near another's to the normal equations."""
    first, second = pair
    points, normals, confidence = clouds[first]
    targets, target_normals, target_confidence = clouds[second]
    distances, nearest = cKDTree(targets).query(points, distance_upper_bound=FAR * size)
    near = np.flatnonzero(np.isfinite(distances))
    near = near[(normals[near] * target_normals[nearest[near]]).sum(axis=1) > ALIKE]
    at, normal = nearest[near], target_normals[nearest[near]]
    rise = ((points[near] - targets[at]) * normal).sum(axis=1)
    weight = (
        np.minimum(confidence[near], target_confidence[at]) / (1.0 + (rise / (0.01 * size)) ** 2) / (0.005 * size) ** 2
    )
    terms = rows[0].shape[1]
    columns = np.r_[first * terms : (first + 1) * terms, second * terms : (second + 1) * terms]
    slopes = np.hstack(
        [rows[first][near] * (normal @ axes[first])[:, None], -rows[second][at] * (normal @ axes[second])[:, None]]
    )
    matrix[np.ix_(columns, columns)] += slopes.T @ (weight[:, None] * slopes)
    right[columns] -= slopes.T @ (weight * rise)


def on_hull(views: Sequence[View], depths: Depths) -> Depths:
    """Depth maps shifted to the hull."""
    hull = hull_model(views)
    return [align_depth(hull, view, depth) for view, depth in zip(views, depths, strict=True)]


def poisson(views: Sequence[View], depths: Depths) -> Model:
    """Screened Poisson reconstruction of depth maps."""
    return merge_depth_maps([without_steep_normals(view) for view in views], depths, hull_model(views).cell)


def fused(views: Sequence[View], depths: Depths) -> Model:
    """TSDF of depth maps, its cells those of the others."""
    return tsdf(views, depths, hull_model(views).cell)


def _ours_seen(views: Sequence[View]) -> tuple[list[View], Depths]:
    """Return the depth maps and normals of our model as the views see it."""
    model = reconstruct_surface(views)
    raycasts = [raycast(model, view) for view in views]
    views = [view.with_normals(normals, view.confidence) for view, (_, normals) in zip(views, raycasts, strict=True)]
    return views, [depth for depth, _ in raycasts]


WAYS: dict[str, Callable[[Sequence[View], Depths], Model]] = {
    "visual hull": lambda views, depths: hull_model(views),
    "Poisson, depth maps as they are": poisson,
    "Poisson, shifted to the hull": lambda views, depths: poisson(views, on_hull(views, depths)),
    "Poisson, offsets solved": lambda views, depths: poisson(views, solved(views, on_hull(views, depths), False)),
    "Poisson, offsets and drift solved": lambda views, depths: poisson(
        views, solved(views, on_hull(views, depths), True)
    ),
    "TSDF, shifted to the hull": lambda views, depths: fused(views, on_hull(views, depths)),
    "TSDF, offsets solved": lambda views, depths: fused(views, solved(views, on_hull(views, depths), False)),
    "TSDF, offsets and drift solved": lambda views, depths: fused(views, solved(views, on_hull(views, depths), True)),
    "refined, then TSDF of the views' depth maps": lambda views, depths: fused(*_ours_seen(views)),
    "refined, then Poisson": lambda views, depths: reconstruct_surface(views),
}


def measured(way: str, views: Sequence[View], depths: Depths, truth: str) -> tuple[ModelScore, float, int]:
    """Score, seconds and bytes gained of one way; called in a process of its own."""
    warm_up()
    process = psutil.Process()
    before, start = process.memory_info().rss, time.perf_counter()
    Path("/proc/self/clear_refs").write_text("5")
    model = WAYS[way](views, depths)
    seconds = time.perf_counter() - start
    status = Path("/proc/self/status").read_text()
    peak = int(status.split("VmHWM:")[1].split()[0]) * 1024
    return score_model(model.vertices, model.triangles, load_true_mesh(truth)), seconds, max(0, peak - before)


def simulated(shape: str, views: int, folder: Path) -> tuple[Path, str]:
    """Return a small turntable's catalogue and its store, all stages done."""
    made = simulate(shape, folder, CaptureOptions(frames=400, scale=0.5, views=views, sphere_radius=20.0, rays=1))
    catalogue, store = load_catalogue(made.catalogue), str(folder / "store")
    works = [CaptureContext.of(catalogue, shape, name, store, "run") for name in made.captures]
    for work in works:
        perform_all(work)
    perform_model(works, model_key(works))
    return made.catalogue, store


def table_row(name: str, score: ModelScore, seconds: float, memory: int | None) -> str:
    """Return a row of the table."""
    cells = [
        name,
        *(f"{value:.3f}" for value in score.f_scores),
        f"{100 * score.chamfer:.2f}",
        f"{score.normals:.3f}",
        "yes" if score.watertight else "no",
        f"{seconds:.1f}",
        "" if memory is None else f"{memory / 1e6:.0f}",
    ]
    return "| " + " | ".join(cells) + " |"


def compare(catalogue: Path, store: str, object_id: str | None) -> None:
    """Print the table of one object."""
    entry = load_catalogue(catalogue).object(object_id) if object_id else load_catalogue(catalogue).objects[0]
    works = [CaptureContext.of(load_catalogue(catalogue), entry.id, capture.id, store) for capture in entry.captures]
    if entry.truth_model is None:
        raise SystemExit(f"{entry.id} has no truth_model")
    saved = works[0].repository.load(WHOLE_OBJECT, STAGE)
    views, depths = load_registered_views(works)
    print(f"{entry.id}, {len(views)} views\n")
    print("| way | F-score 0.5% | 1% | chamfer, % | normals | watertight | seconds | MB |\n" + "|---" * 8 + "|")
    for way in WAYS:
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
            print(table_row(way, *pool.submit(measured, way, views, depths, entry.truth_model).result()), flush=True)
    truth = load_true_mesh(entry.truth_model)
    stored = score_model(saved.read("vertices"), saved.read("triangles"), truth)
    print(table_row("the same, views labelled anew", stored, float(saved.record["seconds"]), None))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("catalogue", nargs="?", type=Path)
    parser.add_argument("--store")
    parser.add_argument("--object")
    parser.add_argument("--shape", default="fish")
    parser.add_argument("--views", type=int, default=6)
    options = parser.parse_args()
    if options.catalogue is not None:
        compare(options.catalogue, options.store, options.object)
    else:
        with tempfile.TemporaryDirectory() as folder:
            compare(*simulated(options.shape, options.views, Path(folder)), options.shape)


if __name__ == "__main__":
    main()
