"""Layout of simulated frames: solids that stand on the table, or above it."""

import numpy as np
import pytest

from glint.tasks.algorithms.near_light.table_plane import TablePlane
from glint.tasks.algorithms.simulation.solids import CHROME, sphere
from glint.tasks.simulation.scene_layout import stood


@pytest.mark.parametrize("tilt", [0.0, 50.0])
@pytest.mark.parametrize("height", [0.0, 45.0])
def test_a_solid_stands_at_its_height_and_is_seen_where_it_was(tilt: float, height: float) -> None:
    turned = np.radians(tilt)
    table = TablePlane(np.array([0.0, np.sin(turned), np.cos(turned)]), -120.0)
    before = sphere(np.array([40.0, -25.0, 10.0]), 30.0, CHROME)
    after = stood(before, table, height)
    assert (after.vertices @ table.normal).min() - table.offset == pytest.approx(height)
    np.testing.assert_allclose(after.vertices[:, :2], before.vertices[:, :2])
