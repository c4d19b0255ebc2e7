"""Views of the figurine whose silhouettes contradict each other: which are rejected, and when that cannot be known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.registered_views import register_by_matrices, register_on_turntable
from glint.tasks.algorithms.registration.turntable import ANGLE_ERROR_DEG, Turntable, relative_turns
from glint.tasks.algorithms.registration.view_rejection import mistaken_angles
from tests.tasks.algorithms.multiview.figurine import body, views_of

ANGLES = np.arange(0.0, 360.0, 45.0)


@pytest.fixture(scope="module")
def views() -> list[View]:
    return views_of(body(), Turntable(2.0, 0.0, 0.0, ANGLES))


@pytest.mark.long
def test_a_view_that_bends_the_axis_takes_no_right_view_with_it(views: list[View]) -> None:
    """As a mirrored video does, whose object is in the other half of the frame."""
    moved = replace(views[3], origin=(60, 0))
    registered = register_on_turntable([*views[:3], moved, *views[4:]], ANGLES.tolist())
    assert [view.name for view in registered.rejected] == ["view-3"] and max(registered.residuals) < 0.1
    assert registered.turntable is not None and registered.turntable.offset == pytest.approx(2.0, abs=0.1)


@pytest.mark.long
def test_no_angle_is_offered_for_a_mask_that_is_wrong(views: list[View]) -> None:
    swollen = views[3].with_mask(ndimage.binary_dilation(views[3].mask, iterations=3))
    registered = register_on_turntable([*views[:3], swollen, *views[4:]], ANGLES.tolist())
    (rejected,) = registered.rejected
    assert rejected.name == "view-3" and rejected.angle is None and "would fit" not in rejected.reason


def test_two_views_that_contradict_each_other_give_no_model(views: list[View]) -> None:
    raised = views[2].with_pose(views[2].rotation, views[2].translation + np.array([0.0, 9.0, 0.0]))
    with pytest.raises(UnusableCapture, match="too few agree to know which are wrong: at least one of view-0, view-2"):
        register_by_matrices([views[0], raised])


@pytest.mark.long
def test_of_three_views_that_all_contradict_each_other_none_is_known_to_be_right(views: list[View]) -> None:
    raised, lowered = (
        views[number].with_pose(views[number].rotation, views[number].translation + np.array([0.0, change, 0.0]))
        for number, change in ((2, 9.0), (4, -9.0))
    )
    with pytest.raises(UnusableCapture, match="too few agree to know which are wrong") as caught:
        register_by_matrices([views[0], raised, lowered])
    assert "check the poses of all views" in caught.value.remedy
    assert [view.name for view in register_by_matrices([views[0], raised, views[4]]).rejected] == ["view-2"]


@pytest.mark.long
def test_a_mistake_among_the_stated_angles_leaves_the_others_where_they_are(views: list[View]) -> None:
    stated = ANGLES + 12.0 * (np.arange(8) == 1)
    registered = register_on_turntable(views, stated.tolist())
    assert registered.turntable is not None and not registered.rejected
    assert np.abs(relative_turns(ANGLES, registered.turntable.angles)).max() < 0.3
    assert (registered.angle_errors > ANGLE_ERROR_DEG).tolist() == (stated != ANGLES).tolist()


def test_angles_that_are_right_are_held(views: list[View]) -> None:
    table = Turntable(2.0, 0.0, 0.0, ANGLES)
    same, errors = mistaken_angles(views, table, ANGLES)
    assert same is table and (errors == ANGLE_ERROR_DEG).all()
