"""What explains settled labels: a right prism, unless accepted normals contradict it."""

from copy import copy
from types import SimpleNamespace

import numpy as np
import pytest

from glint.tasks.algorithms.facets.faceted_normals import FacetSearch
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.alternation import Alternation
from glint.tasks.algorithms.labelling.explanations import MIN_SOLID_NATS, explain
from glint.tasks.algorithms.labelling.reconstruction import conclude, settle
from glint.tasks.algorithms.labelling.weights import LabellingOptions
from glint.tasks.algorithms.prisms.polyhedron import PolyhedralNormals
from glint.tasks.algorithms.prisms.prismatic_normals import PrismSearch
from tests.tasks.algorithms.faces.polyhedron import PYRAMID, face_numbers, polyhedron_normals
from tests.tasks.algorithms.labelling.test_reconstruction import clusters_of
from tests.tasks.algorithms.prisms.block import Block
from tests.tasks.algorithms.prisms.test_prismatic_normals import shown
from tests.tasks.algorithms.revolution.beaker import observable

ALONE = LabellingOptions(symmetry=False, readmission=False)
NO_BODY: FacetSearch = SimpleNamespace(likeliest=[])  # type: ignore[assignment]


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    return Block().render()[0]


@pytest.fixture(scope="module")
def settled(truth: np.ndarray) -> Alternation:
    return settle(clusters_of(shown(truth).astype(np.float32)), np.isfinite(truth[..., 0]), ALONE)


def prism_of(normals: np.ndarray, faces: np.ndarray, log_ratio: float) -> PrismSearch:
    depths = np.zeros(normals.shape[:2], np.float32)
    return SimpleNamespace(best=PolyhedralNormals(normals, depths, faces, log_ratio))  # type: ignore[return-value]


def test_the_faces_that_never_showed_the_light_follow_from_a_prism(settled: Alternation, truth: np.ndarray) -> None:
    mask = settled.mask
    without = copy(settled)
    without.options = LabellingOptions(symmetry=False, readmission=False, flat_faces=False)
    before, after = (angles(conclude(explain(state)).normals, truth)[mask].mean() for state in (without, settled))
    assert before > 15.0
    assert after < 5.0


def test_confident_normals_of_a_prism_are_right(settled: Alternation, truth: np.ndarray) -> None:
    result = conclude(explain(settled))
    confident = result.confidence >= 0.95
    assert (angles(result.normals, truth)[confident] < 5.0).mean() > 0.95
    assert result.body_depth is not None
    # Most of it never showed the light, and is not certain.
    assert confident.sum() < 0.6 * settled.mask.sum()


def test_accepted_normals_that_contradict_a_prism_take_more_evidence(settled: Alternation, truth: np.ndarray) -> None:
    contradicting = copy(settled)
    contradicting.known, contradicting.values = settled.mask, np.where(settled.mask[..., None], [0.0, 0.0, 1.0], np.nan)

    def adopts(state: Alternation, log_ratio: float) -> bool:
        state = copy(state)
        state.prism = prism_of(truth, np.zeros(truth.shape[:2], int), log_ratio)
        state.facets = NO_BODY
        return explain(state).expected is not None

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
        state, normals = copy(settled), pyramid.copy()
        normals[mask & (numbers == wrong)] = [0.0, 0.0, 1.0]
        state.prism = prism_of(normals, np.where(mask, numbers, -1), 100.0)
        state.facets = NO_BODY
        assert (explain(state).expected is not None) is expected


def test_a_prism_is_explained_once(settled: Alternation) -> None:
    explained = explain(settled)
    assert settled.expected is None
    assert explain(explained).expected is explained.expected
