"""How well a body explains candidates: noise, and a deviation that neighbours share."""

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.revolution.symmetry import RotationalNormals
from glint.tasks.algorithms.vessels.body_fit import LARGEST_SCATTER_DEG, MAX_PRECISION, MAX_TRUST, body_fit

SHAPE = (80, 90)
MASK = np.hypot(*(np.indices(SHAPE) - np.array([40, 45])[:, None, None])) < 35
INRADIUS = 35.0
TOWARDS_CAMERA = np.broadcast_to(np.array([0.0, 0.0, 1.0]), (*SHAPE, 3))
BODY = RotationalNormals(TOWARDS_CAMERA, np.zeros(SHAPE), 0.0, 0.0)


def candidates(noise_deg: float, deviation_deg: float = 0.0) -> np.ndarray:
    """Return candidates (1, H, W, 3) that scatter about normals which lean to the right by a deviation."""
    scatter = np.random.default_rng(0).normal(0.0, np.radians(noise_deg), (*SHAPE, 3))
    return unit(TOWARDS_CAMERA + scatter + np.array([np.radians(deviation_deg), 0.0, 0.0]))[None]


@pytest.mark.parametrize("noise", [1.2, 2.0, 3.0])
def test_the_scatter_of_an_exact_body_is_the_candidates_noise(noise: float) -> None:
    fit = body_fit(BODY, candidates(noise), MASK, INRADIUS)
    assert fit.scatter_deg == pytest.approx(noise, rel=0.1)
    assert fit.deviation_deg < 0.3 * noise


def test_a_deviation_that_neighbours_share_remains_when_noise_is_averaged() -> None:
    fit = body_fit(BODY, candidates(1.5, 2.0), MASK, INRADIUS)
    assert fit.deviation_deg == pytest.approx(2.0, abs=0.1)
    assert fit.trust < 0.1


def test_an_exact_body_outweighs_what_was_observed_up_to_a_limit() -> None:
    exact, less = (body_fit(BODY, candidates(0.3, deviation), MASK, INRADIUS) for deviation in (0.0, 0.4))
    assert exact.trust == MAX_TRUST
    assert 1.0 < less.trust < MAX_TRUST


def test_false_candidates_far_from_the_body_do_not_count() -> None:
    true = candidates(1.5)
    false = unit(true + np.array([0.3, 0.0, 0.0]))
    alone, both = (body_fit(BODY, shown, MASK, INRADIUS) for shown in (true, np.concatenate([false, true])))
    assert both.scatter_deg == pytest.approx(alone.scatter_deg, rel=0.02)
    assert both.deviation_deg == pytest.approx(alone.deviation_deg, rel=0.02)


def test_a_body_that_no_candidate_confirms_is_not_trusted() -> None:
    far = unit(candidates(1.0) + np.array([0.5, 0.0, 0.0]))
    for shown in (far, np.full_like(far, np.nan), np.zeros((0, *SHAPE, 3))):
        fit = body_fit(BODY, shown, MASK, INRADIUS)
        assert fit.scatter_deg == LARGEST_SCATTER_DEG
        assert fit.trust < 0.05


def test_confidence_falls_where_another_slope_is_shown_as_often() -> None:
    rivalry = np.zeros(SHAPE)
    rivalry[40:60], rivalry[60:] = 0.5, 1.2
    confidence = body_fit(BODY._replace(rivalry=rivalry), candidates(1.5), MASK, INRADIUS).confidence
    assert (confidence[:40] == 1.0).all()
    assert (confidence[40:60] < 1.0).all() and (confidence[40:60] > 0.95).all()
    assert (confidence[60:] < 0.9).all()


def test_a_body_of_which_no_rivalry_is_known_keeps_its_confidence() -> None:
    assert (body_fit(BODY, candidates(1.5), MASK, INRADIUS).confidence == 1.0).all()


def test_a_body_predicts_what_is_dark_by_its_deviation() -> None:
    exact, off, far = (body_fit(BODY, candidates(0.3, deviation), MASK, INRADIUS) for deviation in (0.0, 0.5, 2.0))
    assert exact.precision == MAX_PRECISION
    assert off.precision == pytest.approx(4.0, rel=0.2)
    assert far.precision == 1.0
