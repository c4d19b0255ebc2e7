"""Centres of discs of half vectors that only a part of the recording's half vectors show."""

import numpy as np
import pytest

from glint.tasks.algorithms.candidates.clusters import inverse_density_weights
from glint.tasks.algorithms.candidates.disc_centres import DiscModel, disc_centres
from glint.tasks.algorithms.candidates.lit_frames import LitFrames
from glint.tasks.algorithms.geometry.vectors import angles, unit

LIGHT_DEG = 10.0
"""Angular radius of the light in a sphere."""
DISC_DEG = 2.8
"""Radius of the disc of half vectors that it lights."""
Point = tuple[float, float]


def directions(*points: Point) -> np.ndarray:
    """Return the unit vectors (N, 3) float32 at angles across and upwards from the line of sight, degrees."""
    flat = np.radians(np.array(points))
    return unit(np.column_stack([flat, np.ones(len(flat))])).astype(np.float32)


def passes(*offsets: float, step: float = 0.4) -> list[Point]:
    """Return the half vectors of a light that passes upwards at these distances across from the line of sight."""
    return [(across, float(up)) for across in offsets for up in np.arange(-14.0, 14.01, step)]


def spread_evenly(step: float = 0.7, least_across: float = -14.0) -> list[Point]:
    return [
        (float(across), float(up))
        for across in np.arange(least_across, 14.01, step)
        for up in np.arange(-14.0, 14.01, step)
    ]


def found_centre(half_vectors: np.ndarray, normal: np.ndarray, is_lit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean of lit half vectors near a normal (3,), and the centre that their disc is given, both (3,)."""
    lit = np.flatnonzero(is_lit).astype(np.int32)
    near = lit[angles(half_vectors[lit], normal) < DISC_DEG]
    mean = unit(half_vectors[near].mean(axis=0)).astype(np.float32)
    frames = LitFrames(np.array([0, len(lit)]), lit, np.ones(len(lit), np.float32))
    model = DiscModel.of_light(LIGHT_DEG, half_vectors, inverse_density_weights(half_vectors))
    return mean, disc_centres(frames, half_vectors, mean[None, None], model)[0, 0]


def lit_by(half_vectors: np.ndarray, normal: np.ndarray) -> np.ndarray:
    return angles(half_vectors, normal) < DISC_DEG


def test_the_mean_of_an_evenly_lit_disc_is_its_centre() -> None:
    half_vectors, (normal,) = directions(*spread_evenly()), directions((1.3, -0.6))
    mean, centre = found_centre(half_vectors, normal, lit_by(half_vectors, normal))
    assert angles(mean, normal) < 0.2
    assert angles(centre, normal) < 0.2


@pytest.mark.parametrize("beyond", [0.0, 1.0, 2.0])
def test_a_disc_that_the_sweeps_edge_cuts_is_completed(beyond: float) -> None:
    half_vectors, (normal,) = directions(*spread_evenly(least_across=0.0)), directions((-beyond, 0.4))
    mean, centre = found_centre(half_vectors, normal, lit_by(half_vectors, normal))
    assert angles(mean, normal) > 0.9
    assert angles(centre, normal) < 0.5
    assert angles(centre, normal) < 0.4 * angles(mean, normal)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_dark_pass_tells_on_which_side_of_a_lit_one_the_centre_lies(side: float) -> None:
    half_vectors, (normal,) = directions(*passes(0.0, -2.6 * side)), directions((1.8 * side, 0.0))
    mean, centre = found_centre(half_vectors, normal, lit_by(half_vectors, normal))
    assert angles(mean, normal) == pytest.approx(1.8, abs=0.2)
    assert angles(centre, normal) < 0.75 * angles(mean, normal)


def test_a_single_pass_alone_tells_no_side() -> None:
    half_vectors, (normal,) = directions(*passes(0.0)), directions((1.5, 0.0))
    mean, centre = found_centre(half_vectors, normal, lit_by(half_vectors, normal))
    assert angles(centre, mean) < 0.15


def test_a_frame_that_contradicts_all_others_hardly_moves_the_centre() -> None:
    half_vectors, (normal,) = directions(*spread_evenly()), directions((0.2, 0.3))
    is_lit = lit_by(half_vectors, normal)
    is_lit[np.argmin(angles(half_vectors, normal))] = False
    is_lit[np.argmin(np.abs(angles(half_vectors, normal) - 1.7 * DISC_DEG))] = True
    assert angles(found_centre(half_vectors, normal, is_lit)[1], normal) < 0.3


def test_what_another_candidates_path_lights_does_not_pull_the_centre() -> None:
    half_vectors = directions(*spread_evenly())
    normals = directions((-2.6, 0.0), (2.6, 0.0))
    lit = np.flatnonzero(lit_by(half_vectors, normals[0]) | lit_by(half_vectors, normals[1])).astype(np.int32)
    frames = LitFrames(np.array([0, len(lit)]), lit, np.ones(len(lit), np.float32))
    model = DiscModel.of_light(LIGHT_DEG, half_vectors, inverse_density_weights(half_vectors))
    alone = disc_centres(frames, half_vectors, normals[:1, None], model)[0, 0]
    both = disc_centres(frames, half_vectors, normals[:, None], model)[:, 0]
    assert (angles(both, normals) < 0.4).all()
    assert angles(alone, normals[0]) > 2 * angles(both[0], normals[0])


def test_radii_from_small_to_large_are_recognized() -> None:
    half_vectors, (normal,) = directions(*spread_evenly(least_across=0.0)), directions((-0.8, 0.0))
    for radius in (2.2, 2.5, 3.1, 3.6):
        centre = found_centre(half_vectors, normal, angles(half_vectors, normal) < radius)[1]
        assert angles(centre, normal) < 0.7, radius


def test_photographs_under_a_few_lights_keep_their_half_vectors() -> None:
    half_vectors = directions((0.0, 0.0), (12.0, 3.0), (-9.0, 11.0), (25.0, -20.0))
    mean, centre = found_centre(half_vectors, half_vectors[0], np.array([True, False, False, False]))
    assert angles(mean, half_vectors[0]) == pytest.approx(0.0, abs=0.05)
    assert angles(centre, half_vectors[0]) < 0.1


def test_pixels_without_a_candidate_and_rejected_frames_stay_out() -> None:
    half_vectors = directions(*spread_evenly())
    half_vectors[::3] = np.nan
    weights = inverse_density_weights(half_vectors)
    model = DiscModel.of_light(LIGHT_DEG, half_vectors, weights)
    assert not np.isin(model.around[model.around >= 0], np.flatnonzero(weights == 0.0)).any()
    lit = np.flatnonzero(lit_by(np.nan_to_num(half_vectors), directions((0.0, 0.0))[0])).astype(np.int32)
    lit = lit[weights[lit] > 0.0]
    frames = LitFrames(np.array([0, 0, len(lit)]), lit, np.ones(len(lit), np.float32))
    normals = np.full((2, 2, 3), np.nan, np.float32)
    normals[0, 1] = directions((0.3, 0.0))[0]
    centres = disc_centres(frames, half_vectors, normals, model)
    assert np.isnan(centres[:, 0]).all()
    assert np.isnan(centres[1, 1]).all()
    assert np.linalg.norm(centres[0, 1]) == pytest.approx(1.0, abs=1e-5)
