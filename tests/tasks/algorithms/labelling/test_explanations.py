"""What explains settled labels: a prism or a faceted body, unless accepted normals contradict it."""

from copy import copy
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from glint.tasks.algorithms.angular_bodies.angular_normals import AngularVesselSearch
from glint.tasks.algorithms.facets.faceted_normals import FacetSearch
from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.labelling import explanations
from glint.tasks.algorithms.labelling.alternation import Alternation
from glint.tasks.algorithms.labelling.explanations import explain
from glint.tasks.algorithms.labelling.flat_solids import (
    MIN_SOLID_NATS,
    is_angular_vessel,
    likely_solids,
    likely_vessel,
)
from glint.tasks.algorithms.labelling.reconstruction import conclude, settle
from glint.tasks.algorithms.labelling.results import Reconstruction
from glint.tasks.algorithms.labelling.weights import LabellingOptions
from glint.tasks.algorithms.prisms.polyhedron import PolyhedralNormals
from glint.tasks.algorithms.prisms.prismatic_normals import PrismSearch
from glint.tasks.algorithms.revolution.symmetry import RotationalNormals
from tests.tasks.algorithms.faces.polyhedron import PYRAMID, face_numbers, polyhedron_normals
from tests.tasks.algorithms.labelling.scenes import clusters_of
from tests.tasks.algorithms.prisms.block import Block, shown
from tests.tasks.algorithms.revolution.beaker import observable

ALONE = LabellingOptions(symmetry=False, readmission=False)


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    return Block().render()[0]


@pytest.fixture(scope="module")
def settled(truth: np.ndarray) -> Alternation:
    return settle(clusters_of(shown(truth).astype(np.float32)), np.isfinite(truth[..., 0]), ALONE)


@pytest.fixture(scope="module")
def concluded(settled: Alternation) -> Reconstruction:
    return conclude(explain(settled))


def prism_of(normals: np.ndarray, faces: np.ndarray, log_ratio: float) -> PrismSearch:
    depths = np.zeros(normals.shape[:2], np.float32)
    return SimpleNamespace(best=PolyhedralNormals(normals, depths, faces, log_ratio))  # type: ignore[return-value]


def bodies_of(*solids: PolyhedralNormals) -> FacetSearch:
    return SimpleNamespace(likeliest=list(solids))  # type: ignore[return-value]


NO_PRISM = cast(PrismSearch, SimpleNamespace(best=None))
NO_VESSEL = cast(AngularVesselSearch, SimpleNamespace(best=None))


def vessel_of(normals: np.ndarray) -> AngularVesselSearch:
    depths = np.zeros(normals.shape[:2], np.float32)
    best = RotationalNormals(normals.astype(np.float32), depths, 0.0, 0.0)
    return SimpleNamespace(best=best)  # type: ignore[return-value]


def with_searches(settled: Alternation, **searches: Any) -> Alternation:
    """Replace searches of the view by others."""
    state = copy(settled)
    state.view = replace(settled.view, **{"rounded": NO_PRISM, "angular": NO_VESSEL} | searches)
    return state


def test_a_dome_is_no_faceted_body() -> None:
    rows, columns = np.mgrid[-40:41, -40:41] / 40.0
    height = np.sqrt(np.maximum(1.0 - rows**2 - columns**2, 0.0))
    mask = np.hypot(rows, columns) < 0.98
    dome = np.where(mask[..., None], np.stack([columns, -rows, height], axis=-1), np.nan)
    state = settle(clusters_of(np.where(dome[..., 2:] > 0.75, dome, np.nan)[None].astype(np.float32)), mask, ALONE)
    assert state.known[mask].mean() > 0.3
    quarters = np.stack([0.35 * np.sign(columns), -0.35 * np.sign(rows), np.full(mask.shape, 0.87)], axis=-1)
    quarters = np.where(mask[..., None], unit(quarters), np.nan).astype(np.float32)
    faces = np.where(mask, 2 * (rows > 0) + (columns > 0), -1)
    facets = PolyhedralNormals(quarters, np.zeros(mask.shape, np.float32), faces, 60.0)
    right = facets._replace(normals=dome.astype(np.float32))
    assert likely_solids(with_searches(state, facets=bodies_of(facets), prism=NO_PRISM)) == []
    assert likely_solids(with_searches(state, facets=bodies_of(right), prism=NO_PRISM)) == [right]


def test_the_faces_that_never_showed_the_light_follow_from_a_prism(
    settled: Alternation, concluded: Reconstruction, truth: np.ndarray
) -> None:
    mask = settled.view.mask
    without = copy(settled)
    without.options = LabellingOptions(symmetry=False, readmission=False, flat_faces=False)
    results = conclude(explain(without)), concluded
    before, after = (angles(result.normals, truth)[mask].mean() for result in results)
    assert before > 15.0
    assert after < 5.0


def test_confident_normals_of_a_prism_are_right(
    settled: Alternation, concluded: Reconstruction, truth: np.ndarray
) -> None:
    result = concluded
    confident = result.confidence >= 0.95
    assert (angles(result.normals, truth)[confident] < 5.0).mean() > 0.95
    assert result.body_depth is not None
    # Most of it never showed the light, and is not certain.
    assert confident.sum() < 0.6 * settled.view.mask.sum()


def test_accepted_normals_that_contradict_a_prism_take_more_evidence(settled: Alternation, truth: np.ndarray) -> None:
    contradicting = copy(settled)
    contradicting.known = settled.view.mask
    contradicting.values = np.where(settled.view.mask[..., None], [0.0, 0.0, 1.0], np.nan)

    def adopts(state: Alternation, log_ratio: float) -> bool:
        prism = prism_of(truth, np.zeros(truth.shape[:2], int), log_ratio)
        return explain(with_searches(state, prism=prism, facets=bodies_of())).expected is not None

    assert adopts(settled, 5.0 * MIN_SOLID_NATS)
    assert not adopts(settled, 0.5 * MIN_SOLID_NATS)
    assert not adopts(contradicting, 4.0 * MIN_SOLID_NATS)
    assert adopts(contradicting, 8.0 * MIN_SOLID_NATS)


def test_confident_normals_refute_a_prism_with_another_end() -> None:
    pyramid = polyhedron_normals(PYRAMID, rounding=1.5)
    mask, numbers = np.isfinite(pyramid[..., 0]), face_numbers(PYRAMID)
    settled = settle(clusters_of(observable(pyramid)[None]), mask, ALONE)
    # The first two faces flashed, and are confident; the third never did.
    for wrong, expected in ((0, False), (2, True)):
        normals = pyramid.copy()
        normals[mask & (numbers == wrong)] = [0.0, 0.0, 1.0]
        prism = prism_of(normals, np.where(mask, numbers, -1), 100.0)
        state = with_searches(settled, prism=prism, facets=bodies_of())
        assert (explain(state).expected is not None) is expected


@pytest.fixture(scope="module")
def pyramid() -> np.ndarray:
    return polyhedron_normals(PYRAMID, rounding=1.5)


def with_pyramid(settled: Alternation, normals: np.ndarray) -> Alternation:
    """Explain by a pyramid of these normals (H, W, 3)."""
    prism = prism_of(normals, np.where(settled.view.mask, face_numbers(PYRAMID), -1), 200.0)
    return explain(with_searches(settled, prism=prism, facets=bodies_of()))


def test_what_is_seen_through_a_face_that_flashed_is_rejected(
    pyramid: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    mask, numbers, shown = np.isfinite(pyramid[..., 0]), face_numbers(PYRAMID), observable(pyramid)
    rows, columns = np.nonzero(mask & (numbers == 0))
    middle = np.hypot(*(np.indices(mask.shape) - np.array([rows.mean(), columns.mean()])[:, None, None])) < 12.0
    shown[middle] = unit(pyramid[middle] + np.array([0.0, 0.14, 0.0]))
    settled = settle(clusters_of(shown[None]), mask, ALONE)
    error = angles(conclude(with_pyramid(settled, pyramid)).normals, pyramid)[middle]
    assert error.max() < 3.0
    monkeypatch.setattr(explanations, "MIN_SEEN_SHARE", 2.0)
    assert angles(conclude(with_pyramid(settled, pyramid)).normals, pyramid)[middle].mean() > 5.0


def test_normals_beside_a_solid_that_they_contradict_are_not_confident(pyramid: np.ndarray) -> None:
    mask = np.isfinite(pyramid[..., 0])
    settled = settle(clusters_of(observable(pyramid)[None]), mask, ALONE)
    # By nearly the 6 degrees from which they refute it.
    turned = unit(pyramid + np.array([0.0, 0.118, 0.0]))
    right, wrong = (conclude(with_pyramid(settled, normals)).confidence[mask] for normals in (pyramid, turned))
    assert (right > 0.95).mean() > 0.4
    assert (wrong > 0.95).mean() < 0.1


def test_a_prism_is_explained_once(settled: Alternation) -> None:
    explained = explain(settled)
    assert settled.expected is None
    assert explain(explained).expected is explained.expected


@pytest.fixture(scope="module")
def frustum() -> np.ndarray:
    return Block(lean=12.0).render()[0]


@pytest.fixture(scope="module")
def settled_frustum(frustum: np.ndarray) -> Alternation:
    return settle(clusters_of(shown(frustum).astype(np.float32)), np.isfinite(frustum[..., 0]), ALONE)


def test_the_faces_that_never_showed_the_light_follow_from_a_faceted_body(
    settled_frustum: Alternation, frustum: np.ndarray
) -> None:
    mask, without = settled_frustum.view.mask, copy(settled_frustum)
    without.options = LabellingOptions(symmetry=False, readmission=False, flat_faces=False)
    before, after = (
        angles(conclude(explain(state)).normals, frustum)[mask].mean() for state in (without, settled_frustum)
    )
    assert before > 15.0
    assert after < 5.0


def otherwise_where_dark(settled: Alternation, truth: np.ndarray, turn: float) -> np.ndarray:
    """Return the true normals (H, W, 3), turned to the right where the object shows no highlight."""
    is_dark = ~np.isfinite(settled.view.normals[..., 0]).any(axis=0)
    return np.where(is_dark[..., None], unit(truth + np.array([turn, 0.0, 0.0])), truth)


def test_of_the_same_solid_a_prism_is_preferred(settled: Alternation, truth: np.ndarray) -> None:
    faces, depths = np.zeros(truth.shape[:2], int), np.zeros(truth.shape[:2], np.float32)
    turned, another = unit(truth + np.array([0.05, 0.0, 0.0])), otherwise_where_dark(settled, truth, 0.8)
    for other, preferred in ((turned, truth), (another, None)):
        facets = bodies_of(PolyhedralNormals(other, depths, faces, 90.0))
        state = with_searches(settled, prism=prism_of(truth, faces, 60.0), facets=facets)
        expected = explain(state).expected
        assert expected is not None
        assert np.array_equal(expected, other if preferred is None else preferred, equal_nan=True)


@pytest.mark.parametrize(
    ("relief_fit", "round_error", "log_ratio", "is_faceted"),
    [(0.3, 9.0, 60.0, True), (0.3, 9.0, 30.0, False), (0.3, 4.0, 60.0, False), (0.0, 9.0, 60.0, False)],
)
def test_facets_take_the_place_of_a_relief_that_hardly_fits(
    settled: Alternation, truth: np.ndarray, relief_fit: float, round_error: float, log_ratio: float, is_faceted: bool
) -> None:
    faces, depths = np.zeros(truth.shape[:2], int), np.zeros(truth.shape[:2], np.float32)
    rotational = RotationalNormals(truth.astype(np.float32), depths, relief_fit, round_error)
    search = SimpleNamespace(normals=lambda *_: rotational, supposed_normals=lambda _: None, best=None)
    turned = otherwise_where_dark(settled, truth, 0.3)
    facets = bodies_of(PolyhedralNormals(turned, depths, faces, log_ratio))
    state = with_searches(settled, symmetry=search, prism=search, facets=facets)
    state.options = LabellingOptions(readmission=False)
    expected = explain(state).expected
    assert expected is not None
    assert np.array_equal(expected, turned if is_faceted else rotational.normals, equal_nan=True)


def test_a_rounded_prism_comes_before_a_solid_that_explains_no_more(settled: Alternation, truth: np.ndarray) -> None:
    faces, depths = np.zeros(truth.shape[:2], int), np.zeros(truth.shape[:2], np.float32)
    nowhere, is_left = (
        unit(truth + np.array([0.15, 0.0, 0.0])),
        np.arange(truth.shape[1])[:, None] < truth.shape[1] // 2,
    )
    less = np.where(is_left, nowhere, truth)
    as_much = PolyhedralNormals(otherwise_where_dark(settled, truth, 0.8), depths, faces, 90.0)
    for facets, normals, is_first in ((as_much, truth, True), (as_much, less, False)):
        rounded = prism_of(normals, faces, 80.0)
        state = with_searches(settled, prism=NO_PRISM, rounded=rounded, facets=bodies_of(facets))
        solids = likely_solids(state)
        assert len(solids) == 2
        assert (solids[0] is rounded.best) is is_first
    # By itself it need not explain as much as the field.
    alone = with_searches(settled, prism=NO_PRISM, rounded=prism_of(less, faces, 80.0), facets=bodies_of())
    assert [solid.log_ratio for solid in likely_solids(alone)] == [80.0]
    for refused in (prism_of(truth, faces, 0.5 * MIN_SOLID_NATS), prism_of(nowhere, faces, 80.0)):
        assert likely_solids(with_searches(settled, prism=NO_PRISM, rounded=refused, facets=bodies_of())) == []


def test_a_square_vessel_must_explain_more_than_any_solid(settled: Alternation, truth: np.ndarray) -> None:
    faces, depths = np.zeros(truth.shape[:2], int), np.zeros(truth.shape[:2], np.float32)
    less = otherwise_where_dark(settled, truth, 0.3)
    is_left = np.arange(truth.shape[1])[:, None] < truth.shape[1] // 2
    half = np.where(is_left, unit(truth + np.array([0.3, 0.0, 0.0])), truth)
    for normals, is_vessel in ((half, True), (less, False)):
        solid = PolyhedralNormals(normals, depths, faces, 90.0)
        state = with_searches(settled, prism=NO_PRISM, angular=vessel_of(truth), facets=bodies_of(solid))
        solids = [solid]
        assert (likely_vessel(solids, state) is state.view.angular.best) is is_vessel
    nowhere = unit(truth + np.array([0.3, 0.0, 0.0]))
    assert likely_vessel([], with_searches(settled, angular=vessel_of(nowhere))) is None
    assert likely_vessel([], with_searches(settled)) is None


def test_labels_start_again_from_a_square_vessel(settled: Alternation, truth: np.ndarray) -> None:
    searches = {"prism": NO_PRISM, "facets": bodies_of(), "angular": vessel_of(truth)}
    state = explain(with_searches(settled, **searches))
    assert state.expected is not None
    assert np.array_equal(state.expected, truth.astype(np.float32), equal_nan=True)
    assert state.body_depth is not None


def test_a_square_vessel_takes_the_place_of_a_body_that_explains_little(
    settled: Alternation, truth: np.ndarray
) -> None:
    nowhere = unit(truth + np.array([0.3, 0.0, 0.0]))
    for normals, is_vessel in ((nowhere, True), (truth, False)):
        state = with_searches(settled, angular=vessel_of(truth))
        assert is_angular_vessel(normals, state) is is_vessel


def test_a_rounded_prism_takes_the_place_of_a_body_of_revolution(settled: Alternation, truth: np.ndarray) -> None:
    faces, depths = np.zeros(truth.shape[:2], int), np.zeros(truth.shape[:2], np.float32)
    rotational = RotationalNormals(truth.astype(np.float32), depths, 0.0, 2.0)
    symmetry = SimpleNamespace(normals=lambda *_: rotational, supposed_normals=lambda _: None, unproven_normals=None)
    turned = otherwise_where_dark(settled, truth, 0.3)
    for log_ratio, expected in ((80.0, turned), (0.5 * MIN_SOLID_NATS, rotational.normals)):
        searches = {"symmetry": symmetry, "prism": NO_PRISM, "facets": bodies_of()}
        state = with_searches(settled, rounded=prism_of(turned, faces, log_ratio), **searches)
        state.options = LabellingOptions(readmission=False)
        assert np.array_equal(explain(state).expected, expected, equal_nan=True)  # type: ignore[arg-type]
