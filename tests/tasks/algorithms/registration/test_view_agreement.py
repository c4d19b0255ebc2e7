"""Normals of the views of the figurine compared where two show the same point: right poses, mirrored and wrong ones."""

from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.multiview.reconstruction import coarse_model
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.epipolar_tangency import silhouette_residuals
from glint.tasks.algorithms.registration.turntable import Turntable, views_on_turntable
from glint.tasks.algorithms.registration.view_agreement import ViewAgreement, view_agreement
from tests.tasks.algorithms.multiview.figurine import body, true_model, views_of

ANGLES = np.arange(0.0, 360.0, 45.0)
TABLE = Turntable(0.0, 0.0, 0.0, ANGLES)


@pytest.fixture(scope="module")
def views() -> list[View]:
    return views_of(body(), TABLE)


def agreement_of(agreeing_share: np.ndarray) -> ViewAgreement:
    """Views of which each pair shares 100 vertices where its share (V, V) is a number, and none where it is NaN."""
    shared = np.where(np.isfinite(agreeing_share), 100, 0)
    return ViewAgreement(shared, np.nan_to_num(100 * agreeing_share).astype(int))


def uniform(count: int, share: float) -> np.ndarray:
    result = np.full((count, count), share)
    np.fill_diagonal(result, np.nan)
    return result


def test_views_at_right_poses_agree(views: list[View]) -> None:
    agreement = view_agreement(views, true_model(body()))
    assert agreement.is_known and agreement.share > 0.95
    assert not agreement.contradicting() and (agreement.trust() == 1.0).all()


@pytest.mark.long
def test_a_turntable_that_turned_the_other_way_agrees_in_silhouettes_alone(views: list[View]) -> None:
    turned = views_on_turntable(views, replace(TABLE, angles=-ANGLES))
    assert silhouette_residuals(turned).mean(axis=1).max() < 0.1
    agreement = view_agreement(turned, coarse_model(turned))
    assert agreement.contradicting() == list(range(8)) and agreement.trust().max() < 0.6


def test_the_one_view_with_normals_of_another_pose_is_named(views: list[View]) -> None:
    table = replace(TABLE, angles=ANGLES + 25.0 * (np.arange(8) == 3))
    wrong = replace(views[3], normals=views_of(body(), table)[3].normals)
    wrong = replace(wrong, evidence=np.where(np.isfinite(wrong.normals[..., 0]), wrong.evidence, np.nan))
    agreement = view_agreement([*views[:3], wrong, *views[4:]], true_model(body()))
    assert agreement.contradicting() == [3]
    assert agreement.trust()[3] < 0.5 and np.delete(agreement.trust(), 3).min() > 0.8


def test_views_from_opposite_sides_are_not_compared(views: list[View]) -> None:
    agreement = view_agreement(views[::4], true_model(body()))
    assert not agreement.is_known and np.isnan(agreement.share) and not agreement.contradicting()


def test_of_two_views_that_contradict_each_other_either_may_be_wrong() -> None:
    pairs = np.full((8, 8), np.nan)
    pairs[0, 1] = pairs[1, 0] = 0.1
    pairs[2, 3] = pairs[3, 2] = 1.0
    assert sorted(agreement_of(pairs).contradicting()) == [0, 1]


def test_where_many_contradict_each_other_all_are_doubted() -> None:
    assert agreement_of(uniform(8, 0.2)).contradicting() == list(range(8))
    assert np.allclose(agreement_of(uniform(8, 0.2)).trust(), 0.25)
    assert agreement_of(uniform(3, 0.55)).contradicting() == [0, 1, 2]


def test_false_highlights_at_right_poses_cost_nothing() -> None:
    pairs = uniform(6, 0.95)
    pairs[2], pairs[:, 2] = 0.68, 0.68
    pairs[2, 2] = np.nan
    agreement = agreement_of(pairs)
    assert not agreement.contradicting() and (agreement.trust() == 1.0).all()
