import numpy as np
import pytest

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.near_light.ellipse import is_confirmed_ellipse

SPHERE, SHAPE = Sphere(60.3, 59.6, 40.0), (120, 120)
FRAME_CENTRE, FOCAL = (180.3, 59.6), 260.0
"""The frame's centre lies to the right: a near camera sees an ellipse that is a tenth longer along x than along y."""


def contour_frames(elongation: float, direction_deg: float) -> np.ndarray:
    """Return 16 noisy frames (16, 120, 120) of a disc whose level and whose background's change; half axes differ by
    `elongation` radii, the longer one in a direction, y down."""
    generator = np.random.default_rng(4)
    rows, columns = np.indices(SHAPE)
    right, down = columns - SPHERE.x, rows - SPHERE.y
    radius = SPHERE.radius * (
        1.0 + 0.5 * elongation * np.cos(2.0 * (np.arctan2(down, right) - np.radians(direction_deg)))
    )
    inside = np.clip(radius - np.hypot(right, down) + 0.5, 0.0, 1.0)
    levels = generator.uniform(20.0, 200.0, (16, 2))
    frames = levels[:, :1, None] * inside + levels[:, 1:, None] * (1.0 - inside)
    return np.asarray(frames + generator.normal(0.0, 2.0, frames.shape), np.float32)


@pytest.mark.parametrize(
    ("elongation", "direction_deg", "confirmed"),
    [(0.1, 0.0, True), (0.06, 0.0, True), (0.0, 0.0, False), (0.1, 90.0, False), (0.1, 45.0, False)],
)
def test_only_an_ellipse_towards_the_frames_centre_is_that_of_a_near_camera(
    elongation: float, direction_deg: float, confirmed: bool
) -> None:
    frames = contour_frames(elongation, direction_deg)
    assert is_confirmed_ellipse(frames, SPHERE, FRAME_CENTRE, FOCAL) == confirmed
