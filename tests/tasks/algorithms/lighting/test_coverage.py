import numpy as np
import pytest

from glint.tasks.algorithms.lighting.coverage import (
    CAP_MAP_RADIUS,
    SIDES,
    Gap,
    _gaps,
    cap_directions,
    coverage,
    gaps_message,
    is_observable,
    share_between,
)
from tests.tasks.algorithms.lighting.light_sweep import sweep


def test_the_map_is_equal_in_area_and_ends_at_45_degrees() -> None:
    directions = cap_directions(200)
    inside = np.isfinite(directions[..., 0])
    assert inside.mean() == pytest.approx(np.pi / 4, abs=0.01)
    assert directions[inside][:, 2].min() == pytest.approx(np.cos(np.radians(45)), abs=0.01)
    near = (directions[inside][:, 2] > np.cos(np.radians(20))).mean()
    assert near == pytest.approx((1 - np.cos(np.radians(20))) / (1 - np.cos(np.radians(45))), abs=0.01)
    np.testing.assert_allclose(np.linalg.norm(directions[inside], axis=-1), 1.0, atol=1e-9)
    assert directions[20, 100, 1] > 0 and directions[100, 180, 0] > 0


def test_normals_lie_between_the_half_vectors_of_a_sparse_sweep() -> None:
    assert share_between(sweep(8000)) < 0.02 < 0.2 < share_between(sweep(300))
    # Of the disc of 5 degrees around a single half vector, 2.2 degrees are near.
    assert share_between(np.array([[0.0, 0.0, 1.0]])) == pytest.approx(1.0 - (2.2 / 5.0) ** 2, abs=0.03)
    assert share_between(np.full((3, 3), np.nan)) == 0.0
    tilts = np.radians([30.0, 47.5])
    inner, outer = np.stack([np.sin(tilts), np.zeros(2), np.cos(tilts)], axis=-1)[:, None]
    assert share_between(inner) > 0.75 and share_between(outer) == 0.0, "beyond 42 degrees all normals are extrapolated"


def test_a_dense_sweep_covers_the_cap() -> None:
    result = coverage(sweep(8000))
    assert result.covered_shares[3.0] > 0.99
    assert result.gaps == ()
    assert result.frames == 8000


def test_density_counts_frames_per_square_degree() -> None:
    result = coverage(sweep(8000))
    cap = 2 * np.pi * (1 - np.cos(np.radians(45))) * np.degrees(1) ** 2
    assert np.nanmean(result.density) == pytest.approx(8000 / cap, rel=0.05)


@pytest.mark.parametrize(("axis", "sign", "side"), [(0, 1, "left"), (0, -1, "right"), (1, 1, "bottom"), (1, -1, "top")])
def test_a_missing_side_is_named(axis: int, sign: int, side: str) -> None:
    result = coverage(sweep(8000, lambda lights: sign * lights[:, axis] > -0.2))
    assert result.gaps[0].side == side
    assert side in str(result.gaps[0])
    opposite = {"left": "right", "right": "left", "top": "bottom", "bottom": "top"}[side]
    assert opposite not in {gap.side for gap in result.gaps}


def test_a_missing_corner_is_named_with_its_angles() -> None:
    def keep(lights: np.ndarray) -> np.ndarray:
        polar = np.degrees(np.arccos(lights[:, 2]))
        corner = (lights[:, 0] < 0) & (lights[:, 1] > 0) & (polar > 25) & (polar < 66)
        return ~corner

    gap = coverage(sweep(8000, keep)).gaps[0]
    assert (gap.side, gap.inner_deg, gap.outer_deg) == ("upper left", 30.0, 60.0)


@pytest.mark.parametrize(("margin_deg", "has_gap"), [(0.0, False), (8.0, True)])
def test_a_gap_lies_six_degrees_from_all_half_vectors(margin_deg: float, has_gap: bool) -> None:
    def keep(lights: np.ndarray) -> np.ndarray:
        polar, azimuth = np.degrees(np.arccos(lights[:, 2])), np.degrees(np.arctan2(lights[:, 1], lights[:, 0]))
        around = np.abs(azimuth) < 22.5 + 2.0 * margin_deg
        return ~(around & (polar > 30.0 - margin_deg) & (polar < 60.0 + margin_deg))

    gaps = coverage(sweep(20_000, keep)).gaps
    assert [(gap.side, gap.inner_deg, gap.outer_deg) for gap in gaps] == [("right", 30.0, 60.0)] * has_gap


def test_all_gaps_are_one_sentence() -> None:
    gaps = [Gap("left", 30, 90, 0.1), Gap("bottom", 30, 90, 0.08), Gap("top", 60, 90, 0.02)]
    assert gaps_message(gaps) == (
        "no light from the left and the bottom, 30-90 degrees from the camera axis; from the top, 60-90 degrees from"
        " the camera axis (20% of the normals that can be observed): record again with the light there too"
    )
    around = [Gap(side, 60, 90, 0.05) for side in SIDES]
    assert gaps_message(around).startswith("no light from any side, 60-90 degrees from the camera axis (40%")
    assert gaps_message([Gap("centre", 0, 20, 0.1)]).startswith("no light around the camera, 0-20 degrees")


def test_twelve_evenly_spread_lights_leave_no_gap_and_twelve_on_a_side_do() -> None:
    ring = [(polar, azimuth) for polar, count in ((15, 3), (36, 9)) for azimuth in np.arange(count) * 360 / count]
    polar, azimuth = np.radians(ring).T
    half = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)
    assert coverage(half).gaps == ()
    half[:, 0] = np.abs(half[:, 0])
    assert {gap.side for gap in coverage(half).gaps} >= {"left"}


def test_rejected_frames_do_not_count() -> None:
    half_vectors = sweep(500)
    half_vectors[::2] = np.nan
    assert coverage(half_vectors).frames == 250


def test_no_light_at_all_covers_nothing() -> None:
    result = coverage(np.full((10, 3), np.nan))
    assert result.frames == 0
    assert result.covered_shares == {1.5: 0.0, 3.0: 0.0}
    assert sum(gap.share for gap in result.gaps) == pytest.approx(1.0)
    assert "100% of the normals" in gaps_message(result.gaps)
    assert {gap.side for gap in result.gaps} == set(SIDES), "the innermost bands contain the centre"


def test_frames_are_counted_where_their_half_vectors_are() -> None:
    tilt = np.radians(20.0)
    density = coverage(np.tile([0.6 * np.sin(tilt), 0.8 * np.sin(tilt), np.cos(tilt)], (10, 1))).density
    row, column = np.unravel_index(np.nanargmax(density), density.shape)
    assert 35 < row < 45 and 75 < column < 90, "upwards, and to the right"
    pixel_deg = np.degrees(2.0 * CAP_MAP_RADIUS / len(density))
    assert np.nansum(density) * pixel_deg**2 == pytest.approx(10.0, rel=1e-3)


def test_gaps_that_overlap_are_counted_once() -> None:
    directions = cap_directions(128)
    angle = np.degrees(np.arccos(directions[..., 2]))
    azimuth = np.degrees(np.arctan2(directions[..., 1], directions[..., 0]))
    empty = (angle < 10.5) | ((angle < 15.0) & (np.abs(azimuth) < 22.0))
    gaps = _gaps(directions, empty, 0.0)
    assert {(gap.side, gap.outer_deg) for gap in gaps} == {("centre", 20.0), ("right", 30.0)}
    assert sum(gap.share for gap in gaps) <= empty.sum() / np.isfinite(angle).sum()


def test_normals_near_a_half_vector_are_observable() -> None:
    half = np.array([[0.0, 0.0, 1.0], [np.nan] * 3])
    tilted = np.radians([1.0, 2.0])
    normals = np.stack([np.sin(tilted), 0 * tilted, np.cos(tilted)], axis=-1)[None]
    normals = np.concatenate([normals, np.full((1, 2, 3), np.nan)])
    assert is_observable(normals, half, 1.5).tolist() == [[True, False], [False, False]]
