"""Minimum cuts on the pixel grid, compared with all labellings of a small one."""

from itertools import product

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.connected_parts import neighbours
from glint.tasks.algorithms.geometry.grid_cut import EDGE_FLOOR, Links, grid_cut, links

SHAPE = (3, 4)


def energy(labels: np.ndarray, ratios: np.ndarray, capacities: Links) -> float:
    """The energy of a labelling: what false pixels lose of their ratios, and the links that it cuts."""
    total = float(np.maximum(ratios, 0.0)[~labels].sum() + np.maximum(-ratios, 0.0)[labels].sum())
    for (down, right), capacity in capacities.items():
        first, second = neighbours(labels.shape, down, right)
        total += float(capacity[first][labels[first] != labels[second]].sum())
    return total


@pytest.mark.parametrize("seed", range(4))
def test_no_labelling_that_keeps_given_pixels_has_less_energy(seed: int) -> None:
    generator = np.random.default_rng(seed)
    capacities = links([generator.normal(0.0, 1.0, SHAPE)], 1.0)
    ratios = generator.normal(0.0, 2.0, SHAPE)
    inside, outside = generator.random((2, *SHAPE)) < 0.2
    labellings = (np.array(bits).reshape(SHAPE) for bits in product((False, True), repeat=ratios.size))
    kept = (labels for labels in labellings if not (outside & labels).any() and labels[inside & ~outside].all())
    best = min(kept, key=lambda labels: energy(labels, ratios, capacities))
    assert (grid_cut(ratios, capacities, inside, outside) == best).all()


def test_nothing_is_left_to_cut_where_all_pixels_are_given() -> None:
    inside = np.indices(SHAPE).sum(axis=0) % 2 == 0
    assert (grid_cut(np.zeros(SHAPE), links([np.zeros(SHAPE)], 1.0), inside, ~inside) == inside).all()


@pytest.mark.parametrize("gaussian", [False, True])
def test_an_even_slope_links_neighbours_alike_by_its_steepness(gaussian: bool) -> None:
    slope = np.add(*np.indices(SHAPE)).astype(float)
    capacities = links([0.5 * slope, 0.5 * slope], 2.0, gaussian)
    # Of two images the squares add up; diagonally the slope is 2 over 1.41 pixels, or none.
    for (down, right), weight, square in (((0, 1), 1.0, 0.5), ((1, 1), 0.707, 1.0), ((1, -1), 0.707, 0.0)):
        likeness = np.exp(-square) if gaussian else 1.0 / (1.0 + square)
        capacity = capacities[down, right][neighbours(SHAPE, down, right)[0]]
        assert capacity == pytest.approx(2.0 * weight * (likeness + EDGE_FLOOR), rel=1e-3)
