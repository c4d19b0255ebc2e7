"""Faces that never showed the light, behind the edges of those that did."""

import numpy as np
import pytest

from glint.tasks.algorithms.faces.creases import ObservedFaces
from glint.tasks.algorithms.faces.observed_faces import Face
from glint.tasks.algorithms.faces.unseen_faces import FLASHING_DEG, UnseenFace, unseen_faces
from glint.tasks.algorithms.geometry.vectors import angles, gradients, unit

SHAPE, INRADIUS = (60, 90), 30.0
MASK = np.ones(SHAPE, bool)
TOWARDS_CAMERA = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (*SHAPE, 3))


def unseen_beside(hull: np.ndarray, normal: np.ndarray) -> list[UnseenFace]:
    """Return the faces beside an observed one (H, W) bool with a normal (3,)."""
    observed = ObservedFaces.of([Face(normal, hull, hull)], MASK, INRADIUS)
    return unseen_faces(observed, hull, TOWARDS_CAMERA, MASK, INRADIUS)


@pytest.mark.parametrize("lean", [0.0, 0.25])
def test_behind_a_single_edge_the_object_turns_away_as_far_as_the_lights_cannot_reach(lean: float) -> None:
    """The edge runs up and down, so that the face behind it turns about that, by an angle that is not known."""
    hull, normal = np.zeros(SHAPE, bool), unit(np.array([0.0, lean, 1.0]))
    hull[:, :40] = True
    (face,) = unseen_beside(hull, normal)
    assert face.pixels[:, 50:].mean() > 0.9 and not face.pixels[hull].any()
    assert face.normal[0] > 0.5 and angles(face.normal, normal) > 30.0
    # Along the crease both have the same slope.
    assert gradients(face.normal)[1] == pytest.approx(gradients(normal)[1], abs=0.08)
    assert np.radians(4.0) < face.spread < np.radians(25.0)


def test_two_edges_of_different_directions_give_the_normal() -> None:
    true = unit(np.array([0.9, -0.8, 1.0]))
    assert angles(true, TOWARDS_CAMERA[0, 0]) > FLASHING_DEG
    normals = unit(np.array([[-0.2, -0.3, 1.0], [0.3, 0.2, 1.0]]))
    # Each face lies where it is lower than the true one's plane and the other's.
    rows, columns = np.indices(SHAPE).astype(float)
    x, y = columns - 45.0, 30.0 - rows
    depths = [p * x + q * y for p, q in map(gradients, (*normals, true))]
    nearest = np.argmin(depths, axis=0)
    hulls = [nearest == number for number in (0, 1)]
    observed = ObservedFaces.of(
        [Face(normal, hull, hull) for normal, hull in zip(normals, hulls, strict=True)], MASK, INRADIUS
    )
    found = unseen_faces(observed, hulls[0] | hulls[1], TOWARDS_CAMERA, MASK, INRADIUS)
    (face,) = found
    assert angles(face.normal, true) < 6.0
    assert face.spread < np.radians(4.0)
