"""Sheets that a user can be asked about: connected candidates of one label, as far as an answer reaches.

For sheets see `sheet_graph`. A sheet that wanders over half the object may be partly true and partly false
where two sheets cross; it is cut into patches, so that one highlight stands for the whole of each.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from glint.tasks.algorithms.geometry.vectors import angles

PATCH_INRADII = 0.6
"""Side of the largest patch, in inradii: the influence of a mark in its middle reaches its borders."""
MIN_PATCH_NODES = 3
"""Nodes below which a patch may be noise; a few pixels can hold a wide gap between them."""


@dataclass(frozen=True, slots=True)
class Patches:
    """Patches of sheets: for each node of a patch its patch's number, layer, row and column (all (N,) int).

    Nodes are ordered by patch; `count` patches are numbered from 0.
    """

    number: np.ndarray
    layer: np.ndarray
    row: np.ndarray
    column: np.ndarray
    count: int

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Average values (N,) of the nodes over each patch: (count,)."""
        return np.bincount(self.number, values, self.count) / np.bincount(self.number, minlength=self.count)

    def sum(self, values: np.ndarray) -> np.ndarray:
        """Add up values (N,) of the nodes over each patch: (count,)."""
        return np.bincount(self.number, values, self.count)

    def of(self, values: np.ndarray) -> np.ndarray:
        """Return values (K, H, W, ..) at the nodes: (N, ..)."""
        return values[self.layer, self.row, self.column]

    def exterior(self, labels: np.ndarray) -> np.ndarray:
        """Return which patches (count,) bool are exterior by labels (K, H, W), nonzero = exterior."""
        return self.mean(self.of(labels) > 0) > 0.5

    def angles_to(self, candidates: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return the angles (N,), degrees, between the nodes of candidates (K, H, W, 3) and the normals (H, W, 3)."""
        return angles(self.of(candidates), normals[self.row, self.column])


def cut_patches(nodes: np.ndarray, ties: sparse.csr_matrix, labels: np.ndarray, inradius: float) -> Patches:
    """Cut sheets into patches of one label each.

    Args:
        nodes, ties: of `sheets.sheet_graph.sheet_graph`.
        labels: (K, H, W), nonzero = exterior.
        inradius: of the mask, in pixels.
    """
    present = nodes >= 0
    layer, row, column = np.nonzero(present)
    side = max(PATCH_INRADII * inradius, 4.0)
    block = np.stack([row // side, column // side, labels[present] > 0], axis=-1).astype(int)
    pairs = ties.tocoo()
    same = (block[pairs.row] == block[pairs.col]).all(axis=-1)
    kept = sparse.coo_matrix((np.ones(same.sum()), (pairs.row[same], pairs.col[same])), shape=ties.shape)
    numbers = connected_components(kept, directed=False)[1]
    large = np.bincount(numbers) >= MIN_PATCH_NODES
    kept_nodes = np.flatnonzero(large[numbers])
    renumbered = (np.cumsum(large) - 1)[numbers[kept_nodes]]
    order = np.argsort(renumbered, kind="stable")
    at = kept_nodes[order]
    return Patches(renumbered[order], layer[at], row[at], column[at], int(large.sum()))
