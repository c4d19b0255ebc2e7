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
    assert np.radians(1.5) < face.spread < np.radians(4.0), "creases are known to three degrees"


def left_of(column: int) -> np.ndarray:
    """Return an observed face (H, W) bool that fills the image left of a column."""
    return np.broadcast_to(np.arange(SHAPE[1]) < column, SHAPE)


def beside(hull: np.ndarray, known: np.ndarray, mask: np.ndarray) -> list[UnseenFace]:
    """Return the faces beside an observed one (H, W) bool that looks into the camera, where some pixels are known."""
    observed = ObservedFaces.of([Face(TOWARDS_CAMERA[0, 0], hull, hull)], mask, INRADIUS)
    return unseen_faces(observed, known, TOWARDS_CAMERA, mask, INRADIUS)


def test_the_angle_behind_a_single_edge_follows_from_area_field_and_lights() -> None:
    """Mean and spread of the angle by its density, without the grid."""
    (face,) = beside(left_of(40), left_of(40), MASK)
    degrees = np.linspace(-89.0, 89.0, 3000)
    angle = np.radians(degrees)
    nats = -(degrees**2) / (2.0 * 25.0**2) - 3.0 * (np.abs(degrees) < 43.0) - 2.3 * (degrees < 0.0)
    density = np.cos(angle) * np.exp(nats)
    density /= density.sum()
    mean = np.arctan2(density @ np.sin(angle), density @ np.cos(angle))
    along_crease = np.radians(3.0)
    spread = np.sqrt((density @ (angle - mean) ** 2 + along_crease**2) / 2.0)
    assert np.arcsin(face.normal[0]) == pytest.approx(mean, abs=0.01)
    assert face.spread == pytest.approx(spread, abs=0.005)


def test_an_unseen_face_lies_in_the_mask_where_few_pixels_are_known() -> None:
    hull, mask, known = left_of(40), MASK.copy(), left_of(40).copy()
    mask[:, 86:] = False
    known[20:40, 60:80] = True
    known[46:58:4, 46:84:2] = True
    (face,) = beside(hull, known, mask)
    assert not face.pixels[23:37, 63:77].any() and not face.pixels[~mask].any()
    assert face.pixels[47:57, 48:83].all(), "an eighth of the pixels does not show a face"


@pytest.mark.parametrize(("column", "count"), [(78, 1), (84, 0)])
def test_a_narrow_part_without_a_face_is_none(column: int, count: int) -> None:
    hull = left_of(column)
    assert len(beside(hull, hull, MASK)) == count


def test_a_face_reaches_the_farther_beyond_the_ends_of_its_edge_the_farther_it_is_from_it() -> None:
    hull = np.zeros(SHAPE, bool)
    hull[22:38, :40] = True
    right = next(face for face in beside(hull, hull, MASK) if face.normal[0] > 0.3)
    tops = [np.flatnonzero(right.pixels[:, column]).min() for column in (46, 60, 80)]
    # The edge ends in row 22: three pixels, and 0.4 of the 21 and 41 to the edge in column 39.
    assert tops == [20, 14, 6]
