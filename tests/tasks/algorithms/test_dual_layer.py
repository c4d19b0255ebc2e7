"""The paper's graph cut against every labelling of tiny pictures."""

from itertools import product

import numpy as np
import pytest

from tasks.algorithms.clusters import Clusters
from tasks.algorithms.dual_layer import Edges, Nodes, label_dual_layer, nodes_of, reconstruct_dual_layer
from tasks.algorithms.geometry import angles, unit
from tasks.algorithms.markup import Marks
from tasks.algorithms.rounds import MARKED, OBSERVED
from tasks.algorithms.silhouette import initial_normals

LAYERS: dict[Edges, list[tuple[int, int]]] = {
    "layers": [(0, 1), (1, 0), (0, -1), (-1, 0)],
    "surface": [(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if (dy, dx) != (0, 0)],
}


def energy(nodes: Nodes, labels: np.ndarray, mask: np.ndarray, edges: Edges, weight: float) -> float:
    """The paper's E(S), written down edge by edge."""
    total = float(np.where(labels == 1, nodes.one, nodes.zero)[:, mask].sum())
    pairs = set()
    for k, y, x in product(range(2), *map(range, mask.shape)):
        if not mask[y, x]:
            continue
        pairs.add(((0, y, x), (1, y, x)))
        for dy, dx in LAYERS[edges]:
            v, u = y + dy, x + dx
            if 0 <= v < mask.shape[0] and 0 <= u < mask.shape[1] and mask[v, u]:
                for j in (0, 1) if edges == "layers" else (k,):
                    pairs.add(tuple(sorted([(k, y, x), (j, v, u)])))
    for first, second in pairs:
        if labels[first] != labels[second]:
            gap = abs(nodes.p[first] - nodes.p[second]) + abs(nodes.q[first] - nodes.q[second])
            total += weight / (gap + 1.0)
    return total


@pytest.mark.parametrize("edges", ["layers", "surface"])
@pytest.mark.parametrize("seed", range(6))
def test_no_labelling_has_less_energy(edges: Edges, seed: int) -> None:
    generator = np.random.default_rng(seed)
    mask = np.ones((2, 3), bool)
    mask[0, 2] = seed % 2 == 0
    normals = unit(generator.normal((0, 0, 1), 0.5, (2, 2, 3, 3)))
    normals[..., 2] = np.abs(normals[..., 2])
    normals[1, 1, 0] = normals[:, 0, 1] = np.nan
    initial = unit(np.abs(generator.normal((0, 0, 1), 0.4, (2, 3, 3))))
    pins = np.zeros((2, 2, 3), np.int8)
    pins[0, 1, 1] = 1 if seed == 3 else 0
    nodes = nodes_of(normals, initial, mask, pins)
    weight = (0.05, 0.1, 0.5)[seed % 3]
    found = energy(nodes, label_dual_layer(nodes, mask, edges=edges, weight=weight), mask, edges, weight)
    every = []
    for values in product((0, 1), repeat=2 * int(mask.sum())):
        labels = np.zeros((2, 2, 3), np.uint8)
        labels[:, mask] = np.reshape(values, (2, -1))
        every.append(energy(nodes, labels, mask, edges, weight))
    assert found == pytest.approx(min(every))


def test_own_terms_are_those_of_the_paper() -> None:
    initial = np.array([[[0.6, 0.0, 0.8]]])
    normals = np.stack([initial, initial * (-1, 1, 1)])
    nodes = nodes_of(normals, initial, np.ones((1, 1), bool), np.zeros((2, 1, 1), np.int8))
    np.testing.assert_allclose(nodes.one.ravel(), [0, 1], atol=1e-12)
    np.testing.assert_allclose(nodes.zero.ravel(), [1, 0], atol=1e-12)
    unseen = nodes_of(np.full_like(normals, np.nan), initial, np.ones((1, 1), bool), np.zeros((2, 1, 1), np.int8))
    np.testing.assert_array_equal(unseen.one, 0.5)
    np.testing.assert_allclose(unseen.p, -0.75)


def ball(size: int = 41) -> tuple[np.ndarray, np.ndarray]:
    """Mask and normals of a sphere."""
    rows, columns = np.mgrid[:size, :size] - size // 2
    nx, ny = columns / (size / 2 - 1.5), -rows / (size / 2 - 1.5)
    mask = nx**2 + ny**2 < 1
    normals = np.stack([nx, ny, np.sqrt(np.maximum(1 - nx**2 - ny**2, 0))], axis=-1)
    return mask, np.where(mask[..., None], normals, np.nan)


def clusters_of(normals: np.ndarray) -> Clusters:
    seen = np.isfinite(normals[..., 0])
    return Clusters(
        normals.astype(np.float32), seen * 1.0, seen * 0.0, seen * 1, seen.sum(axis=0), np.zeros(normals.shape[1:])
    )


def test_true_clusters_are_told_from_those_of_the_far_side() -> None:
    mask, truth = ball()
    normals = np.stack([truth * (-1, -1, 1), truth, np.full_like(truth, np.nan)])
    initial = initial_normals(mask).initial
    found = reconstruct_dual_layer(clusters_of(normals), mask, initial)
    steep = mask & (truth[..., 2] < 0.9)
    assert (found.labels[1][steep] == 1).mean() > 0.97 and (found.labels[0][steep] == 0).mean() > 0.97
    assert np.median(angles(found.normals, truth)[steep]) < 0.1
    assert (found.provenance[steep] == OBSERVED).mean() > 0.97


def test_marks_decide() -> None:
    mask, truth = ball()
    odd = unit(np.array([0.0, 0.3, 1.0]))
    normals = np.full((3, *truth.shape), np.nan)
    normals[0, 20, 20] = odd
    initial = initial_normals(mask).initial
    for kind, expected in ((1, MARKED), (0, 4)):
        marks = Marks(np.array([[20, 20]]), odd[None].astype(np.float32), np.array([kind], np.int8))
        found = reconstruct_dual_layer(clusters_of(normals), mask, initial, marks=marks)
        assert found.provenance[20, 20] == expected
        assert (angles(found.normals[20, 20], odd) < 0.1) == (kind == 1)
