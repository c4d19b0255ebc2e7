"""Winner takes all: right where all highlights are on the surface, wrong where most are not."""

import numpy as np

from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.labelling.results import FILLED, MARKED, OBSERVED, OUTSIDE
from glint.tasks.algorithms.prior.silhouette import initial_normals
from glint.tasks.algorithms.published.winner_takes_all import reconstruct_winner


def scene() -> tuple[np.ndarray, np.ndarray]:
    """Mask and normals of a sphere."""
    rows, columns = np.mgrid[:51, :51] - 25.0
    flat = np.stack([columns, -rows], axis=-1) / 23.0
    height = np.sqrt(np.maximum(1 - (flat**2).sum(axis=-1, keepdims=True), 0))
    mask = (flat**2).sum(axis=-1) < 1
    return mask, np.where(mask[..., None], np.concatenate([flat, height], axis=-1), np.nan).astype(np.float32)


def clusters_of(winner: np.ndarray) -> Clusters:
    observed = np.isfinite(winner[..., 0])[None].repeat(3, axis=0)
    zero = observed * 0.0
    return Clusters(np.stack([winner] * 3), observed * 1.0, zero, observed * 1, observed[0] * 5, winner, zero)


def test_winners_are_kept_and_the_rest_is_filled_from_them() -> None:
    mask, truth = scene()
    winner = truth.copy()
    winner[20:28, 20:28] = np.nan
    result = reconstruct_winner(clusters_of(winner), mask, initial_normals(mask).normals)
    hole = mask & np.isnan(winner[..., 0])
    np.testing.assert_array_equal(result.normals[mask & ~hole], truth[mask & ~hole])
    assert angles(result.normals, truth)[hole].max() < 2.0
    assert (result.provenance[mask & ~hole] == OBSERVED).all() and (result.provenance[hole] == FILLED).all()
    assert (result.provenance[~mask] == OUTSIDE).all() and np.isnan(result.normals[~mask]).all()
    np.testing.assert_array_equal(result.labels[0] == 1, mask & ~hole)
    assert not result.labels[1:].any()


def test_a_true_mark_overrules_the_winner() -> None:
    mask, truth = scene()
    marked = unit(np.array([0.3, 0.1, 1.0])).astype(np.float32)
    marks = Marks(np.array([[25, 25]]), marked[None], np.array([1], np.int8))
    result = reconstruct_winner(clusters_of(truth), mask, initial_normals(mask).normals, marks=marks)
    np.testing.assert_allclose(result.normals[25, 25], marked)
    assert result.provenance[25, 25] == MARKED and result.confidence[25, 25] == 1.0
