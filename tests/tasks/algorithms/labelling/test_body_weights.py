"""What the fit of a body of revolution to the candidates changes: weights, the field's error, confidence."""

from copy import copy

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.alternation import Alternation
from glint.tasks.algorithms.labelling.final_confidence import final_confidence
from glint.tasks.algorithms.labelling.reconstruction import settle
from glint.tasks.algorithms.labelling.results import blended_normals
from glint.tasks.algorithms.vessels.body_fit import NEIGHBOURHOOD_DEG, RIVALRIES, USUAL_FIELD_DEG, WALL_SHARES, BodyFit
from tests.tasks.algorithms.labelling.scenes import SHEETS_ALONE, Scene, pebble


@pytest.fixture(scope="module")
def scene() -> Scene:
    return pebble(60)


@pytest.fixture(scope="module")
def settled(scene: Scene) -> Alternation:
    clusters, mask, _ = scene
    return settle(clusters, mask, SHEETS_ALONE)


def with_body(settled: Alternation, normals: np.ndarray, fit: BodyFit | None) -> Alternation:
    state = copy(settled)
    state.expect(normals, None, fit)
    return state


def fit_of(settled: Alternation, scatter: float = 4.0, deviation: float = 1.0, rivalry: float = 0.0) -> BodyFit:
    return BodyFit(scatter, deviation, np.full(settled.view.mask.shape, rivalry))


def test_a_body_counts_beside_accepted_normals_by_its_trust(scene: Scene, settled: Alternation) -> None:
    truth, known, weights = scene[2], settled.known, settled.options.field
    rest = settled.view.mask & ~known
    alone = with_body(settled, truth, None)
    targets, pull = alone.constraints(known, settled.values)
    assert np.array_equal(targets[known], settled.values[known]) and (pull[known] == weights.observed).all()
    assert np.array_equal(targets[rest], truth[rest]) and (pull[rest] == weights.expected).all()

    # Twice as small a deviation as that of neighbouring candidates: four times the weight of an accepted normal.
    fit = fit_of(settled, scatter=2.0, deviation=NEIGHBOURHOOD_DEG / 2.0)
    targets, pull = with_body(settled, truth, fit).constraints(known, settled.values)
    np.testing.assert_allclose(targets[known], 0.2 * settled.values[known] + 0.8 * truth[known], atol=1e-7)
    np.testing.assert_allclose(pull[known], 5.0 * weights.observed)
    # A quarter of a usual field's deviation: sixteen times its weight.
    np.testing.assert_allclose(pull[rest], (USUAL_FIELD_DEG / fit.deviation_deg) ** 2 * weights.expected)


def test_candidates_that_scatter_little_about_a_body_are_told_from_others_by_small_angles(
    scene: Scene, settled: Alternation
) -> None:
    truth = scene[2]
    narrow, wide = (with_body(settled, truth, fit_of(settled, scatter)) for scatter in (1.2, 4.0))
    ratios = narrow.log_ratios() - wide.log_ratios()
    far = angles(settled.view.normals, narrow.smooth) > 10.0
    near = angles(settled.view.normals, narrow.smooth) < 1.0
    assert far.sum() > 100 and near.sum() > 100
    assert ratios[far & settled.known].max() < 0.0 < ratios[near & settled.known].min()


def test_normals_of_a_circle_that_shows_two_slopes_are_not_confident(scene: Scene, settled: Alternation) -> None:
    truth, mask = scene[2], settled.view.mask
    normals = blended_normals(settled.values, settled.smooth)
    sure, doubtful = (
        final_confidence(with_body(settled, truth, fit_of(settled, rivalry=rivalry)), normals)[mask]
        for rivalry in (0.0, RIVALRIES[-1])
    )
    accepted = np.isfinite(settled.confidence[mask])
    np.testing.assert_allclose(doubtful[accepted], WALL_SHARES[-1] * sure[accepted])
    assert (doubtful[~accepted] <= WALL_SHARES[-1] * sure[~accepted] + 1e-9).all() and sure[~accepted].max() > 0.5
