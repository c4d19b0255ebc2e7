"""Surface nets of a solid that touches itself in edges and corners: the mesh stays manifold."""

from itertools import pairwise

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.meshing.implicit import surface_nets


def blobs(points: np.ndarray) -> np.ndarray:
    """A random solid, decided cell by cell: every way in which eight corners can be inside occurs."""
    values = ndimage.gaussian_filter(np.random.default_rng(0).normal(size=(24, 24, 24)), 0.7)
    return np.asarray(ndimage.map_coordinates(100.0 * values, points.T, order=0, mode="nearest"))


def test_every_edge_has_two_triangles_and_every_vertex_one_fan() -> None:
    low, high = np.full(3, 2.0), np.full(3, 21.0)
    vertices, triangles = surface_nets(blobs, low, high, 1.0)
    directed = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    edges, counts = np.unique(np.sort(directed, axis=1), axis=0, return_counts=True)
    assert (counts == 2).all() and len(np.unique(directed, axis=0)) == 2 * len(edges)
    # The triangles of a vertex are one ring: from any of them all others are reached over their common edges.
    following: list[dict[int, int]] = [{} for _ in vertices]
    for triangle in triangles.tolist():
        for (corner, after), before in zip(pairwise([*triangle, triangle[0]]), np.roll(triangle, 1), strict=True):
            following[corner][after] = int(before)
    for ring in following:
        start = at = next(iter(ring))
        length = 1
        while (at := ring[at]) != start:
            length += 1
        assert length == len(ring)
