from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.faces.creases import UNSEEN, crease_residual, creases, face_edges
from glint.tasks.algorithms.faces.flat_faces import FlatFaces, flat_faces, has_other_faces
from glint.tasks.algorithms.faces.observed_faces import MIN_LIGHTS, find_faces
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.geometry.vectors import angles, gradients, unit
from glint.tasks.algorithms.prior.smooth_normals import contour_normals, smooth_normal_field
from tests.tasks.algorithms.faces.polyhedron import PYRAMID, SHAPE, face_numbers, polyhedron_normals
from tests.tasks.algorithms.revolution.beaker import observable

LIGHTS = np.full(SHAPE, 2.0)


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    return polyhedron_normals(PYRAMID)


def planes(truth: np.ndarray, candidates: np.ndarray | None = None, accepted: np.ndarray | None = None) -> FlatFaces:
    mask = np.isfinite(truth[..., 0])
    rim, outward = contour_normals(mask)
    field = smooth_normal_field(mask, max_nodes=2000).solve(outward, rim.astype(float))
    accepted = observable(truth) if accepted is None else accepted
    candidates = observable(truth)[None] if candidates is None else candidates
    result = flat_faces(accepted, LIGHTS, candidates, field, mask, inradius_of(mask))
    assert result is not None
    return result


def sphere() -> np.ndarray:
    rows, columns = np.indices(SHAPE) - 79.5
    squared = (columns**2 + rows**2) / 70.0**2
    normals = np.stack([columns / 70.0, -rows / 70.0, np.sqrt(np.maximum(1.0 - squared, 0.0))], axis=-1)
    return np.where((squared < 1.0)[..., None], normals, np.nan)


def test_the_faces_that_showed_the_light_are_found_with_their_normals(truth: np.ndarray) -> None:
    mask = np.isfinite(truth[..., 0])
    faces = find_faces(observable(truth), LIGHTS, mask, inradius_of(mask))
    assert len(faces) == 2
    for normal in PYRAMID[:2]:
        face = min(faces, key=lambda face: float(angles(face.normal, normal)))
        assert angles(face.normal, normal) < 0.2
        assert (truth[face.hull] @ normal > np.cos(np.radians(8.0))).all()


@pytest.mark.parametrize("noise_deg", [0.0, 0.5])
def test_a_sphere_has_no_faces(noise_deg: float) -> None:
    truth = sphere()
    noise = np.random.default_rng(0).normal(0.0, np.radians(noise_deg), truth.shape)
    mask = np.isfinite(truth[..., 0])
    assert find_faces(unit(truth + noise), LIGHTS, mask, inradius_of(mask)) == []


def test_the_highlight_of_a_single_light_is_no_face(truth: np.ndarray) -> None:
    mask = np.isfinite(truth[..., 0])
    single = np.full(SHAPE, 0.9 * MIN_LIGHTS)
    assert find_faces(observable(truth), single, mask, inradius_of(mask)) == []


def test_faces_that_other_paths_divide_are_joined(truth: np.ndarray) -> None:
    accepted = observable(truth)
    accepted[70:74] = np.nan
    mask = np.isfinite(truth[..., 0])
    assert len(find_faces(accepted, LIGHTS, mask, inradius_of(mask))) == 2


def test_a_face_reaches_as_far_as_its_pixels_are_connected() -> None:
    """They lead up from the only flat part, across, and down again beyond it."""
    is_face = np.zeros(SHAPE, bool)
    is_face[100:140, 20:60] = True
    is_face[10:100, 40] = is_face[10, 40:130] = is_face[10:156, 130] = True
    accepted = np.where(is_face[..., None], unit(np.array([0.1, 0.2, 1.0])), np.nan)
    mask = np.ones(SHAPE, bool)
    (face,) = find_faces(accepted, LIGHTS, mask, inradius_of(mask))
    assert np.array_equal(face.pixels, is_face)


def test_two_planes_meet_where_their_normals_say(truth: np.ndarray) -> None:
    mask = np.isfinite(truth[..., 0])
    faces = find_faces(observable(truth), LIGHTS, mask, inradius_of(mask))
    between = creases(face_edges(faces, mask, inradius_of(mask)))
    assert list(between) == [(0, 1)]
    assert crease_residual(between[0, 1], faces[0].normal, faces[1].normal) < 2.0
    turned = unit(faces[0].normal + np.array([0.0, 0.6, 0.0]))
    assert crease_residual(between[0, 1], turned, faces[1].normal) > 4.0


def test_the_edges_of_an_unseen_face_are_open(truth: np.ndarray) -> None:
    mask = np.isfinite(truth[..., 0])
    faces = find_faces(observable(truth), LIGHTS, mask, inradius_of(mask))
    edges = face_edges(faces, mask, inradius_of(mask))
    third = (face_numbers(PYRAMID) == 2) & mask
    for number in range(2):
        behind = [edge for edge in edges if edge.face == number and edge.behind == UNSEEN]
        assert behind
        edge = max(behind, key=lambda edge: edge.length)
        column, row = np.round((edge.start + edge.end) / 2.0 + 8.0 * edge.outward).astype(int) * [1, -1]
        assert third[row, column]


def test_a_face_that_never_showed_the_light_follows_from_its_creases(truth: np.ndarray) -> None:
    result = planes(truth)
    unseen = np.isfinite(result.spread)
    third = face_numbers(PYRAMID) == 2
    assert third[unseen].mean() > 0.95
    assert unseen.sum() > 0.5 * (third & np.isfinite(truth[..., 0])).sum()
    error = angles(result.normals[unseen], PYRAMID[2])
    assert np.median(error) < 4.0
    # What is left to the creases' errors is stated.
    assert np.radians(np.median(error)) < 2.5 * np.median(result.spread[unseen])


def test_with_one_crease_the_normal_agrees_with_it_and_is_doubted() -> None:
    faces = unit(np.array([[0.0, 0.3, 1.0], [0.0, -1.7, 1.0]]))
    truth = polyhedron_normals(faces)
    truth[:, :30] = truth[:, 130:] = np.nan
    result = planes(truth)
    unseen = np.isfinite(result.spread)
    normal = np.median(result.normals[unseen], axis=0)
    # The crease runs along x, so all faces behind it have gradients along y.
    assert abs(gradients(normal)[0]) < 0.1
    assert normal[1] < -0.6
    assert np.degrees(np.median(result.spread[unseen])) > 5.0


def test_a_face_that_is_cut_off_without_rounded_edges_is_refuted(truth: np.ndarray) -> None:
    rows, columns = np.indices(SHAPE)
    false = unit(np.array([0.1, -0.2, 1.0]))
    patch = (face_numbers(PYRAMID) == 2) & (abs(columns - 80) < 16) & (rows > 88) & (rows < 104)
    accepted = np.where(patch[..., None], false, observable(truth))
    result = planes(truth, accepted[None], accepted)
    assert np.isfinite(result.refuted[..., 0])[patch].mean() > 0.9
    assert not np.isfinite(result.refuted[~patch]).any()
    assert angles(result.refuted[patch], false)[0] < 0.5
    assert not result.observed[patch].any()


def test_rounded_edges_are_needed_to_refute(truth: np.ndarray) -> None:
    sharp = observable(polyhedron_normals(PYRAMID, rounding=0.02))
    assert np.isnan(planes(truth, sharp[None], sharp).refuted).all()


def test_a_cylinder_does_not_explain_a_prism() -> None:
    faces = unit(np.array([[0.0, 0.02, 1.0], [0.8, 0.0, 1.0], [-0.8, 0.0, 1.0]]))
    truth = polyhedron_normals(faces)
    mask = np.isfinite(truth[..., 0])
    x = np.linspace(-0.7, 0.7, SHAPE[1])
    curved = np.stack(np.broadcast_arrays(x, 0.0 * x, np.sqrt(1.0 - x**2)), axis=-1)
    cylinder = np.broadcast_to(curved, (*SHAPE, 3))
    assert has_other_faces(cylinder, observable(truth), LIGHTS, mask, inradius_of(mask))
    assert not has_other_faces(truth, observable(truth), LIGHTS, mask, inradius_of(mask))
    assert not has_other_faces(cylinder, observable(sphere()), LIGHTS, mask, inradius_of(mask))


def test_a_small_flat_sheet_does_not_make_a_surface_of_revolution_faceted() -> None:
    surface = sphere()
    mask = np.isfinite(surface[..., 0])
    accepted, middle = observable(surface), tuple(size // 2 for size in mask.shape)
    rows, columns = np.indices(mask.shape)
    accepted[np.hypot(rows - middle[0], columns - middle[1]) < 8] = unit(np.array([0.4, 0.2, 1.0]))
    assert find_faces(accepted, LIGHTS, mask, inradius_of(mask))
    assert not has_other_faces(surface, accepted, LIGHTS, mask, inradius_of(mask))


def test_marks_and_other_accepted_normals_outweigh_faces(truth: np.ndarray) -> None:
    result = planes(truth)
    weights, nothing = np.full(SHAPE, 0.5), np.zeros(SHAPE, bool)
    targets = np.zeros((*SHAPE, 3))
    changed, pull = result.constrain(targets, weights, nothing, nothing)
    assert (pull[result.weights > 0] == result.weights[result.weights > 0]).all()
    assert (changed[result.observed] == result.normals[result.observed]).all()
    everywhere = ~nothing
    _, marked = result.constrain(targets, weights, everywhere, everywhere)
    assert (marked == 0.5).all()


def test_a_face_that_showed_the_light_is_known_all_over_but_at_marks_others_where_nothing_is() -> None:
    faces = replace(
        FlatFaces.none((1, 4)),
        normals=np.full((1, 4, 3), (0.6, 0.0, 0.8)),
        weights=np.full((1, 4), 0.5),
        observed=np.array([[True, True, False, False]]),
    )
    known, marked = np.array([[True, True, True, False]]), np.array([[True, False, False, False]])
    targets, weights = faces.constrain(np.full((1, 4, 3), (0.0, 0.0, 1.0)), np.ones((1, 4)), known, marked)
    assert weights.tolist() == [[1.0, 0.5, 1.0, 0.5]] and (targets[..., 0] == [[0.0, 0.6, 0.0, 0.6]]).all()


def test_parallel_faces_with_another_between_them_stay_apart() -> None:
    normals = np.full((90, 120, 3), unit(np.array([0.1, 0.0, 1.0])))
    normals[:, 40:80] = unit(np.array([-0.2, 0.1, 1.0]))
    mask = np.ones((90, 120), bool)
    faces = find_faces(normals, np.full(mask.shape, 2.0), mask, inradius_of(mask))
    assert sorted(int(np.argwhere(face.hull)[:, 1].mean()) for face in faces) == [19, 59, 99]
