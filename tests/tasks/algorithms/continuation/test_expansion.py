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


@pytest.mark.parametrize("seed", range(6))
def test_of_two_labels_the_labelling_is_the_best_that_is_allowed(seed: int) -> None:
    rng, count = np.random.default_rng(seed), 9
    edges = np.array([pair for pair in product(range(count), repeat=2) if pair[0] < pair[1] and rng.random() < 0.4])
    unary, weights = rng.normal(size=(2, count)), 0.8 * rng.random(len(edges))
    # Of the nodes some can only keep the label that they have.
    allowed, start = np.ones((2, count), bool), np.zeros(count, int)
    allowed[1, [0, 4]], allowed[0, [2, 7]], start[[2, 7]] = False, False, 1

    def predict(labels: np.ndarray, which: np.ndarray) -> np.ndarray:
        return np.stack([labels, weights[which]], axis=1)

    def difference(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        assert (first[:, 1] == second[:, 1]).all()
        return first[:, 1] * (first[:, 0] != second[:, 0])

    def cost(labels: np.ndarray) -> float:
        differs = labels[edges[:, 0]] != labels[edges[:, 1]]
        return float(unary[labels, np.arange(count)].sum() + weights[differs].sum())

    found = expand(start, unary, allowed, edges, predict, difference, sweeps=3)
    possible = (np.array(labels) for labels in product(range(2), repeat=count))
    best = min((labels for labels in possible if allowed[labels, np.arange(count)].all()), key=cost)
    assert found.tolist() == best.tolist()
    assert start.sum() == 2
