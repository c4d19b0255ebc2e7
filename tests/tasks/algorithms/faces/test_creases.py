"""Edges of two faces beside each other, at the border of the image, of the mask and within it."""

import numpy as np
import pytest

from glint.tasks.algorithms.faces import flat_faces
from glint.tasks.algorithms.faces.creases import (
    DEFAULT_ROUNDING_INRADII,
    SILHOUETTE,
    UNSEEN,
    Edge,
    ObservedFaces,
    crease_residual,
    creases,
)
from glint.tasks.algorithms.faces.observed_faces import Face
from glint.tasks.algorithms.geometry.vectors import unit

INRADIUS = 20.0


def face(columns: slice, nx: float) -> Face:
    """Return a face that fills the upper half of these columns, and leans to the side by n_x."""
    hull = np.zeros((60, 80), bool)
    hull[:30, columns] = True
    return Face(unit(np.array([nx, 0.0, np.sqrt(1.0 - nx**2)])), hull, hull)


@pytest.fixture
def observed() -> ObservedFaces:
    mask = np.ones((60, 80), bool)
    mask[:, 53:] = False
    return ObservedFaces.of([face(slice(20, 50), 0.2), face(slice(0, 17), -0.2)], mask, INRADIUS)


def test_edges_lead_away_from_their_face_to_what_lies_behind(observed: ObservedFaces) -> None:
    sides = {tuple(np.round(edge.outward).astype(int)): edge for edge in observed.edges if edge.face == 0}
    behind = {outward: edge.behind for outward, edge in sides.items()}
    assert behind == {(-1, 0): 1, (1, 0): SILHOUETTE, (0, 1): SILHOUETTE, (0, -1): UNSEEN}
    assert {sides[1, 0].length, sides[0, 1].length} == {29.0}
    assert [edge.behind for edge in observed.edges if edge.face == 1 and edge.outward[0] > 0.5] == [0]


def test_both_faces_show_their_crease_and_how_round_it_is(observed: ObservedFaces) -> None:
    ((pair, along),) = creases(observed.edges).items()
    assert pair == (0, 1) and np.abs(along).tolist() == [0.0, 58.0]
    # Over three pixels the normal's component grows by 0.4.
    assert observed.rounding == pytest.approx(3.0 / 0.4, rel=0.02)


def test_an_edge_with_several_things_behind_it_has_none_of_them() -> None:
    mask, half = np.ones((60, 80), bool), np.zeros((60, 80), bool)
    mask[15:, :17] = False
    half[:15, :17] = True
    faces = [face(slice(20, 50), 0.2), Face(np.array([0.0, 0.0, 1.0]), half, half)]
    (behind,) = [
        edge.behind for edge in ObservedFaces.of(faces, mask, INRADIUS).edges if edge.start[0] == edge.end[0] == 20
    ]
    assert behind == UNSEEN


def test_a_single_crease_confirms_no_face(observed: ObservedFaces) -> None:
    assert np.isnan(flat_faces._crease_residuals(observed)).all()


def test_edges_of_a_single_face_are_rounded_as_most_are() -> None:
    alone = ObservedFaces.of([face(slice(20, 50), 0.2)], np.ones((60, 80), bool), INRADIUS)
    assert alone.rounding == DEFAULT_ROUNDING_INRADII * INRADIUS


def test_the_direction_of_a_crease_lies_in_its_face_and_shows_its_edge() -> None:
    normal = unit(np.array([0.3, -0.4, 1.0]))
    edge = Edge(0, np.array([40.0, -70.0]), np.array([52.0, -65.0]), unit(np.array([5.0, -12.0])), UNSEEN)
    direction = edge.direction(normal)
    assert direction @ normal == pytest.approx(0.0, abs=1e-9) and np.linalg.norm(direction) == pytest.approx(1.0)
    assert direction[:2] / np.hypot(*direction[:2]) == pytest.approx([12.0 / 13.0, 5.0 / 13.0])
    assert edge.length == 13.0


def test_planes_meet_where_their_gradients_differ_at_right_angles() -> None:
    first, second = unit(np.array([[0.3, 0.4, 1.0], [-0.3, -0.4, 1.0]]))
    along = 40.0 * np.array([-0.8, 0.6])
    assert crease_residual(along, first, second) == pytest.approx(0.0, abs=1e-6)
    assert crease_residual(np.array([24.0, 32.0]), first, second) > 10.0
    turned = 40.0 * np.array([-np.cos(0.7), np.sin(0.7)])
    assert 0.5 < crease_residual(turned, first, second) < 2.0
    # A longer edge shows its direction more exactly, and so does a sharper crease.
    assert crease_residual(4.0 * turned, first, second) > crease_residual(turned, first, second)
    blunt = [unit(normal + np.array([0.0, 0.0, 2.0])) for normal in (first, second)]
    assert crease_residual(turned, *blunt) < crease_residual(turned, first, second)
