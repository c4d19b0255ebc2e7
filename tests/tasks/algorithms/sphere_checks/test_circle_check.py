from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.sphere_checks.circle_check import check_circle
from glint.tasks.algorithms.sphere_checks.foreshortening import ShapeCircle
from glint.tasks.algorithms.sphere_checks.rival_circle import radius_lacking
from glint.tasks.algorithms.sphere_checks.shape_agreement import contradicts
from glint.tasks.stages.sphere_confirmation import confirm_found
from tests.tasks.algorithms.sphere_checks.mirrored_lamp import lamps, mirrored_lamp

TRUTH = Sphere(58.3, 60.8, 30.4, score=0.5, centre_sd=0.2, radius_sd=0.2)


@pytest.fixture(scope="module")
def frames() -> np.ndarray:
    return mirrored_lamp(TRUTH, lamps(120))


def beside(right: float, down: float, ratio: float) -> Sphere:
    return replace(TRUTH, x=TRUTH.x + right, y=TRUTH.y + down, radius=ratio * TRUTH.radius)


def test_a_right_circle_stays_as_it_is(frames: np.ndarray) -> None:
    check = check_circle(frames, TRUTH)
    assert not check.is_contradicted
    assert check.sphere == TRUTH


@pytest.mark.parametrize("wrong", [beside(2.4, -0.5, 0.92), beside(-4.5, 1.0, 1.17), beside(0.5, 0.0, 1.5)])
def test_a_wrong_circle_is_replaced_by_the_contour(frames: np.ndarray, wrong: Sphere) -> None:
    check = check_circle(frames, wrong)
    assert check.is_contradicted and check.is_replaced
    assert check.sphere.distance(TRUTH) < 0.02 * TRUTH.radius
    assert abs(check.sphere.radius - TRUTH.radius) < 0.03 * TRUTH.radius
    assert check.sphere.score == wrong.score


def covered_beyond(frames: np.ndarray, ratio: float) -> np.ndarray:
    """Frames in which noise covers the sphere beyond a circle about its centre."""
    covered = frames.copy()
    rows, columns = np.mgrid[: frames.shape[1], : frames.shape[2]]
    outside = np.hypot(columns - TRUTH.x, rows - TRUTH.y) > ratio * TRUTH.radius
    covered[:, outside] = np.random.default_rng(1).integers(40, 80, (len(frames), int(outside.sum())))
    return covered


def test_an_edge_about_the_right_centre_is_doubted(frames: np.ndarray) -> None:
    check = check_circle(covered_beyond(frames, 0.85), beside(3.0, 0.0, 0.95))
    assert check.is_contradicted
    assert max(check.sphere.centre_sd, check.sphere.radius_sd) > 0.05 * TRUTH.radius


def test_a_stronger_image_of_the_horizon_is_not_taken_for_the_contour(frames: np.ndarray) -> None:
    rows, columns = np.mgrid[: frames.shape[1], : frames.shape[2]]
    inside = np.hypot(columns - TRUTH.x, rows - TRUTH.y) < 0.75 * TRUTH.radius
    brighter = np.minimum(frames + np.where(inside, 60, 0), 255).astype(np.uint8)
    check = check_circle(brighter, beside(3.0, 0.0, 1.17))
    assert check.is_replaced
    assert abs(check.sphere.radius - TRUTH.radius) < 0.03 * TRUTH.radius


def test_without_a_contour_the_circle_is_kept_and_doubted(frames: np.ndarray) -> None:
    wrong = beside(3.0, 0.0, 0.95)
    check = check_circle(covered_beyond(frames, 0.65), wrong)
    assert check.is_contradicted and not check.is_replaced
    assert (check.sphere.x, check.sphere.y) == (wrong.x, wrong.y)
    assert check.sphere.centre_sd > 0.05 * TRUTH.radius


def test_a_contradiction_is_told_with_values_and_remedy(frames: np.ndarray) -> None:
    wrong = beside(2.4, -0.5, 0.92)
    (used,), (warning,) = confirm_found(frames, [wrong], None)
    assert warning.cause == "sphere"
    assert f"({wrong.x:.1f}, {wrong.y:.1f})" in str(warning) and f"({used.x:.1f}, {used.y:.1f})" in str(warning)
    assert "give `spheres`" in str(warning)
    assert confirm_found(frames, [TRUTH], None)[1] == []


def test_of_two_spheres_that_disagree_the_one_stays_that_agrees_with_its_highlights(frames: np.ndarray) -> None:
    width = frames.shape[2]
    wrong, right = replace(beside(6.0, 0.0, 0.95), score=0.9), beside(width, 0.0, 1.0)
    both = np.concatenate([covered_beyond(frames, 0.65), frames], axis=2)
    used, (warning,) = confirm_found(both, [wrong, right], None)
    assert used == [right], "as certain as before: the highlights refute the other"
    assert f"({wrong.x:.0f}, {wrong.y:.0f}) is left out" in str(warning) and "give `spheres`" in str(warning)


def test_a_vague_circle_is_drawn_to_the_centre_of_its_highlights(frames: np.ndarray) -> None:
    hidden = covered_beyond(frames, 0.65)
    vague = replace(beside(6.0, 0.0, 0.95), centre_sd=2.5)
    check = check_circle(hidden, vague)
    assert not check.is_contradicted and not check.is_replaced
    assert check.sphere.distance(TRUTH) < 0.04 * TRUTH.radius
    assert check.sphere.distance(TRUTH) < 3.0 * check.sphere.centre_sd < 3.0 * vague.centre_sd
    assert check.sphere.radius == vague.radius
    both = np.concatenate([hidden, frames], axis=2)
    used, warnings = confirm_found(both, [vague, beside(frames.shape[2], 0.0, 1.0)], None)
    assert len(used) == 2 and warnings == []


def test_a_clearer_circle_takes_the_place_of_one_that_is_not_quite_contradicted(frames: np.ndarray) -> None:
    beside_it = replace(beside(2.6, 0.0, 0.9), centre_sd=1.2)
    check = check_circle(frames, beside_it)
    assert not check.is_contradicted and check.is_replaced
    assert check.sphere.distance(TRUTH) < 0.02 * TRUTH.radius
    assert abs(check.sphere.radius - TRUTH.radius) < 0.03 * TRUTH.radius
    assert confirm_found(frames, [beside_it], None)[1] == []


def test_of_two_spheres_that_contradict_each_other_the_one_that_stays_is_as_uncertain_as_they_differ(
    frames: np.ndarray,
) -> None:
    angle = np.radians(24.0)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    tilted = lamps(120) @ turn[[2, 0, 1]][:, [2, 0, 1]].T
    tilted[tilted[:, 2] < 0.2] = (0.0, 0.0, 1.0)
    both = np.concatenate([frames, mirrored_lamp(TRUTH, tilted)], axis=2)
    other = beside(frames.shape[2], 0.0, 1.0)
    (used,), warnings = confirm_found(both, [TRUTH, other], None)
    (warning,) = (warning for warning in warnings if "is left out" in str(warning))
    # The half vectors turn by half of the lights' angle; either circle may be the wrong one.
    per_axis = np.radians(12.0) / 2.0
    assert used.half_vector_sd(np.array(0.9)) == pytest.approx(per_axis, rel=0.25)
    assert warning.cost_deg == pytest.approx(12.0 / np.sqrt(2.0), rel=0.25)
    three = np.concatenate([both, frames], axis=2)
    third = beside(2 * frames.shape[2], 0.0, 1.0)
    used_spheres, _ = confirm_found(three, [TRUTH, other, third], None)
    assert len(used_spheres) == 2 and max(sphere.centre_sd for sphere in used_spheres) < 0.01 * TRUTH.radius


def test_what_is_hardly_known_contradicts_nothing() -> None:
    far = ShapeCircle(TRUTH.x + 6.0, TRUTH.y, 3.0, 31.0, 0.02)
    assert not contradicts(far, TRUTH)
    assert contradicts(replace(far, sd=0.5), TRUTH)


def test_shapes_bound_the_radius_from_above_alone() -> None:
    shapes = ShapeCircle(TRUTH.x, TRUTH.y, 0.3, 0.9 * TRUTH.radius, 0.01)
    assert contradicts(shapes, TRUTH)
    assert not contradicts(replace(shapes, max_radius=1.5 * TRUTH.radius), TRUTH)


def test_what_a_radius_lacks_of_the_largest_one_is_doubt() -> None:
    shapes = ShapeCircle(50.0, 50.0, 0.3, 40.0, 0.02)
    assert radius_lacking(Sphere(50.0, 50.0, 36.0), shapes) == 0.0
    assert radius_lacking(Sphere(50.0, 50.0, 30.0), shapes) == pytest.approx(7.6)
