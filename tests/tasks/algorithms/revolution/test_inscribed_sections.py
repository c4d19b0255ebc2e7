"""Largest sections inside a contour."""

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.contours import smooth_contour
from glint.tasks.algorithms.geometry.vectors import to_camera
from glint.tasks.algorithms.revolution.inscribed_sections import inscribed_sections
from glint.tasks.algorithms.revolution.view_rays import AxisFrame
from glint.tasks.algorithms.sections.rounded_polygon import RoundedPolygon
from glint.tasks.algorithms.silhouettes.reflection_axes import ReflectionAxis
from tests.tasks.algorithms.prisms.block import INVERSE_FOCAL, Block

HEXAGON = RoundedPolygon(6, np.radians(20.0))
UPRIGHT = ReflectionAxis(np.zeros(2), np.array([1.0, 0.0]), 1.0)


def sections_inside(mask: np.ndarray, slope: float, inverse_focal: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    columns, rows = smooth_contour(mask).T
    frame = AxisFrame.of(UPRIGHT, float(np.radians(slope)), inverse_focal)
    rays = frame.rays(*to_camera(columns, rows, mask.shape[1], mask.shape[0]))
    return inscribed_sections(rays, 1.0, HEXAGON)


@pytest.mark.parametrize("inverse_focal", [0.0, INVERSE_FOCAL])
@pytest.mark.parametrize("slope", [4.0, 35.0])
def test_polygons_inside_the_contour_of_a_block_are_its_sections(slope: float, inverse_focal: float) -> None:
    block = Block(slope=slope, inverse_focal=inverse_focal)
    _, depths, _ = block.render()
    mask = np.isfinite(depths)
    heights, apothems = sections_inside(mask, slope, inverse_focal)
    inside = np.abs(heights) < 0.8 * block.half_height
    assert np.abs(apothems[inside] - block.radius).max() < 1.5
    assert (apothems < block.radius + 1.5)[np.abs(heights) < block.half_height].all()


@pytest.mark.parametrize("slope", [0.1, 0.3, 0.8])
def test_of_polygons_seen_edge_on_the_corners_touch_the_contour(slope: float) -> None:
    block = Block(slope=slope)
    heights, apothems = sections_inside(np.isfinite(block.render()[1]), slope)
    inside = np.abs(heights) < 0.8 * block.half_height
    assert np.abs(apothems[inside] - block.radius).max() < 0.2
