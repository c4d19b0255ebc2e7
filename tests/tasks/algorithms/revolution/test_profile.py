from itertools import pairwise

import numpy as np
import pytest

from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from glint.tasks.algorithms.silhouettes.reflection_axes import ReflectionAxis

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


def test_a_stem_is_found_by_steps_longer_than_the_height_in_which_it_is_looked_for() -> None:
    tilt, enlarged = np.radians(14.0), 11
    mask, axis = silhouette(tilt)
    mask = mask.repeat(enlarged, axis=0).repeat(enlarged, axis=1)
    axis = ReflectionAxis(enlarged * axis.point, axis.normal, 1.0)
    surface = SurfaceOfRevolution.from_silhouette(mask, axis, tilt, step=12.5)
    heights, radii = surface.heights / enlarged, np.sqrt(surface.squared_radii) / enlarged
    assert np.interp(-174.5, heights, radii) == pytest.approx(61.4, abs=2.0)
    assert radii[(heights > -170.0) & (heights < -161.0)].max() < 12.0


@pytest.mark.parametrize(
    ("tilt", "enlarged", "step"), [(66.0, 1, 0.5), (-72.0, 1, 0.5), (50.0, 1, 2.0), (15.0, 4, 4.0), (-40.0, 4, 8.0)]
)
def test_the_tip_of_an_end_that_is_seen_obliquely_is_no_stem(tilt: float, enlarged: int, step: float) -> None:
    columns, rows = np.meshgrid(np.arange(100 * enlarged), np.arange(190 * enlarged))
    x, y = columns - (100 * enlarged - 1) / 2, (190 * enlarged - 1) / 2 - rows
    radius, half_height = 45.0 * enlarged, 50.0 * enlarged
    beyond = np.maximum(np.abs(y) - half_height * np.cos(np.radians(tilt)), 0.0)
    mask = x**2 + (beyond / np.sin(np.radians(tilt))) ** 2 < radius**2
    axis = ReflectionAxis(np.zeros(2), np.array([1.0, 0.0]), 1.0)
    surface = SurfaceOfRevolution.from_silhouette(mask, axis, np.radians(tilt), step)
    assert surface.end_height == pytest.approx(np.sign(tilt) * half_height, abs=3.0 * max(step, 1.0))
    assert surface.end_radius == pytest.approx(radius, rel=0.03)


def test_normals_of_the_stem_raise_the_plate_of_the_foot() -> None:
    tilt = np.radians(14.0)
    mask, axis = silhouette(tilt)
    heights = np.arange(-185.0, 175.0, 0.5)
    radii = np.interp(heights, GLASS[1:, 1], GLASS[1:, 0], left=0.0, right=0.0)
    radii[(heights >= GLASS[0, 1]) & (heights <= GLASS[1, 1])] = GLASS[0, 0]
    truth = SurfaceOfRevolution(axis, tilt, heights, radii**2, np.gradient(radii**2, heights) / 2.0)
    rows, columns = np.nonzero(mask)
    x, y = columns - (mask.shape[1] - 1) / 2, (mask.shape[0] - 1) / 2 - rows
    normals = truth.normals(x, y)
    is_observed = normals[:, 2] > np.cos(np.radians(42.0))
    fitted = SurfaceOfRevolution.from_silhouette(mask, axis, tilt)
    risen = fitted.with_risen_plates(x[is_observed], y[is_observed], normals[is_observed])
    for height, radius in ((-155.0, 6.7), (-160.0, 9.2), (-164.0, 11.2), (-168.0, 31.3), (-171.0, 52.2)):
        assert np.interp(height, risen.heights, np.sqrt(risen.squared_radii)) == pytest.approx(radius, abs=4.0)
    unknown = fitted.with_risen_plates(x[:0], y[:0], normals[:0])
    radii = np.interp((-163.0, -166.0, -169.0, -172.0), unknown.heights, np.sqrt(unknown.squared_radii))
    assert radii == pytest.approx((6.0, 6.0, 32.0, 56.0), abs=4.0)
