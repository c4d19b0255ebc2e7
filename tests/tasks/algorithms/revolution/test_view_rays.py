import numpy as np
import pytest

from glint.tasks.algorithms.revolution.view_rays import entry_depths

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


def test_of_two_bulges_the_nearer_is_entered_and_the_farther_left() -> None:
    # The view is 20 degrees from the axis, whose upper end is nearer: the ray meets both bulges, and the neck between.
    heights = np.arange(-60.0, 60.5, 0.5)
    squared_radii = np.where(np.abs(np.abs(heights) - 40.0) < 15.0, 30.0**2, 5.0**2)
    tilt = np.radians(70.0)
    for far, sign in ((False, 1.0), (True, -1.0)):
        depth = entry_depths(np.zeros(1), np.zeros(1), tilt, heights, squared_radii, far)
        height = float(depth[0] * np.sin(tilt))
        assert 25.0 < sign * height <= 60.0
