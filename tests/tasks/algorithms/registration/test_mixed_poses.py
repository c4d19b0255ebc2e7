"""A turntable's views beside views with poses of their own, orthographic and through a camera matrix."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.registered_views import RegisteredViews, refine, register_on_turntable
from glint.tasks.algorithms.registration.turntable import Turntable
from tests.tasks.algorithms.multiview.figurine import body, true_model, views_at, views_of

ANGLES = np.arange(0.0, 360.0, 60.0)
MATRIX = np.array([[400.0, 0.0, 47.5], [0.0, 400.0, 47.5], [0.0, 0.0, 1.0]])
TABLE = Turntable(2.0, 0.8, -0.7, ANGLES + np.array([0.6, -0.5, 0.3, -0.6, 0.5, -0.3]))


@pytest.fixture(scope="module")
def truth() -> trimesh.Trimesh:
    return body()


@pytest.fixture(scope="module")
def from_above(truth: trimesh.Trimesh) -> list[View]:
    """One orthographic view that looks down at 40 degrees, and a perspective one from the other side, at 50."""
    pitched = Rotation.from_euler("x", 40, degrees=True).as_matrix()
    turned = Rotation.from_euler("x", 50, degrees=True).as_matrix() @ np.diag([-1.0, 1.0, -1.0])
    views = [
        *views_at(truth, [(pitched, np.zeros(3))], seed=1),
        *views_at(truth, [(turned, np.array([0.0, 0.0, -400.0]))], seed=2, matrix=MATRIX),
    ]
    return [replace(view, name=name) for view, name in zip(views, ("above", "near"), strict=True)]


@pytest.fixture(scope="module")
def on_table(truth: trimesh.Trimesh) -> list[View]:
    return views_of(truth, TABLE)


@pytest.mark.long
def test_given_poses_stay_and_the_turntable_is_solved_with_them(
    truth: trimesh.Trimesh, on_table: list[View], from_above: list[View]
) -> None:
    # All given angles are too small by the same amount: beside poses that do not turn, normals tell even that.
    registered = register_on_turntable(on_table, (ANGLES - 0.8).tolist(), from_above)
    assert not registered.rejected and registered.turntable is not None
    assert [view.name for view in registered.views[-2:]] == ["above", "near"]
    for view, given in zip(registered.views[-2:], from_above, strict=True):
        assert (view.rotation == given.rotation).all() and (view.translation == given.translation).all()
    assert registered.turntable.offset == pytest.approx(TABLE.offset, abs=0.03)
    assert registered.turntable.lean_to_camera == pytest.approx(TABLE.lean_to_camera, abs=0.15)
    assert max(registered.residuals) < 0.05
    refined = refine(registered, true_model(truth)).turntable
    assert refined is not None and abs((refined.angles - TABLE.angles).mean()) < 0.35


@pytest.mark.long
def test_a_given_pose_that_contradicts_the_turntable_is_named(on_table: list[View], from_above: list[View]) -> None:
    above, near = from_above
    moved = above.with_pose(above.rotation, above.translation + np.array([0.0, 9.0, 0.0]))
    registered = register_on_turntable(on_table, ANGLES.tolist(), [moved, near])
    assert [view.name for view in registered.rejected] == ["above"]
    assert registered.rejected[0].angle is None and "contradicts" in registered.rejected[0].reason
    assert [view.name for view in registered.views] == [*(view.name for view in on_table), "near"]


@pytest.mark.long
def test_normals_alone_do_not_turn_a_view_far_from_its_silhouette() -> None:
    """Silhouettes of a body of revolution say nothing of angles; the normals of one view are those of another angle."""
    given = np.arange(0.0, 360.0, 60.0)
    table, vase = Turntable(0.0, 0.0, 0.0, given), trimesh.creation.icosphere(4, 42.0)
    for error, is_followed in ((0.7, True), (4.0, False)):
        shown = views_of(body(), replace(table, angles=given + error * (np.arange(6) == 2)))
        outlines = views_of(vase, table)
        views = [
            outline.with_normals(view.normals, np.where(view.mask, view.confidence, 0.0).astype(np.float32))
            for outline, view in zip(outlines, shown, strict=True)
        ]
        registered = RegisteredViews(tuple(views), (), (), table, given, np.ones(6))
        refined = refine(registered, true_model(body())).turntable
        assert refined is not None
        turn = refined.angles[2] - np.median(refined.angles - given) - given[2]
        assert (abs(turn - error) < 0.4) if is_followed else (turn == 0.0)
