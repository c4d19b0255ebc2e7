"""What the normals of the figurine's views say of their poses, in the confidence of the model and in warnings."""

from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.multiview.reconstruction import coarse_model
from glint.tasks.algorithms.registration.registered_views import RegisteredViews
from glint.tasks.algorithms.registration.turntable import Turntable, views_on_turntable
from glint.tasks.model.pose_doubts import doubted_model, pose_doubts, with_doubts
from tests.tasks.algorithms.multiview.figurine import body, true_model, views_of

ANGLES = np.arange(0.0, 360.0, 45.0)
TABLE = Turntable(0.0, 0.0, 0.0, ANGLES)


def registered_at(stated: np.ndarray, chosen: slice = slice(None), true_angles: np.ndarray = ANGLES) -> RegisteredViews:
    """Chosen views of a turntable that turned by 45 degrees each, registered as they are stated."""
    table = replace(TABLE, angles=stated[chosen])
    views = views_on_turntable(views_of(body(), replace(TABLE, angles=true_angles))[chosen], table)
    return RegisteredViews(tuple(views), (), (0.0,) * len(views), table, table.angles, np.ones(len(views)))


@pytest.mark.long
def test_a_turntable_that_turned_the_other_way_leaves_nothing_confident() -> None:
    six = np.arange(0.0, 360.0, 60.0)
    registered = registered_at(-six, true_angles=six)
    model = coarse_model(registered.views)
    doubts = pose_doubts(registered, model)
    (warning,) = doubts.warnings
    assert warning.message.startswith("the normals of the views contradict their poses")
    assert "negate all angles" in warning.message
    before, after = model.confidence, with_doubts(model, registered.views, registered.views, doubts).confidence
    assert before.max() > 0.9 and after.max() < 0.6


@pytest.mark.long
def test_right_poses_are_not_doubted() -> None:
    registered = registered_at(ANGLES)
    doubts = pose_doubts(registered, true_model(body()))
    assert not doubts.warnings and (doubts.trust == 1.0).all()


@pytest.mark.parametrize("max_triangles", [None, 300])
def test_right_poses_are_known_of_a_reduced_model_too(max_triangles: int | None) -> None:
    """300 triangles have 20 vertices that two neighbouring views show."""
    registered = registered_at(ANGLES)
    model, doubts = doubted_model(true_model(body()), registered.views, registered, max_triangles)
    assert not doubts.warnings and (doubts.trust == 1.0).all()
    assert max_triangles is None or len(model.triangles) <= max_triangles


def test_views_that_share_nothing_are_not_confirmed() -> None:
    registered = registered_at(ANGLES, slice(None, None, 4))
    doubts = pose_doubts(registered, true_model(body()))
    (warning,) = doubts.warnings
    assert "nothing confirms their poses" in warning.message and doubts.trust.tolist() == [0.9, 0.9]


@pytest.mark.slow
def test_four_views_that_share_nothing_are_held_against_models_of_each_other() -> None:
    stated = registered_at(ANGLES, slice(None, None, 2))
    right = pose_doubts(stated, true_model(body()))
    assert not right.warnings and (right.trust == 1.0).all()
    reversed_ = pose_doubts(registered_at(-ANGLES, slice(None, None, 2)), coarse_model(stated.views))
    (warning,) = reversed_.warnings
    assert "they agree better if the turntable turned clockwise" in warning.message and reversed_.trust.max() < 0.5


def test_a_view_whose_normals_contradict_the_others_is_named() -> None:
    registered = registered_at(ANGLES)
    views = list(registered.views)
    views[3] = replace(views[3], normals=views[3].normals[..., [1, 0, 2]])
    doubts = pose_doubts(replace(registered, views=tuple(views)), true_model(body()))
    (warning,) = doubts.warnings
    assert warning.message.startswith("the normals of view-3 contradict the other views'")
    assert doubts.trust[3] < 0.6 and np.delete(doubts.trust, 3).min() > 0.8


@pytest.mark.parametrize(("corrected", "is_doubted"), [(2, False), (3, True)])
def test_corrections_of_many_views_leave_nothing_confident(corrected: int, is_doubted: bool) -> None:
    factors = {f"view-{number}": 0.975 for number in range(corrected)}
    registered = replace(registered_at(ANGLES), scale_factors=factors)
    doubts = pose_doubts(registered, true_model(body()))
    assert bool(doubts.warnings) == is_doubted and (doubts.trust.max() < 0.5) == is_doubted
    if is_doubted:
        (warning,) = doubts.warnings
        assert warning.message.startswith("the scales or angles of 3 of the 8 views had to be corrected")
