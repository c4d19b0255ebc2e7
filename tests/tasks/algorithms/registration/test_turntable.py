"""The axis of a turntable under a camera whose optical axis is not in the middle of the frame."""

from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.registered_views import register_on_turntable
from glint.tasks.algorithms.registration.turntable import Turntable, initial_turntable, wrapped
from tests.tasks.algorithms.multiview.figurine import body, views_at

ANGLES = np.arange(0.0, 360.0, 45.0)
DISTANCE = 400.0
"""From the camera to the axis, and its focal length: a pixel covers one unit there."""


def near_views(principal_column: float, offset: float) -> list[View]:
    """Return views of the figurine by a near camera that are not yet turned."""
    matrix = np.array([[DISTANCE, 0.0, principal_column], [0.0, DISTANCE, 47.5], [0.0, 0.0, 1.0]])
    table, away = Turntable(offset, 0.0, 0.0, ANGLES), np.array([0.0, 0.0, -DISTANCE])
    poses = [(rotation, shift + away) for rotation, shift in map(table.pose, range(len(ANGLES)))]
    return [replace(view, rotation=np.eye(3), translation=away) for view in views_at(body(), poses, matrix=matrix)]


@pytest.mark.long
@pytest.mark.parametrize("shift", [0.0, 8.0, -20.0])
def test_the_axis_is_found_wherever_the_optical_axis_is(shift: float) -> None:
    """The object stands in the middle of the frame, and so beside the optical axis."""
    views = near_views(47.5 + shift, 2.0 - shift)
    assert initial_turntable(views, ANGLES.tolist()).offset == pytest.approx(2.0 - shift, abs=2.0)
    registered = register_on_turntable(views, ANGLES.tolist())
    assert not registered.rejected and registered.turntable is not None
    assert registered.turntable.offset == pytest.approx(2.0 - shift, abs=0.2)
    assert max(registered.residuals) < 0.02


def test_angles_are_wrapped_to_half_a_turn() -> None:
    assert wrapped(np.array([-350.0, -180.0, 0.0, 179.0, 181.0, 720.0])).tolist() == [10, -180, 0, 179, -179, 0]
