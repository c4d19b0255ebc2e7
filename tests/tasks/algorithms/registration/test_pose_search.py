"""Views of the figurine without a pose: registered where they fit, rejected where they fit nowhere or at two poses."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from glint.tasks.algorithms.meshing.implicit import ellipsoid, surface_nets
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.reconstruction import coarse_model
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.registered_views import (
    refine,
    register_by_matrices,
    register_on_turntable,
)
from glint.tasks.algorithms.registration.turntable import Turntable
from glint.tasks.algorithms.registration.unposed_views import register_unposed
from tests.tasks.algorithms.multiview.figurine import body, views_at, views_of

ANGLES = np.arange(0.0, 360.0, 45.0)


@pytest.fixture(scope="module")
def upright() -> list[View]:
    return views_of(body(), Turntable(0.0, 0.0, 0.0, ANGLES))


@pytest.fixture(scope="module")
def coarse(upright: list[View]) -> Model:
    """A model of all but the fourth view."""
    return coarse_model([*upright[:3], *upright[4:]])


def without_pose(view: View) -> View:
    return view.with_pose(np.eye(3), np.zeros(3))


def angle_between(first: View, second: View) -> float:
    """Degrees between two views."""
    return float(np.degrees(Rotation.from_matrix(first.rotation @ second.rotation.T).magnitude()))


@pytest.mark.long
@pytest.mark.slow
def test_a_turntables_missing_angle_is_searched(upright: list[View], coarse: Model) -> None:
    registered = register_on_turntable([*upright[:3], *upright[4:]], [*ANGLES[:3], *ANGLES[4:]])
    extended = register_unposed(registered, [without_pose(upright[3])], coarse)
    assert extended.searched == ("view-3",) and not extended.rejected
    assert extended.turntable is not None and extended.turntable.angles[-1] == pytest.approx(ANGLES[3], abs=0.15)
    assert len(extended.views) == 8 and max(extended.residuals) < 0.01
    refined = refine(extended, coarse)
    assert refined.turntable is not None and refined.turntable.angles[-1] == pytest.approx(ANGLES[3], abs=0.1)


@pytest.mark.long
def test_a_pose_is_searched_among_matrices(upright: list[View], coarse: Model) -> None:
    """From above, rolled and disregistered; the other cameras stood level."""
    lean, shift = Rotation.from_euler("zx", [40, 25], degrees=True).as_matrix(), np.array([3.0, -2.0, 0.0])
    (view,) = views_at(body(), [(lean @ upright[3].rotation, shift)])
    odd = replace(view, name="odd")
    registered = register_by_matrices([*upright[:3], *upright[4:]])
    extended = register_unposed(registered, [without_pose(odd)], coarse)
    assert extended.searched == ("odd",) and not extended.rejected
    assert angle_between(extended.views[-1], odd) < 1.5
    assert np.abs(extended.views[-1].translation - shift)[:2].max() < 0.15
    refined = refine(extended, coarse)
    assert angle_between(refined.views[-1], odd) < 1.5 and refined.views[0] is extended.views[0]


@pytest.mark.long
@pytest.mark.slow
def test_a_view_of_something_else_fits_without_pose(upright: list[View], coarse: Model) -> None:
    vertices, triangles = surface_nets(ellipsoid((0, 0, 0), (10, 34, 10)), np.full(3, -40.0), np.full(3, 40.0), 1.0)
    (view,) = views_of(trimesh.Trimesh(vertices, triangles, process=False), Turntable(0.0, 0.0, 0.0, np.zeros(1)))
    stranger = replace(without_pose(view), name="stranger")
    for registered in (
        register_on_turntable([*upright[:3], *upright[4:]], [*ANGLES[:3], *ANGLES[4:]]),
        register_by_matrices([*upright[:3], *upright[4:]]),
    ):
        result = register_unposed(registered, [stranger], coarse)
        assert [view.name for view in result.rejected] == ["stranger"] and len(result.views) == 7
        assert "its silhouette fits nowhere" in result.rejected[0].reason
        assert result.rejected[0].remedy == "give its pose"


@pytest.mark.long
def test_a_turned_body_fits_everywhere() -> None:
    vertices, triangles = surface_nets(ellipsoid((0, 0, 0), (18, 30, 18)), np.full(3, -40.0), np.full(3, 40.0), 1.0)
    views = views_of(trimesh.Trimesh(vertices, triangles, process=False), Turntable(0.0, 0.0, 0.0, ANGLES))
    registered = register_on_turntable(views[:-1], ANGLES[:-1].tolist())
    result = register_unposed(registered, [without_pose(views[-1])], coarse_model(registered.views))
    assert [view.name for view in result.rejected] == ["view-7"]
    assert "it fits almost as well at" in result.rejected[0].reason


def test_under_a_camera_matrix_no_pose_is_searched(upright: list[View], coarse: Model) -> None:
    registered = register_by_matrices([*upright[:3], *upright[4:]])
    near = replace(without_pose(upright[3]), matrix=np.diag([400.0, 400.0, 1.0]))
    result = register_unposed(registered, [near], coarse)
    assert [view.name for view in result.rejected] == ["view-3"] and "camera matrix" in result.rejected[0].reason
