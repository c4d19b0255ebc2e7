import numpy as np
import pytest

from glint.tasks.algorithms.candidates.markup import MARK_RADIUS_DEG, Marks, mark_constraints


def test_a_true_mark_labels_the_clusters_of_its_pixel() -> None:
    normals = np.full((2, 3, 3, 3), np.nan)
    normals[0, 1, 1], normals[1, 1, 1] = (0, 0, 1), (0.6, 0, 0.8)
    marks = Marks(np.array([[1, 1]]), np.array([[0.6, 0, 0.8]]), np.array([1]))
    marked, values, labels = mark_constraints(marks, normals, np.ones((3, 3), bool))
    assert marked[1, 1] and marked.sum() == 1 and labels[:, 1, 1].tolist() == [-1, 1]
    np.testing.assert_allclose(values[1, 1], [0.6, 0, 0.8])


@pytest.mark.parametrize("kind", [1, 0])
def test_where_sheets_cross_a_mark_is_of_the_nearer_one(kind: int) -> None:
    tilts = np.radians([3.0, -2.0, 20.0])
    normals = np.stack([np.sin(tilts), np.zeros(3), np.cos(tilts)], axis=-1)[:, None, None, :]
    marks = Marks(np.array([[0, 0]]), np.array([[0.0, 0.0, 1.0]]), np.array([kind]))
    _, _, labels = mark_constraints(marks, normals, np.ones((1, 1), bool))
    assert labels.ravel().tolist() == ([0, 1, -1] if kind == 1 else [0, -1, 0])


def test_a_mark_without_a_cluster_fixes_its_normal_alone() -> None:
    marks = Marks(np.array([[0, 0]]), np.array([[0.0, 0.0, 1.0]]), np.array([1]))
    for normals in (np.empty((0, 1, 1, 3)), np.full((2, 1, 1, 3), np.nan)):
        marked, values, labels = mark_constraints(marks, normals, np.ones((1, 1), bool))
        assert marked.all() and values[0, 0].tolist() == [0.0, 0.0, 1.0] and not labels.any()


def test_a_true_mark_rules_out_what_is_well_apart_from_it_alone() -> None:
    normals = half_vectors(0.0, 1.5 * MARK_RADIUS_DEG, 2.5 * MARK_RADIUS_DEG)[:, None, None, :]
    marks = Marks(np.array([[0, 0]]), half_vectors(0.0), np.array([1]))
    assert mark_constraints(marks, normals, np.ones((1, 1), bool))[2].ravel().tolist() == [1, 0, -1]


def test_a_mark_beside_the_object_fixes_nothing() -> None:
    marks = Marks(np.array([[0, 1]]), np.array([[0.0, 0.0, 1.0]]), np.array([1]))
    normals = np.broadcast_to([0.0, 0.0, 1.0], (1, 1, 2, 3))
    marked, values, labels = mark_constraints(marks, normals, np.array([[True, False]]))
    assert not marked.any() and np.isnan(values).all() and not labels.any()


def half_vectors(*degrees: float) -> np.ndarray:
    """Return unit vectors (N, 3) tilted to the right by so many degrees."""
    tilts = np.radians(degrees)
    return np.stack([np.sin(tilts), np.zeros(len(tilts)), np.cos(tilts)], axis=-1)


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_of_two_marks_of_a_cluster_the_nearer_one_counts(order: list[int]) -> None:
    normals = half_vectors(0.0)[:, None, None, :]
    marks = Marks(np.zeros((2, 2), int), half_vectors(2.0, -3.0)[order], np.array([1, 0])[order])
    assert mark_constraints(marks, normals, np.ones((1, 1), bool))[2].ravel().tolist() == [1]


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_a_true_mark_does_not_rule_out_the_cluster_of_another(order: list[int]) -> None:
    normals = half_vectors(0.0, 20.0, 40.0)[:, None, None, :]
    marks = Marks(np.zeros((2, 2), int), half_vectors(0.0, 20.0)[order], np.array([1, 1]))
    assert mark_constraints(marks, normals, np.ones((1, 1), bool))[2].ravel().tolist() == [1, 1, -1]


@pytest.mark.parametrize("kind", [1, 0])
def test_where_sheets_cross_a_mark_is_rather_of_one_that_it_confirms(kind: int) -> None:
    """Nearer to the first cluster, but within its error of the second, whose label is the mark's."""
    normals = half_vectors(1.0, -4.0)[:, None, None, :]
    marks = Marks(np.array([[0, 0]]), half_vectors(0.0), np.array([kind]))
    exterior = np.array([kind == 0, kind == 1]).reshape(2, 1, 1)
    label = 1 if kind == 1 else -1
    assert mark_constraints(marks, normals, np.ones((1, 1), bool))[2].ravel().tolist() == [label, 0]
    assert mark_constraints(marks, normals, np.ones((1, 1), bool), exterior)[2].ravel().tolist() == [0, label]
    assert mark_constraints(marks, normals, np.ones((1, 1), bool), ~exterior)[2].ravel().tolist() == [label, 0]
