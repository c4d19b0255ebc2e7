import numpy as np
import pytest
import scipy.sparse as sparse

from glint.tasks.algorithms.geometry.banded_cholesky import solve_positive_definite


def test_a_solution_satisfies_the_equations_whatever_the_order_of_the_unknowns() -> None:
    rng = np.random.default_rng(0)
    nodes = np.arange(12 * 9).reshape(12, 9)
    pairs = [
        *zip(nodes[1:].flat, nodes[:-1].flat, strict=True),
        *zip(nodes[:, 1:].flat, nodes[:, :-1].flat, strict=True),
    ]
    differences = np.zeros((len(pairs), nodes.size))
    for row, (first, second) in enumerate(pairs):
        differences[row, first], differences[row, second] = 1.0, -1.0
    # A component of its own, which is one node.
    differences[:, 40] = 0.0
    order = rng.permutation(nodes.size)
    matrix = (differences.T @ differences + 0.01 * np.eye(nodes.size))[np.ix_(order, order)]
    values = rng.normal(size=(nodes.size, 2))
    solution = solve_positive_definite(sparse.csr_matrix(matrix), values)
    assert np.allclose(matrix @ solution, values)


def test_a_matrix_that_is_not_positive_definite_is_an_error() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        solve_positive_definite(sparse.csr_matrix(np.diag([1.0, -1.0])), np.ones((2, 2)))
