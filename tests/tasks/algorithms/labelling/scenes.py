"""Views of known shapes to be labelled: their clusters, masks and true normals."""

import numpy as np

from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.labelling.weights import LabellingOptions

Scene = tuple[Clusters, np.ndarray, np.ndarray]
SHEETS_ALONE = LabellingOptions(symmetry=False, flat_faces=False)
"""Without the search for surfaces of revolution and solids, which takes most of the time and finds none."""


def pebble(size: int = 90, seed: int = 0) -> Scene:
    """Clusters, mask and truth of a flattened solid: most exterior highlights within 45 degrees, and a false sheet."""
    rng = np.random.default_rng(seed)
    rows, columns = np.indices((size, size)) - (size - 1) / 2
    a, b, c = 0.45 * size, 0.35 * size, 0.4 * size
    square = (columns / a) ** 2 + (rows / b) ** 2
    inside = square < 1
    z = c * np.sqrt(np.maximum(1 - square**2, 1e-9))
    truth = unit(np.stack([2 * square * columns / a**2, -2 * square * rows / b**2, z / c**2], axis=-1))
    false = unit(np.stack([-0.6 * columns / a, 0.6 * rows / b + 0.15, np.ones_like(z)], axis=-1))
    nodes = np.stack([truth, false]) + rng.normal(0, 0.01, (2, size, size, 3))
    nodes[0][~inside | (truth[..., 2] < 0.75) | (rng.random((size, size)) < 0.2)] = np.nan
    nodes[1][~inside | (rng.random((size, size)) < 0.2)] = np.nan
    swap = rng.random((size, size)) < 0.5
    nodes = unit(np.where(swap[None, ..., None], nodes[::-1], nodes)).astype(np.float32)
    return clusters_of(nodes), inside, np.where(inside[..., None], truth, np.nan)


def clusters_of(normals: np.ndarray) -> Clusters:
    """Candidates (K, H, W, 3) of whose shading nothing is known."""
    known = np.isfinite(normals[..., 0])
    unknown, single = np.full(normals.shape[:3], np.nan), np.ones(normals.shape[:3])
    return Clusters(
        normals,
        weight=single,
        spread=unknown,
        count=known.astype(np.int32),
        observations=known.sum(axis=0),
        winner=normals[0],
        shading=unknown,
    )


def head_with_ear(size: int = 90) -> tuple[Scene, np.ndarray]:
    """Clusters, mask and truth of a sphere, and the pixels of a narrow ellipsoid that hangs before its contour."""
    rows, columns = np.indices((size, size)) - (size - 1) / 2

    def ellipsoid(centre: float, a: float, b: float, c: float) -> tuple[np.ndarray, np.ndarray]:
        x, y = (columns - centre * size) / (a * size), -rows / (b * size)
        z = np.sqrt(np.maximum(1 - x**2 - y**2, 0.0))
        return x**2 + y**2 < 1, unit(np.stack([x / a, y / b, z / c], axis=-1))

    head, head_normals = ellipsoid(0.0, 0.42, 0.42, 0.42)
    ear, ear_normals = ellipsoid(-0.36, 0.13, 0.3, 0.06)
    truth = np.where((head | ear)[..., None], np.where(ear[..., None], ear_normals, head_normals), np.nan)
    seen = unit(truth + np.random.default_rng(0).normal(0.0, 0.01, truth.shape))
    seen[~(truth[..., 2] > 0.75)] = np.nan
    return (clusters_of(seen[None].astype(np.float32)), head | ear, truth), ear & np.isfinite(seen[..., 0])
