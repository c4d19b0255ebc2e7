import numpy as np

from glint.tasks.algorithms.silhouettes.reflection_axes import reflection_axes
from tests.tasks.algorithms.revolution.beaker import camera_positions


def test_a_tilted_axis_is_found_where_it_is() -> None:
    x, y = camera_positions()
    normal = np.array([np.cos(0.3), np.sin(0.3)])
    side, up = x * normal[0] + y * normal[1] - 7.0, -x * normal[1] + y * normal[0]
    mask = (side / 30) ** 2 + (np.abs(up) / 75) ** 2 < 1
    axes = reflection_axes(mask)
    cosines = [abs(float(axis.normal @ normal)) for axis in axes]
    best = axes[int(np.argmax(cosines))]
    assert max(cosines) > np.cos(np.radians(1.0))
    assert abs(float(best.point @ normal) - 7.0) < 1.0


def test_the_axis_of_a_thin_stem_is_found_between_the_angles_that_are_tried_first() -> None:
    x, y = camera_positions()
    turn = np.radians(1.5)
    side, up = np.abs(x * np.cos(turn) + y * np.sin(turn)), y * np.cos(turn) - x * np.sin(turn)
    bowl, stem, foot = (side < 38.0) & (up > 45.0), (side < 2.5) & (up > -66.0), (side < 25.0) & (up < -60.0)
    (axis,) = reflection_axes((bowl | stem | foot) & (up > -66.0) & (up < 66.0))
    assert abs(float(axis.normal @ (np.cos(turn), np.sin(turn)))) > np.cos(np.radians(0.5))


def test_a_line_has_no_axes() -> None:
    line = np.zeros((20, 40), bool)
    line[8:10, 5:35] = True
    assert reflection_axes(line) == []
