import numpy as np
import pytest

from glint.tasks.algorithms.prior.view_rays import entry_depths

RADIUS = 50.0


@pytest.mark.parametrize("tilt", [0.0, 35.0, -80.0])
@pytest.mark.parametrize("far", [False, True])
def test_rays_enter_a_sphere_at_its_surface(tilt: float, far: bool) -> None:
    heights = np.arange(-RADIUS, RADIUS + 0.01, 0.01)
    side, up = (axis.ravel() for axis in np.meshgrid(np.linspace(-60, 60, 25), np.linspace(-60, 60, 25)))
    squared_radii = np.maximum(RADIUS**2 - heights**2, 0.0)
    depths = entry_depths(side, up, np.radians(tilt), heights, squared_radii, far)
    square = RADIUS**2 - side**2 - up**2
    assert np.isnan(depths[square < 0.0]).all()
    inside = square > 0.1 * RADIUS**2
    expected = np.sqrt(square[inside]) * (-1.0 if far else 1.0)
    assert np.abs(depths[inside] - expected).max() < 0.01


def test_the_nearer_of_two_bulges_is_entered() -> None:
    # Seen along the axis but for 40 degrees, the upper bulge stands before the lower one.
    heights = np.arange(-60.0, 60.5, 0.5)
    squared_radii = np.where(np.abs(np.abs(heights) - 40.0) < 15.0, 30.0**2, 5.0**2)
    tilt = np.radians(50.0)
    up = np.array([40.0 * np.cos(tilt), -40.0 * np.cos(tilt)])
    near = entry_depths(np.zeros(2), up, tilt, heights, squared_radii, False)
    heights_hit = near * np.sin(tilt) + up * np.cos(tilt)
    assert heights_hit[0] > 25.0
    assert near[0] > near[1]
