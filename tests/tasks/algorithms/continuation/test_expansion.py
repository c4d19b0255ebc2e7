from itertools import product

import numpy as np
import pytest

from glint.tasks.algorithms.continuation.expansion import expand


def energy(labels: np.ndarray, unary: np.ndarray, edges: np.ndarray, cost: float) -> float:
    differs = labels[edges[:, 0]] != labels[edges[:, 1]]
    return float(unary[labels, np.arange(len(labels))].sum() + cost * differs.sum())


@pytest.mark.parametrize("seed", range(4))
def test_labels_are_near_the_minimum_of_all_labellings(seed: int) -> None:
    rng = np.random.default_rng(seed)
    unary, edges, cost = rng.random((3, 7)), np.array([[i, i + 1] for i in range(6)] + [[0, 3], [2, 6]]), 0.3

    def difference(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return cost * (first != second).any(axis=1)

    found = expand(
        np.zeros(7, int), unary, np.ones((3, 7), bool), edges, lambda labels, _: labels[:, None], difference, sweeps=4
    )
    least = min(energy(np.array(labels), unary, edges, cost) for labels in product(range(3), repeat=7))
    assert energy(found, unary, edges, cost) == pytest.approx(least, abs=0.05)


def test_only_allowed_labels_are_taken() -> None:
    unary, allowed = np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]]), np.array([[True] * 3, [True, False, True]])
    edges = np.array([[0, 1], [1, 2]])
    free = expand(
        np.zeros(3, int), unary, allowed, edges, lambda labels, _: labels[:, None], lambda a, _: np.zeros(len(a)), 2
    )
    assert free.tolist() == [1, 0, 1]
