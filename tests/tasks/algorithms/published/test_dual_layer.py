"""The paper's graph cut against every labelling of tiny pictures."""

from itertools import product

import numpy as np
import pytest

from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.labelling.results import MARKED, OBSERVED, OUTSIDE, SILHOUETTE
from glint.tasks.algorithms.prior.silhouette import initial_normals
from glint.tasks.algorithms.published.dual_layer import (
    Connectivity,
    NodeTerms,
    edge_ends,
    label_dual_layer,
    neighbour_offsets,
    node_terms,
    reconstruct_dual_layer,
)

NEIGHBOURS: dict[Connectivity, list[tuple[int, int]]] = {
    "layers": [(0, 1), (1, 0), (0, -1), (-1, 0)],
    "surface": [(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if (dy, dx) != (0, 0)],
}


def pairs_of(mask: np.ndarray, connectivity: Connectivity) -> list[tuple[tuple[int, int, int], tuple[int, int, int]]]:
    """The paper's nine edges of every node, each once."""
    pairs = set()
    for k, y, x in product(range(2), *map(range, mask.shape)):
        if not mask[y, x]:
            continue
        pairs.add(((0, y, x), (1, y, x)))
        for dy, dx in NEIGHBOURS[connectivity]:
            v, u = y + dy, x + dx
            if 0 <= v < mask.shape[0] and 0 <= u < mask.shape[1] and mask[v, u]:
                for j in (0, 1) if connectivity == "layers" else (k,):
                    pairs.add(min(((k, y, x), (j, v, u)), ((j, v, u), (k, y, x))))
    return sorted(pairs)


def energies(
    nodes: NodeTerms, labels: np.ndarray, mask: np.ndarray, connectivity: Connectivity, weight: float
) -> np.ndarray:
    """The paper's E(S), edge by edge, of many labellings (N, 2, H, W)."""
    total = np.where(labels == 1, nodes.exterior_cost, nodes.false_cost)[:, :, mask].sum(axis=(1, 2))
    for first, second in pairs_of(mask, connectivity):
        gap = abs(nodes.p[first] - nodes.p[second]) + abs(nodes.q[first] - nodes.q[second])
        total += (labels[:, *first] != labels[:, *second]) * weight / (gap + 1.0)
    return total


def all_labellings(mask: np.ndarray) -> np.ndarray:
    """All labellings (N, 2, H, W) of the nodes of a mask."""
    count = 2 * int(mask.sum())
    labels = np.zeros((2**count, 2, *mask.shape), np.uint8)
    labels[:, :, mask] = (np.arange(2**count)[:, None] >> np.arange(count) & 1).reshape(-1, 2, count // 2)
    return labels


def small_nodes(seed: int) -> tuple[NodeTerms, np.ndarray]:
    """NodeTerms on a 2 x 4 grid with one pixel outside, one cluster at one pixel, none at another; some marked."""
    generator = np.random.default_rng(seed)
    mask = np.ones((2, 4), bool)
    mask[0, seed % 4] = False
    normals = unit(generator.normal((0, 0, 1), 0.5, (2, 2, 4, 3)))
    normals[..., 2] = np.abs(normals[..., 2])
    normals[1, 1, 0] = normals[:, 1, 2] = np.nan
    initial = unit(np.abs(generator.normal((0, 0, 1), 0.4, (2, 4, 3))))
    pins = np.zeros((2, 2, 4), np.int8)
    if seed % 2:
        pins[:, 1, 1], pins[0, 1, 3] = (1, -1), -1
    return node_terms(normals, initial, mask, pins), mask


@pytest.mark.parametrize("connectivity", ["layers", "surface"])
@pytest.mark.parametrize("seed", range(8))
def test_no_labelling_has_less_energy(connectivity: Connectivity, seed: int) -> None:
    nodes, mask = small_nodes(seed)
    labellings = all_labellings(mask)
    for weight in (0.0, 0.05, 0.1, 0.5, 2.0):
        result = label_dual_layer(nodes, mask, connectivity=connectivity, weight=weight)
        assert energies(nodes, result[None], mask, connectivity, weight)[0] == pytest.approx(
            energies(nodes, labellings, mask, connectivity, weight).min()
        )
        if seed % 2:
            assert result[:, 1, 1].tolist() == [1, 0] and result[0, 1, 3] == 0


@pytest.mark.parametrize("connectivity", ["layers", "surface"])
def test_every_node_has_the_nine_edges_of_its_reading(connectivity: Connectivity) -> None:
    mask, numbers = np.ones((3, 3), bool), np.arange(18).reshape(2, 3, 3)
    expected = {frozenset((int(numbers[a]), int(numbers[b]))) for a, b in pairs_of(mask, connectivity)}
    result = [frozenset((number, number + 9)) for number in range(9)]
    for offset in neighbour_offsets(connectivity):
        result += [frozenset(pair) for pair in np.stack(edge_ends(numbers, connectivity, offset), axis=-1).tolist()]
    assert len(result) == len(set(result)) and set(result) == expected
    assert sum(4 in pair for pair in result) == 9


def test_own_terms_are_those_of_the_paper() -> None:
    initial = np.array([[[0.6, 0.0, 0.8]]])
    normals = np.stack([initial, initial * (-1, 1, 1)])
    nodes = node_terms(normals, initial, np.ones((1, 1), bool), np.zeros((2, 1, 1), np.int8))
    np.testing.assert_allclose(nodes.exterior_cost.ravel(), [0, 1], atol=1e-12)
    np.testing.assert_allclose(nodes.false_cost.ravel(), [1, 0], atol=1e-12)
    unobserved = node_terms(np.full_like(normals, np.nan), initial, np.ones((1, 1), bool), np.zeros((2, 1, 1), np.int8))
    np.testing.assert_array_equal(unobserved.exterior_cost, 0.5)
    np.testing.assert_allclose(unobserved.p, -0.75)


def sphere(size: int = 41) -> tuple[np.ndarray, np.ndarray]:
    """Mask and normals of a sphere."""
    rows, columns = np.mgrid[:size, :size] - size // 2
    nx, ny = columns / (size / 2 - 1.5), -rows / (size / 2 - 1.5)
    mask = nx**2 + ny**2 < 1
    normals = np.stack([nx, ny, np.sqrt(np.maximum(1 - nx**2 - ny**2, 0))], axis=-1)
    return mask, np.where(mask[..., None], normals, np.nan)


def clusters_of(normals: np.ndarray) -> Clusters:
    observed = np.isfinite(normals[..., 0])
    return Clusters(
        normals.astype(np.float32),
        observed * 1.0,
        observed * 0.0,
        observed * 1,
        observed.sum(axis=0),
        np.zeros(normals.shape[1:]),
        observed * 0.0,
    )


def test_true_clusters_are_separated_from_those_of_the_far_side() -> None:
    mask, truth = sphere()
    normals = np.stack([truth * (-1, -1, 1), truth, np.full_like(truth, np.nan)])
    initial = initial_normals(mask).normals
    result = reconstruct_dual_layer(clusters_of(normals), mask, initial)
    steep = mask & (truth[..., 2] < 0.9)
    assert (result.labels[1][steep] == 1).mean() > 0.97 and (result.labels[0][steep] == 0).mean() > 0.97
    assert np.median(angles(result.normals, truth)[steep]) < 0.1
    assert (result.provenance[steep] == OBSERVED).mean() > 0.97


def test_marks_decide() -> None:
    mask, truth = sphere()
    odd = unit(np.array([0.0, 0.3, 1.0]))
    normals = np.full((3, *truth.shape), np.nan)
    normals[0, 20, 20] = odd
    initial = initial_normals(mask).normals
    for kind, expected in ((1, MARKED), (0, SILHOUETTE)):
        marks = Marks(np.array([[20, 20]]), odd[None].astype(np.float32), np.array([kind], np.int8))
        result = reconstruct_dual_layer(clusters_of(normals), mask, initial, marks=marks)
        assert result.provenance[20, 20] == expected
        assert (angles(result.normals[20, 20], odd) < 0.1) == (kind == 1)


def test_unobserved_pixels_keep_the_normals_of_the_silhouette() -> None:
    mask, truth = sphere()
    normals = np.full((3, *truth.shape), np.nan)
    normals[0, 18:23, 26:31] = truth[18:23, 26:31]
    initial = initial_normals(mask).normals
    result = reconstruct_dual_layer(clusters_of(normals), mask, initial)
    observed = np.isfinite(normals[0, ..., 0])
    assert (result.provenance[observed] == OBSERVED).all() and (result.provenance[~mask] == OUTSIDE).all()
    assert (result.provenance[mask & ~observed] == SILHOUETTE).all()
    np.testing.assert_array_equal(result.normals[mask & ~observed], initial[mask & ~observed])
    assert result.labels.shape == (3, *mask.shape) and not result.labels[:, ~observed].any()
    assert np.isnan(result.confidence[~mask]).all()
    assert ((result.confidence >= 0) & (result.confidence <= 1))[mask].all()


def test_confidence_in_the_initial_normals_falls_where_highlights_contradict_them() -> None:
    mask, truth = sphere()
    hidden = np.zeros_like(mask)
    hidden[18:23, 18:23] = True
    observed = np.where((hidden | ~mask)[..., None], np.nan, truth)
    steeper = unit(truth * (0.6, 0.6, 1.0)).astype(np.float32)
    confirmed, contradicted = (
        reconstruct_dual_layer(clusters_of(np.stack([observed] * 3)), mask, initial).confidence[hidden]
        for initial in (truth.astype(np.float32), steeper)
    )
    nothing = reconstruct_dual_layer(clusters_of(np.full((3, *truth.shape), np.nan)), mask, steeper)
    assert (confirmed > 0.6).all() and (contradicted < 0.3).all()
    assert (nothing.confidence[mask] == 0).all()


def test_wrong_use_is_refused() -> None:
    mask, truth = sphere()
    clusters, initial = clusters_of(np.stack([truth] * 3)), initial_normals(mask).normals
    with pytest.raises(ValueError, match="do not fit"):
        reconstruct_dual_layer(clusters, mask[:-1], initial)
    with pytest.raises(ValueError, match="negative"):
        reconstruct_dual_layer(clusters, mask, initial, weight=-0.1)
