"""Proposals on a pebble whose labels are right, until one sheet is given the wrong one."""

from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals
from glint.tasks.algorithms.labelling.results import FILLED, Reconstruction
from glint.tasks.algorithms.questions.proposals import Question, propose
from tests.tasks.algorithms.labelling.scenes import SHEETS_ALONE, Scene, clusters_of, pebble

PATCH = np.s_[25:37, 20:32]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return pebble(60)


@pytest.fixture(scope="module")
def doubtful(scene: Scene) -> Reconstruction:
    """The labelling with a patch of the true sheet rejected, filled 20 degrees beside the truth, and doubted."""
    clusters, mask, _ = scene
    result = reconstruct_normals(clusters, mask, SHEETS_ALONE)
    labels, normals = result.labels.copy(), result.normals.copy()
    provenance, confidence = result.provenance.copy(), np.where(mask, np.float32(0.99), np.nan)
    labels[:, PATCH[0], PATCH[1]] = 0
    turned = normals[PATCH] + np.array([0.0, np.tan(np.radians(20.0)), 0.0], np.float32)
    normals[PATCH] = turned / np.linalg.norm(turned, axis=-1, keepdims=True)
    provenance[PATCH], confidence[PATCH] = FILLED, 0.1
    return replace(result, labels=labels, normals=normals, provenance=provenance, confidence=confidence)


def test_the_doubtful_sheet_is_asked_about_first(scene: Scene, doubtful: Reconstruction) -> None:
    clusters, mask, truth = scene
    first = propose(clusters, mask, doubtful, None, 3)[0]
    assert not first.exterior
    assert (np.isin(first.rows, range(25, 37)) & np.isin(first.columns, range(20, 32))).all()
    cosine = (clusters.normals[first.layers, first.rows, first.columns] * truth[first.rows, first.columns]).sum(axis=-1)
    assert np.median(cosine) > np.cos(np.radians(5.0))
    assert first.change > 20.0 * len(first.rows) * 0.8


def test_an_answered_sheet_is_not_asked_about_again(scene: Scene, doubtful: Reconstruction) -> None:
    clusters, mask, _ = scene
    first = propose(clusters, mask, doubtful, None, 1)[0]
    nodes = first.layers, first.rows, first.columns
    marks = Marks(
        np.stack([first.rows, first.columns], axis=1).astype(np.int32),
        clusters.normals[nodes],
        np.ones(len(first.rows), np.int8),
    )
    asked = set(zip(*(index.tolist() for index in nodes), strict=True))
    others = propose(clusters, mask, doubtful, marks, 5)
    assert others
    for question in others:
        assert not asked & set(
            zip(question.layers.tolist(), question.rows.tolist(), question.columns.tolist(), strict=True)
        )


def test_proposals_are_few_distinct_and_in_order(scene: Scene, doubtful: Reconstruction) -> None:
    clusters, mask, _ = scene
    questions = propose(clusters, mask, doubtful, None, 4)
    assert 1 < len(questions) <= 4
    ranks = [(question.urgency, question.value) for question in questions]
    assert ranks == sorted(ranks, reverse=True)
    nodes = [set(zip(q.layers.tolist(), q.rows.tolist(), q.columns.tolist(), strict=True)) for q in questions]
    assert sum(map(len, nodes)) == len(set().union(*nodes))


def test_open_labels_come_first_and_rejected_sheets_that_may_be_true_before_accepted_ones(
    scene: Scene, doubtful: Reconstruction
) -> None:
    clusters, mask, _ = scene
    accepted = doubtful.labels.any(axis=0)
    accepted[:, 40:] = False
    doubted = replace(doubtful, confidence=np.where(accepted, np.float32(0.3), doubtful.confidence))
    questions = propose(clusters, mask, doubted, None, 40)
    are_open = [question.is_open for question in questions]
    assert any(are_open) and not all(are_open) and are_open == sorted(are_open, reverse=True)
    assert any(question.value > questions[0].value for question in questions if not question.is_open)
    places = np.zeros(1, int)
    ranks = [
        Question(places, places, places, exterior, wrong, 1.0).urgency
        for exterior, wrong in ((False, 0.3), (True, 0.6), (False, 0.1), (True, 0.1))
    ]
    assert ranks == [2, 1, 0, 0]


def test_without_candidates_nothing_is_asked(scene: Scene, doubtful: Reconstruction) -> None:
    clusters, mask, _ = scene
    empty = clusters_of(np.full_like(clusters.normals, np.nan))
    assert propose(empty, mask, doubtful, None, 5) == []
