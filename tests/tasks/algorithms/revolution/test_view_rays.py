import numpy as np
import pytest

from glint.tasks.algorithms.revolution.view_rays import AxisFrame, AxisRays, entry_depths
from glint.tasks.algorithms.silhouettes.reflection_axes import ReflectionAxis

RADIUS = 50.0
HEIGHTS = np.arange(-RADIUS, RADIUS + 0.01, 0.01)
UPRIGHT = ReflectionAxis(np.zeros(2), np.array([1.0, 0.0]), 1.0)
FOCAL = 400.0
TURN = np.radians(20.0)
SLANTED = ReflectionAxis(np.array([35.0, -12.0]), np.array([np.cos(TURN), np.sin(TURN)]), 1.0)
X, Y = np.array([-50.0, 0.0, 80.0, 35.0]), np.array([10.0, 0.0, -70.0, -12.0])


def upright_rays(x: np.ndarray, y: np.ndarray, tilt: float, inverse_focal: float = 0.0) -> AxisRays:
    """Return the rays of x, y (N,) in the frame of an upright axis with a tilt in degrees."""
    return AxisFrame.of(UPRIGHT, np.radians(tilt), inverse_focal).rays(x, y)


@pytest.mark.parametrize("tilt", [0.0, 35.0, -80.0])
@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("inverse_focal", [0.0, 1.0 / 200.0])
def test_rays_enter_a_sphere_at_its_surface(tilt: float, far: bool, inverse_focal: float) -> None:
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(-60, 60, 25), np.linspace(-60, 60, 25)))
    squared_radii = np.maximum(RADIUS**2 - HEIGHTS**2, 0.0)
    depths = entry_depths(upright_rays(x, y, tilt, inverse_focal), HEIGHTS, squared_radii, 100.0, far)
    # On the ray (x (1 - k z), y (1 - k z), z): a quadratic equation for z.
    square = x**2 + y**2
    a, b, c = 1.0 + inverse_focal**2 * square, -inverse_focal * square, square - RADIUS**2
    discriminant = b**2 - a * c
    assert np.isnan(depths[discriminant < 0.0]).all()
    inside = discriminant > 0.1 * RADIUS**2
    expected = (-b + np.sqrt(np.maximum(discriminant, 0.0)) * (-1.0 if far else 1.0)) / a
    assert inside.sum() > 200
    assert np.abs(depths - expected)[inside].max() < 0.02


def test_of_two_bulges_the_nearer_is_entered_and_the_farther_left() -> None:
    # The view is 20 degrees from the axis, whose upper end is nearer: the ray meets both bulges, and the neck between.
    heights = np.arange(-60.0, 60.5, 0.5)
    squared_radii = np.where(np.abs(np.abs(heights) - 40.0) < 15.0, 30.0**2, 5.0**2)
    for far, sign in ((False, 1.0), (True, -1.0)):
        depth = entry_depths(upright_rays(np.zeros(1), np.zeros(1), 70.0), heights, squared_radii, 70.0, far)
        height = float(depth[0] * np.sin(np.radians(70.0)))
        assert 25.0 < sign * height <= 60.0


@pytest.mark.parametrize("tilt", [0.0, 25.0, -40.0])
@pytest.mark.parametrize("inverse_focal", [0.0, 1.0 / FOCAL])
def test_rays_pass_through_their_pixel_and_the_camera(tilt: float, inverse_focal: float) -> None:
    frame = AxisFrame.of(SLANTED, np.radians(tilt), inverse_focal)
    assert np.allclose(frame.vectors @ frame.vectors.T, np.eye(3))
    rays = frame.rays(X, Y)
    pixels = rays.at(np.zeros(4)) @ frame.vectors + np.append(SLANTED.point, 0.0)
    assert np.allclose(pixels, np.column_stack([X, Y, np.zeros(4)]))
    ends = rays.at(np.full(4, FOCAL)) @ frame.vectors + np.append(SLANTED.point, 0.0)
    assert np.allclose(ends, [0.0, 0.0, FOCAL] if inverse_focal else np.column_stack([X, Y, np.full(4, FOCAL)]))


@pytest.mark.parametrize("tilt", [0.0, 25.0, -40.0])
def test_the_axis_is_seen_as_its_image(tilt: float) -> None:
    frame = AxisFrame.of(SLANTED, np.radians(tilt), 1.0 / FOCAL)
    points = np.append(SLANTED.point, 0.0) + np.linspace(-80.0, 80.0, 9)[:, None] * frame.upward
    image = points[:, :2] / (1.0 - points[:, 2:] / FOCAL)
    assert np.abs((image - SLANTED.point) @ SLANTED.normal).max() < 1e-9
    assert np.ptp((image - SLANTED.point) @ SLANTED.direction) > 100.0


def test_a_camera_near_the_middle_sees_the_top_from_below_and_the_bottom_from_above() -> None:
    heights = np.array([-100.0, 0.0, 100.0])
    near, far = (AxisFrame.of(UPRIGHT, 0.0, inverse_focal).tilts(heights) for inverse_focal in (1.0 / FOCAL, 0.0))
    assert near == pytest.approx([np.arctan(0.25), 0.0, -np.arctan(0.25)])
    assert far == pytest.approx(0.0)
    assert AxisFrame.of(UPRIGHT, 0.3).tilts(heights) == pytest.approx(0.3)
