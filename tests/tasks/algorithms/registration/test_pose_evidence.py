"""Four views of the figurine that share nothing: their poses confirmed, contradicted, or left open."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.pose_evidence import (
    MAX_BEST_TURN_DEG,
    PoseEvidence,
    best_turn,
    likeliest_alternative,
    log_ratio,
    pose_evidence,
)
from glint.tasks.algorithms.registration.turntable import Turntable, views_on_turntable
from tests.tasks.algorithms.multiview.figurine import body, views_of

ANGLES = np.arange(0.0, 360.0, 90.0)


@pytest.fixture(scope="module")
def views() -> list[View]:
    return views_of(body(), Turntable(0.0, 0.0, 0.0, ANGLES))


@pytest.fixture(scope="module")
def coarse() -> list[View]:
    """Views of half as many pixels a side, for what differs by much: models of them take half the time."""
    return views_of(body(), Turntable(0.0, 0.0, 0.0, ANGLES), pixel_size=2.0)


def evidence_at(views: list[View], angles: np.ndarray) -> PoseEvidence:
    table = Turntable(0.0, 0.0, 0.0, angles)
    return pose_evidence(views_on_turntable(views, table), table)


@pytest.mark.slow
def test_right_angles_are_confirmed(coarse: list[View]) -> None:
    evidence = evidence_at(coarse, ANGLES)
    assert evidence.is_sufficient and evidence.better_alternative is None


@pytest.mark.slow
def test_right_matrices_are_confirmed(views: list[View]) -> None:
    assert pose_evidence(views, None).is_sufficient


@pytest.mark.long
def test_a_view_fits_best_where_it_stood_before_its_matrix_was_turned(views: list[View]) -> None:
    assert abs(best_turn(views, 2, is_on_table=False)) <= 3.0
    about_y = Rotation.from_euler("y", 10.0, degrees=True).as_matrix()
    turned = [*views[:2], views[2].with_pose(about_y @ views[2].rotation, about_y @ views[2].translation), views[3]]
    assert abs(best_turn(turned, 2, is_on_table=False)) > MAX_BEST_TURN_DEG


@pytest.mark.long
def test_a_turntable_that_turned_the_other_way_is_contradicted(coarse: list[View]) -> None:
    evidence = evidence_at(coarse, -ANGLES)
    assert not evidence.is_sufficient
    assert evidence.better_alternative is not None and "negate all angles" in evidence.better_alternative


@pytest.mark.long
@pytest.mark.parametrize("number", [pytest.param(0, marks=pytest.mark.slow), 1])
def test_a_wrong_angle_is_not_confirmed(coarse: list[View], number: int) -> None:
    evidence = evidence_at(coarse, ANGLES + 10.0 * (np.arange(4) == number))
    assert not evidence.is_sufficient


def test_three_views_and_mixed_poses_are_left_open(views: list[View]) -> None:
    for some, table in (
        (views[:3], Turntable(0.0, 0.0, 0.0, ANGLES[:3])),
        (views, Turntable(0.0, 0.0, 0.0, ANGLES[:2])),
    ):
        evidence = pose_evidence(some, table)
        assert not evidence.is_sufficient and evidence.better_alternative is None


def test_what_cannot_be_compared_counts_for_nothing() -> None:
    assert log_ratio(np.array([10.0, np.nan, 5.0]), np.array([20.0, 4.0, 5.0])) == pytest.approx(np.log(2.0))
    assert np.isnan(log_ratio(np.array([np.nan]), np.array([3.0])))
    assert not PoseEvidence(np.nan, None, np.zeros(4)).is_sufficient


def test_an_alternative_that_cannot_be_compared_is_not_excluded() -> None:
    unknown, worse, better = (np.nan, "unknown"), (0.8, "worse"), (-0.7, "better")
    for ratios in ([unknown, worse], [worse, unknown], [unknown]):
        assert np.isnan(likeliest_alternative(ratios)[0])
    for ratios in ([unknown, better, worse], [better, unknown]):
        assert likeliest_alternative(ratios) == better
    assert likeliest_alternative([worse]) == worse
    assert likeliest_alternative([]) == (np.inf, None)
