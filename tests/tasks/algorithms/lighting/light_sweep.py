"""Light sweeps over the hemisphere before the object."""

from collections.abc import Callable

import numpy as np

from glint.tasks.algorithms.geometry.vectors import half_vectors_of


def sweep(count: int, keep: Callable[[np.ndarray], np.ndarray] | None = None, seed: int = 0) -> np.ndarray:
    """Return half vectors of lights spread evenly in area over the hemisphere; keep: selects lights (N, 3)."""
    z, azimuth = np.random.default_rng(seed).random((2, count))
    radius = np.sqrt(1 - z**2)
    lights = np.stack([radius * np.cos(2 * np.pi * azimuth), radius * np.sin(2 * np.pi * azimuth), z], axis=-1)
    return half_vectors_of(lights if keep is None else lights[keep(lights)])
