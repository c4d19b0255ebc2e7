"""Poses of the figurine stated by another convention: recognized, and what makes them right is named."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.pose_alternatives import alternative_poses
from glint.tasks.algorithms.registration.registered_views import register_by_matrices, register_on_turntable
from glint.tasks.algorithms.registration.turntable import Turntable
from tests.tasks.algorithms.multiview.figurine import body, views_at, views_of

ANGLES = np.arange(0.0, 360.0, 45.0)
OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def on_table() -> list[View]:
    return views_of(body(), Turntable(3.0, 0.0, 0.0, ANGLES))


@pytest.fixture(scope="module")
def around() -> list[View]:
    """Views from all sides, above and below, disregistered by some pixels."""
    generator = np.random.default_rng(3)
    poses = [
        (Rotation.from_euler("yx", [angle, tilt], degrees=True).as_matrix().T, generator.normal(0.0, 3.0, 3))
        for angle, tilt in zip(ANGLES, (20, -30, 40, -15, 25, -40, 10, 35), strict=True)
    ]
    return [replace(view, name=f"view-{number}") for number, view in enumerate(views_at(body(), poses))]


def stated(view: View, matrix: np.ndarray) -> View:
    """A view whose pose is read off another matrix than its own."""
    return view.with_pose(matrix[:3, :3].T, -matrix[:3, :3].T @ matrix[:3, 3])


def camera_to_world(view: View) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = view.rotation.T, -view.rotation.T @ view.translation
    return matrix


def moved(view: View, ratio: float) -> View:
    return view.with_pose(view.rotation, ratio * view.translation)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("opencv", "camera's axes of OpenCV (negate the second and third columns)"),
        ("inverse", "lead from the world to the camera (invert them)"),
        ("extrinsics", "lead from the world to the camera (invert them), and then have the camera's axes of OpenCV"),
        ("metres", "have translations in another unit (multiply them by 1000)"),
    ],
)
def test_matrices_of_another_convention_are_refused_with_what_makes_them_right(
    around: list[View], name: str, expected: str
) -> None:
    wrong = {
        "opencv": [stated(view, camera_to_world(view) @ OPENCV) for view in around],
        "inverse": [stated(view, np.linalg.inv(camera_to_world(view))) for view in around],
        "extrinsics": [stated(view, np.linalg.inv(camera_to_world(view) @ OPENCV)) for view in around],
        "metres": [moved(view, 0.001) for view in around],
    }[name]
    with pytest.raises(UnusableCapture, match="contradict") as caught:
        register_by_matrices(wrong)
    assert caught.value.remedy.startswith("all agree if the matrices") and expected in caught.value.remedy


@pytest.mark.long
def test_right_matrices_are_taken_as_they_are(around: list[View]) -> None:
    registered = register_by_matrices(around)
    assert not registered.rejected and max(registered.residuals) < 0.1


@pytest.mark.slow
def test_a_turntable_that_turned_the_other_way_is_recognized(on_table: list[View]) -> None:
    """Six views are enough in `test_pose_doubts`."""
    described = alternative_poses(on_table, Turntable(3.0, 0.0, 0.0, -ANGLES))
    assert described is not None and "negate all angles" in described


@pytest.mark.long
def test_views_from_four_sides_do_not_tell_that_a_turntable_turned_the_other_way(on_table: list[View]) -> None:
    assert alternative_poses(on_table[::2], Turntable(3.0, 0.0, 0.0, -ANGLES[::2])) is None


@pytest.mark.long
@pytest.mark.parametrize(
    "order", [pytest.param([0, 1, 2, 3, 4, 5, 6, 7], marks=pytest.mark.slow), [0, 4, 2, 6, 1, 5, 3, 7]]
)
def test_another_step_of_the_turntable_is_refused_with_the_right_one(on_table: list[View], order: list[int]) -> None:
    with pytest.raises(UnusableCapture, match="contradict") as caught:
        register_on_turntable([on_table[number] for number in order], (ANGLES[order] * 30.0 / 45.0).tolist())
    assert "all angles are multiplied by 1.5" in caught.value.remedy
    assert "(steps of 45 rather than 30)" in caught.value.remedy


@pytest.mark.long
def test_a_step_that_is_wrong_by_a_few_percent_is_corrected(on_table: list[View]) -> None:
    registered = register_on_turntable(on_table, (ANGLES * 44.0 / 45.0).tolist())
    assert registered.turntable is not None and registered.step_factor == pytest.approx(45.0 / 44.0, abs=0.004)
    turned = registered.turntable.angles - ANGLES
    assert np.abs(turned - turned.mean()).max() < 0.6
    assert register_on_turntable(on_table, (ANGLES + 3.0 * (np.arange(8) == 7)).tolist()).step_factor == 1.0


@pytest.mark.long
@pytest.mark.parametrize(
    ("stated_angles", "remedy"),
    [
        (
            [0.0, 120.0, 60.0, 180.0, 240.0, 300.0],
            "all agree if view-1 and view-2 have each other's angles (exchange these)",
        ),
        pytest.param(
            np.arange(0.0, 300.0, 50.0).tolist(),
            "all agree if all angles are multiplied by 1.20 (steps of 60 rather than 50)",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_makes_views_from_above_agree_is_named_alone(stated_angles: list[float], remedy: str) -> None:
    """A wrong step is named in `test_another_step_of_the_turntable_is_refused_with_the_right_one` too."""
    above = views_of(body(), Turntable(3.0, 25.0, 0.0, np.arange(0.0, 360.0, 60.0)))
    with pytest.raises(UnusableCapture, match="contradict") as caught:
        register_on_turntable(above, stated_angles)
    assert caught.value.remedy == remedy
