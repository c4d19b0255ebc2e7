"""The multigrid solver against a direct solution of the same equations."""

import numpy as np
import pytest
from scipy import ndimage, sparse
from scipy.sparse.linalg import spsolve

from glint.tasks.algorithms.integration.multigrid import solve_poisson

SIZES = [(1, 40), (40, 1), (2, 2), (5, 7), (6, 6), (7, 6), (13, 13), (31, 64), (64, 33), (101, 87)]


def masks(height: int, width: int) -> dict[str, np.ndarray]:
    """Shapes of a region (H, W): whole, a disc, a ring, separate pieces, and scattered pixels."""
    rows, columns = np.indices((height, width))
    radius = np.hypot((rows - (height - 1) / 2) / height, (columns - (width - 1) / 2) / width)
    scattered = np.random.default_rng(height * 1000 + width).random((height, width)) < 0.8
    return {
        "rectangle": np.ones((height, width), bool),
        "disc": radius <= 0.5,
        "ring": (radius <= 0.5) & (radius >= 0.25),
        "pieces": (rows % 11 != 5) & (columns % 9 != 4),
        "scattered": scattered,
    }


def random_graph(mask: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Weights (2, H, W) inside a mask, log-uniform over six orders of magnitude."""
    weights = 10.0 ** generator.uniform(-6.0, 0.0, (2, *mask.shape))
    weights[0, :-1] *= mask[:-1] & mask[1:]
    weights[1, :, :-1] *= mask[:, :-1] & mask[:, 1:]
    weights[0, -1] = weights[1, :, -1] = 0.0
    return weights


def incidence(mask: np.ndarray) -> tuple[sparse.csr_matrix, np.ndarray]:
    """Differences along all inner edges (E, pixels), and their places in the flat weights (2, H, W)."""
    numbers = np.arange(mask.size).reshape(mask.shape)
    down, across = mask[:-1] & mask[1:], mask[:, :-1] & mask[:, 1:]
    first = np.concatenate([numbers[:-1][down], numbers[:, :-1][across]])
    second = np.concatenate([numbers[1:][down], numbers[:, 1:][across]])
    places = np.concatenate([numbers[:-1][down], mask.size + numbers[:, :-1][across]])
    edges = np.arange(len(first))
    signs = np.concatenate([-np.ones(len(first)), np.ones(len(first))])
    positions = (np.concatenate([edges, edges]), np.concatenate([first, second]))
    return sparse.csr_matrix((signs, positions), shape=(len(first), mask.size)), places


def without_means(values: np.ndarray, components: np.ndarray) -> np.ndarray:
    """Values (H, W) less the mean of each component (0 outside)."""
    result = np.zeros(values.shape)
    for number in range(1, components.max() + 1):
        inside = components == number
        result[inside] = values[inside] - values[inside].mean()
    return result


def direct_solution(matrix: sparse.csr_matrix, source: np.ndarray, components: np.ndarray) -> np.ndarray:
    """scipy's direct solution (H, W): one pixel of each component is held at zero, which makes the matrix regular."""
    flat = components.ravel()
    anchors = np.unique(flat, return_index=True)[1]
    free = np.setdiff1d(np.flatnonzero(flat), anchors)
    solution = np.zeros(flat.size)
    if len(free):
        solution[free] = spsolve(matrix[free][:, free].tocsc(), source.ravel()[free])
    return solution.reshape(components.shape)


@pytest.mark.long
@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
@pytest.mark.parametrize("shape", ["rectangle", "disc", "ring", "pieces", "scattered"])
def test_the_solver_agrees_with_a_direct_one_over_six_orders_of_magnitude(shape: str, size: tuple[int, int]) -> None:
    mask = masks(*size)[shape]
    generator = np.random.default_rng(size[0] + 7 * size[1])
    weights = random_graph(mask, generator)
    differences, places = incidence(mask)
    edge_weights = weights.ravel()[places]
    # The source is that of random rises along the edges, as integration has it, so each component's sums to zero.
    source = (differences.T @ (edge_weights * generator.normal(size=len(places)))).reshape(size)
    matrix = (differences.T @ sparse.diags(edge_weights) @ differences).tocsr()
    components = ndimage.label(mask)[0]

    solution, iterations, converged = solve_poisson(
        weights, source, np.zeros(size), tolerance=1e-12, max_iterations=6000
    )
    exact = without_means(direct_solution(matrix, source, components), components)
    error = np.abs(without_means(solution, components) - exact).max()
    assert error <= 1e-7 * max(1.0, np.abs(exact).max())
    assert converged and iterations < 6000
    assert not solution[~mask].any()


def test_the_start_changes_nothing_but_the_constants_of_components() -> None:
    mask = masks(23, 30)["pieces"]
    components = ndimage.label(mask)[0]
    generator = np.random.default_rng(0)
    weights = random_graph(mask, generator)
    differences, places = incidence(mask)
    source = (differences.T @ (weights.ravel()[places] * generator.normal(size=len(places)))).reshape(mask.shape)
    start = 10.0 * components
    solution, *_ = solve_poisson(weights, source, start, tolerance=1e-12, max_iterations=6000)
    plain, *_ = solve_poisson(weights, source, np.zeros(mask.shape), tolerance=1e-12, max_iterations=6000)
    assert np.allclose(without_means(solution, components), without_means(plain, components), atol=1e-6)


def test_a_solution_as_start_takes_no_iteration() -> None:
    weights = random_graph(np.ones((17, 9), bool), np.random.default_rng(1))
    source = np.zeros((17, 9))
    source[3, 4], source[12, 2] = 1.0, -1.0
    solution, iterations, _ = solve_poisson(weights, source, np.zeros((17, 9)), tolerance=1e-9)
    assert iterations > 0
    assert solve_poisson(weights, source, solution, tolerance=1e-6)[1] == 0


def test_a_solution_that_the_limit_cut_short_is_not_converged() -> None:
    weights = random_graph(np.ones((17, 9), bool), np.random.default_rng(1))
    source = np.zeros((17, 9))
    source[3, 4], source[12, 2] = 1.0, -1.0
    start = np.zeros((17, 9))
    _, iterations, converged = solve_poisson(weights, source, start, tolerance=1e-9, max_iterations=2)
    assert iterations == 2 and not converged
    _, iterations, converged = solve_poisson(weights, source, start, tolerance=1e-9, max_iterations=2000)
    assert 2 < iterations < 2000 and converged


def test_a_source_that_is_rounding_alone_ends_the_iterations() -> None:
    source = np.array([[1e-17, 0.0], [0.0, 0.0]])
    weights = np.zeros((2, 2, 2))
    weights[0, 0], weights[1, :, 0] = 1.0, 1.0
    solution, _, converged = solve_poisson(weights, source, np.zeros((2, 2)))
    assert not converged
    assert np.abs(solution).max() < 1e-12


def test_a_pull_holds_values_and_leaves_no_constant_free() -> None:
    generator = np.random.default_rng(5)
    mask = masks(31, 42)["pieces"]
    weights = random_graph(mask, generator) ** 0.25
    pull = np.where(mask & (generator.random(mask.shape) < 0.3), generator.uniform(0.01, 1.0, mask.shape), 0.0)
    truth = np.where(mask, generator.normal(size=mask.shape), 0.0)
    differences, places = incidence(mask)
    matrix = differences.T @ sparse.diags(weights.ravel()[places]) @ differences + sparse.diags(pull.ravel())
    source = (matrix @ truth.ravel()).reshape(mask.shape)
    solution, _, converged = solve_poisson(weights, source, np.zeros(mask.shape), pull=pull, tolerance=1e-8)
    held = np.isin(ndimage.label(mask)[0], np.unique(ndimage.label(mask)[0][pull > 0.0]))
    assert converged and np.abs(solution - truth)[held].max() < 1e-4


@pytest.mark.parametrize("pull", [0.0, 1e-3, 0.1])
def test_few_iterations_are_enough_however_large_the_grid_and_strong_the_pull(pull: float) -> None:
    source = np.random.default_rng(0).normal(size=(200, 200))
    weights = np.ones((2, 200, 200))
    weights[0, -1], weights[1, :, -1] = 0.0, 0.0
    _, iterations, converged = solve_poisson(
        weights, source - source.mean(), np.zeros((200, 200)), pull=np.full((200, 200), pull)
    )
    assert converged and iterations < 15
