"""The picture sheet of a model: its shaded surface from all sides."""

import numpy as np

from glint.tasks.algorithms.meshing.depth_mesh import Surface
from glint.tasks.algorithms.meshing.shading import draw_surface

AZIMUTHS_DEG = tuple(range(0, 360, 60))
"""Degrees about the vertical axis from which the sheet shows the model."""
ELEVATION_DEG = 15.0
"""Degrees above the horizontal from which the sheet shows the model."""
VIEW_PX = 260
"""Side of the picture of one view."""


def model_sheet(surface: Surface) -> np.ndarray:
    """Draw a surface from all sides, in two rows of three: (2 VIEW_PX, 3 VIEW_PX) uint8."""
    pictures = [draw_surface(surface, float(azimuth), ELEVATION_DEG, VIEW_PX) for azimuth in AZIMUTHS_DEG]
    return np.vstack([np.hstack(pictures[:3]), np.hstack(pictures[3:])])
