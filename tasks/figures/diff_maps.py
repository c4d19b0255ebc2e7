"""Draw maps of what differs between two versions of a capture."""

from pathlib import Path

import numpy as np

from glint.storage.export.image_files import colour_values, write_pictures
from glint.tasks.version_diff import Difference

MAX_ANGLE_DEG = 20.0
"""Angle at the upper end of the colour scale of `normals_difference.png`."""

DEPTH_QUANTILE = 0.99
"""Quantile of absolute depth differences at the ends of the colour scale of `depth_difference.png`."""


def draw_diff_maps(difference: Difference, folder: Path) -> None:
    """Write `normals_difference.png` (0 to 20 degrees) and `depth_difference.png` (negative to positive).

    Colours run from dark blue to yellow; pixels that are missing in one of the versions are white.

    Raises:
        OutputError: the folder cannot be written.
    """
    known = np.abs(difference.depths[np.isfinite(difference.depths)])
    limit = max(float(np.quantile(known, DEPTH_QUANTILE)) if known.size else 0.0, 1e-6)
    maps = {
        "normals_difference": colour_values(difference.angles, 0.0, MAX_ANGLE_DEG),
        "depth_difference": colour_values(difference.depths, -limit, limit),
    }
    write_pictures(folder, maps)
