"""Square and rectangular vessels that a silhouette and candidates show."""

import numpy as np
import pytest

from glint.tasks.algorithms.angular_bodies.angular_search import AngularSearch
from glint.tasks.algorithms.angular_bodies.body_agreement import SampledCandidates
from glint.tasks.algorithms.geometry.perspective import rotate_to_view, view_vectors
from tests.tasks.algorithms.angular_bodies.square_vessel import CAMERA, INVERSE_FOCAL, SHAPE, SquareVessel
from tests.tasks.algorithms.prisms.block import shown


def search_of(vessel: SquareVessel) -> AngularSearch:
    truth = vessel.render()
    mask = np.isfinite(truth[..., 0])
    rays = view_vectors(CAMERA, SHAPE, 0.0, 0.0) if vessel.inverse_focal else None
    sample = SampledCandidates.of(rotate_to_view(shown(truth), rays), mask)
    assert sample is not None
    return AngularSearch(mask, sample, vessel.inverse_focal)


@pytest.mark.parametrize(
    "vessel",
    [
        SquareVessel(),
        pytest.param(SquareVessel(turn=30.0, half_depth=27.0, tilt=18.0), marks=pytest.mark.slow),
        SquareVessel(turn=-25.0, taper=5.0, inverse_focal=INVERSE_FOCAL),
    ],
    ids=["square", "rectangle", "perspective"],
)
def test_the_true_vessel_agrees_with_candidates_most(vessel: SquareVessel) -> None:
    best = search_of(vessel).best
    assert best is not None
    placement, agreement = best
    section = placement.polygon
    assert agreement > 0.2
    assert abs(np.degrees(placement.tilt) - vessel.tilt) < 2.0
    quarters = (np.degrees(section.turn) - vessel.turn) / 90.0
    assert abs(quarters - round(quarters)) * 90.0 < 4.0
    # About a quarter turn the second side is the first.
    ratio = section.width if round(quarters) % 2 == 0 else 1.0 / section.width
    assert abs(ratio - vessel.half_depth / vessel.half_width) < 0.15
    assert abs(section.rounding - vessel.corner / vessel.half_width) < 0.2


def test_stray_candidates_agree_with_no_vessel() -> None:
    truth = SquareVessel().render()
    stray = np.concatenate([shown(truth, seed)[1:] for seed in range(8)])
    sample = SampledCandidates.of(stray, np.isfinite(truth[..., 0]))
    assert sample is not None
    best = AngularSearch(np.isfinite(truth[..., 0]), sample, 0.0).best
    assert best is None or best.agreement < 0.03


def test_without_candidates_there_is_nothing_to_compare() -> None:
    mask = np.ones((20, 20), bool)
    assert SampledCandidates.of(np.full((1, 20, 20, 3), np.nan), mask) is None


def test_a_body_that_misses_a_part_of_the_silhouette_agrees_less() -> None:
    search = search_of(SquareVessel())
    best = search.best
    assert best is not None
    body = search.body(best.placement)
    whole, cut = (search.shown.agreement(body.cut_off(length), 6.0) for length in (0.0, 20.0))
    assert whole > cut + 0.1
