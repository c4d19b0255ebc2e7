"""Views of the figurine whose pose nobody gave: found where they fit, named where they fit nowhere or in two places."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from glint.tasks.algorithms.meshing.implicit import ellipsoid, surface_nets
from glint.tasks.algorithms.multiview.reconstruction import Model, rough_model
from glint.tasks.algorithms.multiview.registration import (
    place_by_matrices,
    place_on_turntable,
    place_others,
    placed_anew,
)
from glint.tasks.algorithms.multiview.turntable import Turntable
from glint.tasks.algorithms.multiview.view import View
from tests.tasks.algorithms.multiview.figurine import body, seen_from, views_of

ANGLES = np.arange(0.0, 360.0, 45.0)


@pytest.fixture(scope="module")
def upright() -> list[View]:
    return views_of(body(), Turntable(0.0, 0.0, 0.0, ANGLES))


@pytest.fixture(scope="module")
def rough(upright: list[View]) -> Model:
    """A model of all but the fourth view."""
    return rough_model([*upright[:3], *upright[4:]])


def nowhere(view: View) -> View:
    return view.placed(np.eye(3), np.zeros(3))


def apart(one: View, other: View) -> float:
    """Degrees between two views."""
    return float(np.degrees(Rotation.from_matrix(one.rotation @ other.rotation.T).magnitude()))


def test_a_turntables_missing_angle_is_found(upright: list[View], rough: Model) -> None:
    placed = place_on_turntable([*upright[:3], *upright[4:]], [*ANGLES[:3], *ANGLES[4:]])
    wider = place_others(placed, [nowhere(upright[3])], rough)
    assert wider.found == ("view-3",) and not wider.left_out
    assert wider.turntable is not None and wider.turntable.angles[-1] == pytest.approx(ANGLES[3], abs=2.0)
    assert len(wider.views) == 8 and max(wider.misses) < 0.2
    again = placed_anew(wider, rough)
    assert again.turntable is not None and again.turntable.angles[-1] == pytest.approx(ANGLES[3], abs=2.0)


def test_a_pose_is_found_among_matrices(upright: list[View], rough: Model) -> None:
    """From above, rolled and displaced; the other cameras stood level."""
    lean, shift = Rotation.from_euler("zx", [40, 25], degrees=True).as_matrix(), np.array([3.0, -2.0, 0.0])
    (seen,) = seen_from(body(), [(lean @ upright[3].rotation, shift)])
    odd = replace(seen, name="odd")
    placed = place_by_matrices([*upright[:3], *upright[4:]])
    wider = place_others(placed, [nowhere(odd)], rough)
    assert wider.found == ("odd",) and not wider.left_out
    assert apart(wider.views[-1], odd) < 4.0
    assert np.abs(wider.views[-1].translation - shift)[:2].max() < 1.0
    again = placed_anew(wider, rough)
    assert apart(again.views[-1], odd) < 4.0 and again.views[0] is wider.views[0]


def test_a_view_of_something_else_fits_nowhere(upright: list[View], rough: Model) -> None:
    vertices, triangles = surface_nets(ellipsoid((0, 0, 0), (10, 34, 10)), np.full(3, -40.0), np.full(3, 40.0), 1.0)
    (other,) = views_of(trimesh.Trimesh(vertices, triangles, process=False), Turntable(0.0, 0.0, 0.0, np.zeros(1)))
    stranger = replace(nowhere(other), name="stranger")
    for placed in (
        place_on_turntable([*upright[:3], *upright[4:]], [*ANGLES[:3], *ANGLES[4:]]),
        place_by_matrices([*upright[:3], *upright[4:]]),
    ):
        found = place_others(placed, [stranger], rough)
        assert [each.name for each in found.left_out] == ["stranger"] and len(found.views) == 7
        assert "nowhere does its outline fit" in found.left_out[0].reason
        assert found.left_out[0].remedy == "give its pose"


def test_a_turned_body_fits_everywhere() -> None:
    vertices, triangles = surface_nets(ellipsoid((0, 0, 0), (18, 30, 18)), np.full(3, -40.0), np.full(3, 40.0), 1.0)
    views = views_of(trimesh.Trimesh(vertices, triangles, process=False), Turntable(0.0, 0.0, 0.0, ANGLES))
    placed = place_on_turntable(views[:-1], ANGLES[:-1].tolist())
    found = place_others(placed, [nowhere(views[-1])], rough_model(placed.views))
    assert [each.name for each in found.left_out] == ["view-7"]
    assert "it fits hardly less well at" in found.left_out[0].reason


def test_under_a_camera_matrix_no_pose_is_found(upright: list[View], rough: Model) -> None:
    placed = place_by_matrices([*upright[:3], *upright[4:]])
    near = replace(nowhere(upright[3]), matrix=np.diag([400.0, 400.0, 1.0]))
    found = place_others(placed, [near], rough)
    assert [each.name for each in found.left_out] == ["view-3"] and "camera matrix" in found.left_out[0].reason
