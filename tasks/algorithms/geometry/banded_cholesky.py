"""Banded Cholesky factorization: solves the equations of grids over an object in the image.

The nodes of such a grid can be numbered so that neighbours are at most two rows apart (Cuthill and McKee 1969). The
factor has more entries within that band than one of least fill, but dense blocks hold it, and no ordering of least fill
is searched: up to tens of thousands of nodes that takes half the time.
"""

import numpy as np
import scipy.sparse as sparse
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
    entries = matrix.tocoo()
    row, column = place[entries.row], place[entries.col]
    is_lower = row >= column
    below, column = (row - column)[is_lower], column[is_lower]
    # Columns of the band lie one after the other in memory, as LAPACK wants them.
    band = np.zeros((len(order), int(below.max(initial=0)) + 1)).T
    band[below, column] = entries.data[is_lower]
    solution = solveh_banded(band, values[order], overwrite_ab=True, lower=True, check_finite=False)
    return np.asarray(solution[place])
