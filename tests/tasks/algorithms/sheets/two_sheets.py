"""Accepted normals of two sheets."""

import numpy as np


def tilted(degrees: float) -> np.ndarray:
    return np.array([np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees))])


def two_sheets() -> np.ndarray:
    """Left and right halves 20 degrees apart, without normals above; a scrap of four pixels stands apart below."""
    normals = np.full((40, 60, 3), np.nan)
    normals[10:30, :30], normals[10:30, 30:] = tilted(0.0), tilted(20.0)
    normals[35:37, 10:12] = tilted(0.0)
    return normals
