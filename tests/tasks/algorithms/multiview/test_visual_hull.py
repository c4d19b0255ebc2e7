"""The visual hull of a ball between cameras around it."""

import numpy as np
import pytest

from glint.tasks.algorithms.multiview.view import SilhouetteMask, View, rotation_about_y
from glint.tasks.algorithms.multiview.visual_hull import hull_model

SHAPE, RADIUS_PX = (101, 101), 40.0


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e4])
def test_the_hull_is_the_same_in_any_unit_of_the_world(unit: float) -> None:
    """From 16 sides a ball's hull reaches 2% beyond it at most."""
    rows, columns = np.indices(SHAPE) - 50.0
    mask = SilhouetteMask(np.hypot(rows, columns) < RADIUS_PX)
    normals, confidence = np.zeros((*SHAPE, 3)), np.zeros(SHAPE)
    views = [
        View(str(turn), mask, normals, confidence, rotation_about_y(turn), np.zeros(3), (0, 0), SHAPE, pixel_size=unit)
        for turn in np.arange(0.0, 360.0, 22.5)
    ]
    model = hull_model(views, 3000)
    radii = np.linalg.norm(model.vertices, axis=1) / (unit * RADIUS_PX)
    assert radii.min() > 0.97 and radii.max() < 1.04
    # Vertices lie on the hull, not in the middle of their cells.
    assert radii[np.abs(model.vertices[:, 1]) < 0.2 * unit * RADIUS_PX].std() < 0.01
