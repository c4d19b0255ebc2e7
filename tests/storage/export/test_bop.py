"""The diameter of a model, which poses are judged by."""

import numpy as np
from scipy.spatial.distance import pdist

from glint.storage.export.bop import _BLOCK, _diameter


def test_the_diameter_is_exact_for_bodies_of_many_blocks() -> None:
    points = np.random.default_rng(0).normal(size=(6 * _BLOCK + 7, 3))
    sphere = points / np.linalg.norm(points, axis=1, keepdims=True)
    for body in (points, sphere, sphere * [1.0, 1.0, 0.1], points[:5]):
        assert np.isclose(_diameter(body), pdist(body).max(), rtol=1e-12)
