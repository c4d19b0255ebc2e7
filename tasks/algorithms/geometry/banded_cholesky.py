"""Banded Cholesky factorization: solves the equations of grids over an object in the image.

The nodes of such a grid can be numbered so that neighbours are at most two rows apart (Cuthill and McKee 1969). The
factor has more entries within that band than one of least fill, but dense blocks hold it, and no ordering of least fill
is searched: up to tens of thousands of nodes that takes half the time.
"""

import numpy as np
import scipy.sparse as sparse
from numba import njit
from scipy.linalg import solveh_banded
from scipy.sparse.csgraph import reverse_cuthill_mckee


def solve_positive_definite(matrix: sparse.csr_matrix, values: np.ndarray) -> np.ndarray:
    """Return the solution x (N, M) of A x = b for a symmetric positive definite matrix A (N, N) and b (N, M).

    Raises:
        numpy.linalg.LinAlgError: the matrix is not positive definite.
    """
    order = reverse_cuthill_mckee(matrix, symmetric_mode=True)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    # Columns of the band lie one after the other in memory, as LAPACK wants them.
    band = _band(matrix.indptr, matrix.indices, matrix.data, place).T
    solution = solveh_banded(band, values[order], overwrite_ab=True, lower=True, check_finite=False)
    return np.asarray(solution[place])


@njit(cache=True, nogil=True)
def _band(starts: np.ndarray, columns: np.ndarray, entries: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return the lower band (N, width) of a matrix in compressed rows: each column of it from its diagonal downward.

    place: (N,), number of each row in another order.
    """
    reach = 0
    for row in range(len(place)):
        for entry in range(starts[row], starts[row + 1]):
            reach = max(reach, place[row] - place[columns[entry]])
    band = np.zeros((len(place), reach + 1))
    for row in range(len(place)):
        for entry in range(starts[row], starts[row + 1]):
            column = place[columns[entry]]
            if place[row] >= column:
                band[column, place[row] - column] += entries[entry]
    return band
