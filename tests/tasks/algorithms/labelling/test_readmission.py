"""An ear before a head, of which the silhouette says nothing: rejected at first, and readmitted."""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.labelling import explanations
from glint.tasks.algorithms.labelling.alternation import Alternation
from glint.tasks.algorithms.labelling.readmission import (
    READMITTED_PROBABILITY,
    LabelledCandidates,
    plausible_sheets,
    surface_probability,
)
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals, settle
from glint.tasks.algorithms.labelling.weights import LabellingOptions
from glint.tasks.algorithms.sheets.patches import Patches
from tests.tasks.algorithms.labelling.scenes import Scene, head_with_ear

EarScene = tuple[Scene, np.ndarray]


@pytest.fixture(scope="module")
def ear_scene() -> EarScene:
    return head_with_ear()


@pytest.fixture(scope="module")
def settled(ear_scene: EarScene) -> Alternation:
    (clusters, mask, _), _ = ear_scene
    return settle(clusters, mask)


def test_the_ear_is_rejected_at_first_and_is_plausible(ear_scene: EarScene, settled: Alternation) -> None:
    _, ear = ear_scene
    assert settled.labels.any(axis=0)[ear].mean() < 0.2
    probability = plausible_sheets(settled)
    found = probability > 0.0
    assert found[0][ear & ~settled.labels[0]].mean() > 0.8
    assert not found[0][~ear].any() and not (found & settled.labels).any()
    assert ((probability[found] >= READMITTED_PROBABILITY) & (probability[found] < 1.0)).all()


def test_without_readmission_the_ear_is_lost(ear_scene: EarScene) -> None:
    (clusters, mask, _), ear = ear_scene

    def accepted(readmission: bool) -> float:
        labels = reconstruct_normals(
            clusters, mask, LabellingOptions(symmetry=False, flat_faces=False, readmission=readmission)
        ).labels
        return float(labels.any(axis=0)[ear].mean())

    assert accepted(True) > 0.8 and accepted(False) < 0.2


def test_nothing_is_readmitted_twice(settled: Alternation) -> None:
    state = copy(settled)
    probability = plausible_sheets(state)
    state.readmit(probability)
    state.labels = settled.labels  # rejected once more
    assert not (plausible_sheets(state)[probability > 0.0] > 0.0).any()


def test_of_two_sheets_at_a_pixel_the_more_probable_is_readmitted(ear_scene: EarScene) -> None:
    (clusters, mask, _), ear = ear_scene
    other = clusters.normals[0] + np.array([0.0, 0.3, 0.0], np.float32)
    other = np.where(ear[..., None], other / np.linalg.norm(other, axis=-1, keepdims=True), np.nan)
    normals = np.stack([clusters.normals[0], other])
    unknown, single = np.full((2, *mask.shape), np.nan), np.ones((2, *mask.shape))
    twice = replace(clusters, normals=normals, shading=unknown, weight=single)
    found = plausible_sheets(settle(twice, mask)) > 0.0
    assert found.any() and found.sum(axis=0).max() == 1


def test_a_sheet_marked_false_stays_rejected(ear_scene: EarScene) -> None:
    (clusters, mask, _), ear = ear_scene
    places = np.argwhere(ear)[::4].astype(np.int32)
    normals = clusters.normals[0][tuple(places.T)]
    false = Marks(places, normals, np.zeros(len(places), np.int8))
    result = reconstruct_normals(clusters, mask, LabellingOptions(symmetry=False, flat_faces=False), marks=false)
    assert result.labels.any(axis=0)[ear].mean() < 0.05


def test_given_expected_normals_are_not_contradicted(
    ear_scene: EarScene, settled: Alternation, monkeypatch: pytest.MonkeyPatch
) -> None:
    (clusters, mask, _), _ = ear_scene

    def refuse(_: Alternation) -> np.ndarray:
        pytest.fail("the expected normals are contradicted")

    monkeypatch.setattr(explanations, "plausible_sheets", refuse)
    reconstruct_normals(clusters, mask, expected=settled.smooth)


def test_an_expected_field_that_was_not_given_may_be_contradicted(ear_scene: EarScene, settled: Alternation) -> None:
    state = copy(settled)
    state.expect(settled.smooth, None)
    assert explanations.explain(state).labels.any(axis=0)[ear_scene[1]].mean() > 0.8


def test_labels_that_become_less_likely_are_not_kept(settled: Alternation, monkeypatch: pytest.MonkeyPatch) -> None:
    assert explanations._readmitted(settled) is not None
    likelihoods = iter([1.0, 2.0])  # after, before
    monkeypatch.setattr(Alternation, "log_likelihood", lambda _: next(likelihoods))
    assert explanations._readmitted(settled) is None


@pytest.mark.parametrize(
    ("change", "is_higher"),
    [("sure", False), ("beside", False), ("evident", True), ("tilted", True), ("often lit", False)],
)
def test_the_probability_follows_field_shape_tilt_and_lights(change: str, is_higher: bool) -> None:
    def probability(changed: str) -> float:
        shape = (1, 4, 8)
        number = np.repeat([0, 1], 16)
        row, column = np.tile(np.repeat(np.arange(4), 4), 2), np.tile(np.arange(4), 8) + 4 * number
        patches = Patches(number, np.zeros(32, int), row, column, 2)
        tilt = np.radians(40.0 if changed == "tilted" else 20.0)
        hypotheses = np.zeros((*shape, 3))
        hypotheses[..., 0], hypotheses[..., 2] = np.sin(tilt), np.cos(tilt)
        # The present normals are 15 degrees from the candidates, or twice as far.
        turned = tilt - np.radians(30.0 if changed == "beside" else 15.0)
        normals = np.broadcast_to([np.sin(turned), 0.0, np.cos(turned)], (*shape[1:], 3))
        confidence = np.full(shape[1:], 0.9 if changed == "sure" else 0.4)
        evidence = np.full(shape, 2.0 if changed == "evident" else 0.5)
        observations = np.full(shape[1:], 10)
        observations[:, :4] = 40 if changed == "often lit" else 10
        candidates = LabelledCandidates(hypotheses, np.zeros(shape, bool), evidence, observations)
        return float(surface_probability(patches, candidates, normals, confidence)[0])

    assert 0.0 < probability("") < 1.0
    assert (probability(change) > probability("")) == is_higher


def test_the_probability_weighs_the_present_normal_against_the_patch_and_its_evidence() -> None:
    away, tilt, confidence, evidence = np.radians(15.0), np.radians(30.0), 0.4, 1.5
    patches = Patches(np.zeros(16, int), np.zeros(16, int), *np.divmod(np.arange(16), 4), count=1)
    candidates = LabelledCandidates(
        np.broadcast_to([np.sin(tilt), 0.0, np.cos(tilt)], (1, 4, 4, 3)),
        np.zeros((1, 4, 4), bool),
        np.full((1, 4, 4), evidence),
        np.full((4, 4), 10),
    )
    normals = np.broadcast_to([np.sin(tilt - away), 0.0, np.cos(tilt - away)], (4, 4, 3))

    def density(spread: float) -> float:
        return float(np.exp(-(away**2) / (2.0 * spread**2)) / (2.0 * np.pi * spread**2))

    likelihood = confidence * density(np.radians(2.5)) + (1.0 - confidence) * density(np.radians(25.0))
    cap = 2.0 * np.pi * (1.0 - np.cos(np.pi / 4.0))
    # No node is exterior, which counts as a tenth of them; the odds rise by e in 10 degrees of slant.
    odds = likelihood * cap * (0.1 / 0.9) * np.exp(evidence + 0.1 * 30.0 - 4.0)
    probability = surface_probability(patches, candidates, normals, np.full((4, 4), confidence))
    assert probability == pytest.approx([odds / (1.0 + odds)], rel=1e-6)
