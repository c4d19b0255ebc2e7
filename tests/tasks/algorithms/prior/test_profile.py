from itertools import pairwise

import numpy as np
import pytest

from glint.tasks.algorithms.prior.reflection_axes import ReflectionAxis
from glint.tasks.algorithms.prior.surface_of_revolution import SurfaceOfRevolution

GLASS = np.array(
    [(61.4, -177.0), (61.4, -172.3), (11.8, -165.2), (5.9, -153.4), (5.9, -59.0), (47.2, -23.6), (68.4, 23.6),
     (68.4, 82.6), (59.0, 165.2)]
)  # fmt: skip
"""Radius and height of the corners of a glass with a thin foot, in pixels."""


def silhouette(tilt: float, shape: tuple[int, int] = (400, 180)) -> tuple[np.ndarray, ReflectionAxis]:
    """Return the silhouette of the glass, its axis a fraction of a pixel beside the middle, and that axis."""
    rows, columns = np.indices(shape)
    axis = ReflectionAxis(np.array([-0.13, -0.21]), np.array([1.0, 0.0]), 1.0)
    x, y = columns - (shape[1] - 1) / 2 - axis.point[0], (shape[0] - 1) / 2 - rows - axis.point[1]
    mask = np.zeros(shape, bool)
    for (low_radius, low), (high_radius, high) in pairwise(GLASS):
        for share in np.linspace(0.0, 1.0, 150):
            radius, height = low_radius + share * (high_radius - low_radius), low + share * (high - low)
            mask |= (x / radius) ** 2 + ((y - height * np.cos(tilt)) / (radius * np.sin(tilt))) ** 2 <= 1.0
    return mask, axis


@pytest.mark.parametrize("turned_over", [False, True])
def test_a_thin_foot_keeps_its_radius_and_both_its_edges(turned_over: bool) -> None:
    tilt = np.radians(14.0)
    mask, axis = silhouette(tilt)
    if turned_over:
        mask, axis, tilt = mask[::-1], ReflectionAxis(axis.point * [1, -1], axis.normal, 1.0), -tilt
    surface = SurfaceOfRevolution.from_silhouette(mask, axis, tilt)
    heights, squared = (-surface.heights[::-1], surface.squared_radii[::-1]) if turned_over else (
        surface.heights, surface.squared_radii
    )  # fmt: skip
    radii = np.sqrt(squared)
    foot = (heights > -176.0) & (heights < -173.5)
    assert np.abs(radii[foot] - 61.4).max() < 1.0
    assert radii[heights < -178.5].max() == 0.0
    # The plate is hidden by the foot's far edge: it is drawn at the height of that edge, the stem above it.
    assert radii[(heights > -170.5) & (heights < -161.0)].max() < 8.0
    for height, radius in ((-100.0, 5.9), (0.0, 57.8), (50.0, 68.4), (120.0, 64.1), (160.0, 59.6)):
        assert np.interp(height, heights, radii) == pytest.approx(radius, abs=0.5)
    assert radii[heights > 167.0].max() == 0.0
