"""Candidates of an ellipsoid under lights that are right, mirrored, turned, or out of order."""

import numpy as np
import pytest

from glint.tasks.algorithms.labelling.light_evidence import LightEvidence, light_evidence, turn_angle
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


def test_too_few_normals_have_no_turn() -> None:
    assert np.isnan(turn_angle(np.full((2, 20, 20, 3), np.nan, np.float32), 8.0)).all()
