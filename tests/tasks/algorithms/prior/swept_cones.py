"""Half vectors of lights that fill a cone around the view."""

from functools import cache

import numpy as np

from glint.tasks.algorithms.prior.swept_normals import SweptNormals

SWEEP_DEG = 40.0
"""Angle to the view up to which the lights of these scenes reach normals."""
INRADIUS = 40.0


def cone(step_deg: float = 1.0, inner_deg: float = 0.0) -> np.ndarray:
    """Candidates (3, N, 1, 3): half vectors `step_deg` apart, between two angles to the view."""
    tilts = np.radians(np.arange(max(inner_deg, step_deg), SWEEP_DEG, step_deg))
    turns = np.radians(np.arange(0.0, 360.0, 1.0))
    tilt, turn = (grid.ravel() for grid in np.meshgrid(tilts, turns))
    half_vectors = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], axis=-1)
    return np.repeat(half_vectors[None, :, None], 3, axis=0).astype(np.float32)


def tilted(degrees: float, azimuth_deg: float = 0.0) -> np.ndarray:
    tilt, turn = np.radians(degrees), np.radians(azimuth_deg)
    return np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])


@cache
def swept_cone() -> SweptNormals:
    result = SweptNormals.of(cone())
    assert result is not None
    return result
