"""Alternation of labels and field: when it ends, and false sheets on a body of revolution."""

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.labelling.alternation import Alternation
from glint.tasks.algorithms.labelling.candidate_view import CandidateView
from glint.tasks.algorithms.labelling.explanations import explain
from glint.tasks.algorithms.labelling.reconstruction import conclude, settle
from glint.tasks.algorithms.labelling.results import CONFIDENT
from glint.tasks.algorithms.labelling.weights import LabellingOptions
from tests.tasks.algorithms.labelling.scenes import Scene, clusters_of, pebble
from tests.tasks.algorithms.revolution.beaker import SHAPE, camera_positions, upright_surface


class Swinging(Alternation):
    """Alternation whose labels are one of two states in turn."""

    def label(self) -> int:
        """Accept all first candidates, and in every other round those of the upper half alone."""
        previous, self.labels = self.labels, np.zeros_like(self.labels)
        self.labels[0] = np.isfinite(self.view.normals[0, ..., 0])
        if len(self.history) % 2:
            self.labels[0, self.labels.shape[1] // 2 :] = False
        return int((previous != self.labels).any(axis=0).sum())


def test_labels_that_swing_between_two_states_have_settled() -> None:
    clusters, mask, _ = pebble()
    options = LabellingOptions(max_iterations=10)
    state = Swinging(CandidateView.of(clusters, mask, options), options)
    state.iterate()
    assert len(state.history) == 3
    assert state.history[-1].changed > 0.1 * mask.sum()


def thick_walled_vase(deviation_deg: float = 0.0) -> Scene:
    """Clusters, mask and truth of a vase, of which the lower left part shows a smooth sheet that leans 9 degrees.

    The true sheet is noisy and has gaps. deviation_deg: by which all true normals lean to the right.
    """
    heights = np.arange(-75.0, 76.0, 0.5)
    radii = 45.0 + 4.0 * np.sin(heights / 25.0)
    radii[[0, -1]] = 0.0
    vase = upright_surface(radii, heights, 12.0)
    rng, (x, y) = np.random.default_rng(0), camera_positions()
    hits = vase.intersect(x.ravel(), y.ravel())
    truth = vase.normals_at(hits).reshape(*SHAPE, 3)
    mask, upward = np.isfinite(truth[..., 0]), vase.frame.upward
    truth = unit(truth + np.array([np.radians(deviation_deg), 0.0, 0.0]))
    shown, lower = truth[..., 2] > 0.75, hits.heights.reshape(SHAPE) < -5.0
    true, false = truth + rng.normal(0.0, np.radians(1.2), truth.shape), truth + np.radians(9.0) * upward
    true[~shown | (rng.random(SHAPE) < 0.3)] = np.nan
    false[~shown | ~lower | (x > -5.0)] = np.nan
    return clusters_of(unit(np.stack([false, true])).astype(np.float32)), mask, truth


def test_a_smooth_false_sheet_on_a_body_of_revolution_is_rejected() -> None:
    clusters, mask, truth = thick_walled_vase()
    state = explain(settle(clusters, mask))
    assert state.body_fit is not None
    result = conclude(state)
    both = np.isfinite(clusters.normals[..., 0]).all(axis=0)
    accepted = result.labels[:, both]
    assert accepted[0].sum() < 0.05 * accepted[1].sum()
    error = angles(result.normals, truth)
    assert error[both].mean() < 1.5
    assert (error[result.confidence >= CONFIDENT] < 5.0).mean() > 0.98


def test_hand_made_glass_is_followed_where_it_deviates_from_its_body() -> None:
    clusters, mask, truth = thick_walled_vase(deviation_deg=3.0)
    alone = clusters_of(clusters.normals[1:])
    state = explain(settle(alone, mask))
    assert state.body_fit is not None
    assert state.body_fit.deviation_deg == pytest.approx(3.0, abs=1.0)
    known = np.isfinite(alone.normals[0, ..., 0])
    assert state.expected is not None
    assert angles(state.expected, truth)[known].mean() > 2.0
    assert angles(conclude(state).normals, truth)[known].mean() < 1.5


def test_a_body_without_candidates_keeps_its_field() -> None:
    empty = clusters_of(np.full((1, *SHAPE, 3), np.nan, np.float32))
    _, mask, _ = thick_walled_vase()
    assert explain(settle(empty, mask)).body_fit is None
