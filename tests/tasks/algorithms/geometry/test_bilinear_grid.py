import numpy as np
import pytest

from glint.tasks.algorithms.geometry.bilinear_grid import BilinearGrid


@pytest.mark.parametrize("step", [1, 3])
def test_normal_equations_are_those_of_the_interpolation_matrix(step: int) -> None:
    rng = np.random.default_rng(0)
    mask = rng.random((11, 14)) < 0.7
    values, weights = rng.normal(size=(11, 14, 2)), rng.random((11, 14)) * (rng.random((11, 14)) < 0.5)
    grid = BilinearGrid.over(mask, step)
    # The matrix column by column: what the unit vectors interpolate to.
    unit_vectors = np.eye(grid.count)
    columns = [grid.interpolate(np.stack([vector, vector], axis=-1))[mask][:, 0] for vector in unit_vectors]
    sampling, weight = np.column_stack(columns), weights[mask]
    assert np.allclose(sampling.sum(axis=1), 1.0) and (sampling.sum(axis=0) > 0).all()
    matrix, sums = grid.normal_equations(values, weights)
    assert np.allclose(matrix.toarray(), sampling.T @ (weight[:, None] * sampling))
    assert np.allclose(sums, sampling.T @ (weight[:, None] * values[mask]))


def test_interpolation_of_a_plane_is_exact() -> None:
    mask = np.ones((20, 17), bool)
    grid = BilinearGrid.over(mask, 4)
    rows, columns = np.nonzero(grid.nodes >= 0)
    values = np.stack([4.0 * rows + 1.0, 8.0 * columns - 4.0 * rows], axis=-1)
    y, x = np.indices(mask.shape)
    assert np.allclose(grid.interpolate(values), np.stack([y + 1.0, 2.0 * x - y], axis=-1))
