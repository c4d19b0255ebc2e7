"""Candidates of an ellipsoid under lights that are right, mirrored, turned, or out of order."""

import numpy as np
import pytest

from glint.tasks.algorithms.sheets.integrability import shape_log_ratio
from glint.tasks.algorithms.sheets.light_evidence import LightEvidence, light_evidence, turn_angle
from tests.scene import ellipsoid, false_directions

SCALE = 23.0


def _evidence(change: np.ndarray | None = None, with_rear: bool = True) -> LightEvidence:
    """Return the evidence of a capture whose rear wall shows highlights too, which are nearly opposite."""
    normals, _, mask = ellipsoid()
    layers = [normals, false_directions(normals, mask)] if with_rear else [normals]
    candidates = np.stack(layers).astype(np.float32)
    # Only lights before the object cause highlights.
    candidates[candidates[..., 2] < np.cos(np.radians(45))] = np.nan
    if change is not None:
        candidates = (candidates @ change.T).astype(np.float32)
    labels = np.stack([mask, np.zeros_like(mask)][: len(layers)])
    return light_evidence(candidates, labels, normals, mask & np.isfinite(candidates[0, ..., 0]), SCALE)


def _turn(degrees: float) -> np.ndarray:
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])


def test_right_lights_are_not_doubted() -> None:
    evidence = _evidence()
    assert not (evidence.has_other_axes or evidence.is_turned or evidence.has_no_surface)
    assert not evidence.has_half_vectors
    assert evidence.axes_ratio < 0.9 and abs(evidence.turn_deg) < 0.5


@pytest.mark.parametrize(
    ("change", "axes"),
    [
        (np.diag([-1, 1, 1]), "x negated"),
        (np.diag([1, -1, 1]), "y negated"),
        (_turn(90), "turned by 90 degrees clockwise"),
        (_turn(-90), "turned by 90 degrees counter-clockwise"),
        (np.array([[0, 1, 0], [1, 0, 0], [0, 0, 1]]), "x and y exchanged"),
    ],
)
def test_other_axes_are_named_by_what_corrects_them(change: np.ndarray, axes: str) -> None:
    evidence = _evidence(change)
    assert evidence.has_other_axes and evidence.axes == axes


def test_opposite_axes_are_named_where_no_rear_wall_looks_like_them() -> None:
    opposite = np.diag([-1, -1, 1])
    assert _evidence(opposite, with_rear=False).has_other_axes
    assert _evidence(opposite, with_rear=False).axes == "x and y negated"
    assert not _evidence(opposite).has_other_axes


def test_half_vectors_in_place_of_lights_are_told() -> None:
    normals, _, mask = ellipsoid()
    given = normals + np.array([0.0, 0.0, 1.0])
    candidates = (given / np.linalg.norm(given, axis=-1, keepdims=True))[None].astype(np.float32)
    candidates[normals[None, ..., 2] < np.cos(np.radians(45))] = np.nan
    evidence = light_evidence(candidates, mask[None], normals, mask & np.isfinite(candidates[0, ..., 0]), SCALE)
    assert evidence.has_half_vectors and not evidence.has_other_axes


@pytest.mark.parametrize("degrees", [-20.0, 7.0, 12.0])
def test_a_turn_is_measured(degrees: float) -> None:
    evidence = _evidence(_turn(degrees))
    assert evidence.is_turned and not evidence.has_other_axes
    assert evidence.turn_deg == pytest.approx(degrees, abs=1.0)
    assert evidence.turn_error_deg < 1.0


def test_normals_in_no_order_are_no_surface() -> None:
    normals, _, mask = ellipsoid()
    generator = np.random.default_rng(0)
    shuffled = normals[mask][generator.permutation(mask.sum())]
    candidates = np.full((1, *normals.shape), np.nan, np.float32)
    candidates[0, mask] = shuffled
    assert light_evidence(candidates, mask[None], normals, mask, SCALE).has_no_surface


def test_the_evidence_is_the_mean_of_the_best_candidates() -> None:
    normals, _, mask = ellipsoid()
    candidates = np.stack([normals, false_directions(normals, mask)]).astype(np.float32)
    candidates[0, :, ::2] = candidates[1, ::3] = np.nan
    observed = mask & np.isfinite(candidates[..., 0]).any(axis=0)
    best = np.nanmax(shape_log_ratio(candidates, SCALE)[:, observed], axis=0)
    evidence = light_evidence(candidates, np.zeros(candidates.shape[:3], bool), normals, observed, SCALE)
    assert evidence.log_ratio == pytest.approx(best.mean(), rel=1e-5)
    assert np.isnan(evidence.turn_deg) and not evidence.is_turned


@pytest.mark.parametrize(
    ("turn_deg", "error_deg", "is_turned"),
    [(3.1, 1.0, True), (-3.1, 1.0, True), (2.9, 0.1, False), (4.0, 1.3, True), (4.0, 1.4, False)],
)
def test_a_turn_is_three_degrees_and_three_standard_errors(turn_deg: float, error_deg: float, is_turned: bool) -> None:
    assert LightEvidence("x negated", 0.5, turn_deg, error_deg, 1.0).is_turned == is_turned


def test_candidates_look_like_no_surface_where_their_evidence_speaks_against_one() -> None:
    assert LightEvidence("x negated", 0.5, 0.0, 0.1, -0.01).has_no_surface
    assert not LightEvidence("x negated", 0.5, 0.0, 0.1, 0.01).has_no_surface


def test_normals_of_a_hollow_count_as_turned_by_half_a_turn() -> None:
    normals, _, _ = ellipsoid()
    hollow = (normals * [-1.0, -1.0, 1.0])[None].astype(np.float32)
    hollow[hollow[..., 2] < np.cos(np.radians(45.0))] = np.nan
    turn, error = turn_angle(hollow, SCALE)
    assert abs(turn) == pytest.approx(180.0, abs=0.5) and error < 0.5


def test_too_few_normals_have_no_turn() -> None:
    assert np.isnan(turn_angle(np.full((2, 20, 20, 3), np.nan, np.float32), 8.0)).all()
