"""Corrections of stated angles and scales: of all views together none, of single ones a warning."""

from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.registration.registered_views import RegisteredViews
from glint.tasks.algorithms.registration.turntable import Turntable
from glint.tasks.model.corrections import corrected_views, correction_warnings
from tests.tasks.algorithms.multiview.figurine import body, views_of

GIVEN = np.array([0.0, 90.0, 180.0, 270.0])


@pytest.fixture(scope="module")
def registered() -> RegisteredViews:
    """Four views whose stated angles are right."""
    table = Turntable(0.0, 0.0, 0.0, GIVEN)
    return RegisteredViews(tuple(views_of(body(), table)), (), (), table, GIVEN, np.ones(4))


def corrected(registered: RegisteredViews, by: list[float]) -> list[str]:
    table = Turntable(0.0, 0.0, 0.0, GIVEN + by)
    return [warning.message for warning in correction_warnings(replace(registered, turntable=table))]


def test_small_corrections_and_that_of_all_are_no_mistakes(registered: RegisteredViews) -> None:
    assert corrected(registered, [0.5, -0.8, 0.0, 1.0]) == []
    assert corrected(registered, [7.0, 7.0, 7.0, 7.0]) == []
    assert corrected(registered, [-360.0, 0.0, 360.0, 0.0]) == []


def test_a_large_correction_names_the_view_and_its_angle(registered: RegisteredViews) -> None:
    (message,) = corrected(registered, [0.0, 7.3, 0.0, -1.0])
    assert f"angle of {registered.views[1].name} is stated as 90 degrees" in message and "by +7.3" in message


def test_angles_that_were_searched_are_not_stated(registered: RegisteredViews) -> None:
    searched = replace(registered, searched=(registered.views[1].name,))
    assert corrected(searched, [0.0, 7.3, 0.0, 0.0]) == []


def test_views_without_a_turntable_have_no_angles(registered: RegisteredViews) -> None:
    assert correction_warnings(replace(registered, turntable=None)) == []


def test_a_wrong_step_is_named_once_and_angles_as_they_were_stated(registered: RegisteredViews) -> None:
    table = Turntable(0.0, 0.0, 0.0, GIVEN + np.array([0.0, 7.0, 0.0, 0.0]))
    stepped = replace(registered, turntable=table, step_factor=1.25)
    first, second = (warning.message for warning in correction_warnings(stepped))
    assert first.startswith("all angles of the turntable were multiplied by 1.250")
    assert "is stated as 72 degrees" in second


def test_a_large_correction_of_a_scale_names_the_view(registered: RegisteredViews) -> None:
    scaled = replace(registered, turntable=None, scale_factors={"left": 1.004, "right": 0.972})
    (message,) = (warning.message for warning in correction_warnings(scaled))
    assert message.startswith("the scale of right was corrected by -2.8%")


def test_views_count_as_corrected_by_their_scale_or_their_angle(registered: RegisteredViews) -> None:
    first, second, *_ = (view.name for view in registered.views)
    table = Turntable(0.0, 0.0, 0.0, GIVEN + np.array([0.0, 7.3, 0.0, 0.0]))
    both = replace(registered, turntable=table, scale_factors={first: 0.97})
    assert corrected_views(both) == {first, second} and not corrected_views(registered)
