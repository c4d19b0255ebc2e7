import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.prior.swept_normals import BEYOND_DEG, SweptNormals
from tests.tasks.algorithms.prior.swept_cones import SWEEP_DEG, cone, swept_cone, tilted


def test_lights_reach_what_they_show_and_nothing_beyond() -> None:
    swept = swept_cone()
    normals = np.stack([tilted(20.0), tilted(39.0, 130.0), tilted(50.0), np.full(3, np.nan)])
    assert swept.flashes(normals).tolist() == [True, True, False, False]
    moved = swept.nearest_beyond(normals[:3])
    assert np.allclose(np.linalg.norm(moved, axis=-1), 1.0)
    tilts = angles(moved[:2], tilted(0.0))
    assert tilts.min() > SWEEP_DEG + BEYOND_DEG - 2.0 and tilts.max() < SWEEP_DEG + BEYOND_DEG + 2.0
    assert np.degrees(np.arctan2(moved[1, 1], moved[1, 0])) == pytest.approx(130.0, abs=3.0)
    assert angles(moved[2], tilted(50.0)) < 0.01


def test_no_surface_hides_between_two_rings_of_lights_but_inside_a_single_one() -> None:
    spiral, ring = SweptNormals.of(cone(step_deg=6.0)), SweptNormals.of(cone(inner_deg=25.0))
    assert spiral is not None and ring is not None
    between = tilted(21.0)
    assert not spiral.flashes(between)
    assert angles(spiral.nearest_beyond(between), tilted(0.0)) > SWEEP_DEG - 5.0
    assert angles(ring.nearest_beyond(tilted(5.0)), tilted(5.0)) < 0.01


def test_without_candidates_nothing_is_known() -> None:
    assert SweptNormals.of(np.full((2, 5, 5, 3), np.nan, np.float32)) is None


def test_the_nearest_normals_beyond_the_lights_surround_the_view() -> None:
    around = np.stack([tilted(30.0, azimuth) for azimuth in np.arange(0.0, 360.0, 5.0)])
    assert np.abs(swept_cone().nearest_beyond(around)[:, :2].mean(axis=0)).max() < 0.005
