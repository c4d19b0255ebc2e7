"""Shading of candidates on surfaces of known finish: what reflects the light and what scatters it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import expon

from glint.tasks.algorithms.candidates.clusters import Clusters, cluster_pixels, inverse_density_weights
from glint.tasks.algorithms.candidates.shading import (
    FALSE_MEAN,
    MAX_SHADING,
    TRUE_MEAN,
    object_shading,
    shading_log_ratio,
    with_object_shading,
    without_shading,
)
from glint.tasks.algorithms.candidates.surround import INNER_RING_DEG, OUTER_RING_DEG, find_rings, rings_deg
from glint.tasks.algorithms.candidates.thresholds import highlight_levels
from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of
from tests.opaque_objects import FINISHES, Finish, light_directions, photograph, shape


def candidates_of(finish: Finish, count: int, widest_deg: float, gain: float = 1.0) -> Clusters:
    """Return the candidates of a sphere of this finish under `count` lights, its levels multiplied by a gain."""
    truth = shape("sphere")
    mask = np.isfinite(truth[..., 0])
    lights = light_directions(count, widest_deg)
    frames = np.rint(gain * photograph(truth, finish, lights)).astype(np.uint8)
    background = np.median(frames, axis=0).astype(np.uint8)
    half_vectors = half_vectors_of(lights).astype(np.float32)
    levels = highlight_levels(background, frames.max(axis=0), mask, half_vectors)
    return cluster_pixels(frames, levels, half_vectors, inverse_density_weights(half_vectors))


@pytest.mark.parametrize(("count", "widest_deg"), [(12, 40.0), (64, 80.0), (300, 84.0)])
@pytest.mark.parametrize("finish", ["matte", "plastic", "brushed metal"])
def test_what_scatters_the_light_is_shaded(finish: str, count: int, widest_deg: float) -> None:
    assert object_shading(candidates_of(FINISHES[finish], count, widest_deg).shading) > 1.5 * MAX_SHADING


@pytest.mark.parametrize(("count", "widest_deg"), [(12, 40.0), (64, 80.0), (300, 84.0)])
@pytest.mark.parametrize("finish", ["glaze", "polished metal", "chrome"])
def test_what_reflects_the_light_is_not(finish: str, count: int, widest_deg: float) -> None:
    found = candidates_of(FINISHES[finish], count, widest_deg)
    assert object_shading(found.shading) < 0.8 * MAX_SHADING
    assert np.isfinite(without_shading(found).normals[0, ..., 0]).sum() > 100


def test_shading_does_not_depend_on_the_exposure() -> None:
    full, dim = (object_shading(candidates_of(FINISHES["matte"], 64, 80.0, gain).shading) for gain in (1.0, 0.5))
    assert dim == pytest.approx(full, abs=0.05)


def test_no_candidate_of_a_matte_object_remains() -> None:
    found = candidates_of(FINISHES["matte"], 12, 40.0)
    complete = replace(found, shading=with_object_shading(found.shading))
    kept = without_shading(complete)
    assert np.isfinite(found.normals[0, ..., 0]).any()
    assert not np.isfinite(kept.normals).any() and not np.isfinite(kept.winner).any()


def test_where_nothing_compares_the_object_decides() -> None:
    shading = np.full((2, 1, 3), np.nan, np.float32)
    shading[0, 0, :2] = 0.1, 0.2
    np.testing.assert_allclose(with_object_shading(shading)[0, 0], [0.1, 0.2, 0.15])
    assert np.isnan(object_shading(np.full((1, 1, 1), np.nan)))
    ratio = shading_log_ratio(np.array([[[0.0, 0.5, np.nan]]]))[0, 0]
    assert ratio[0] == ratio[2] == 0 > ratio[1]


@pytest.mark.parametrize("light_size", [1.0, 2.0])
def test_rings_hold_the_frames_at_their_angles(light_size: float) -> None:
    half_vectors = half_vectors_of(light_directions(300, 84.0)).astype(np.float32)
    half_vectors[7] = np.nan
    rings = find_rings(half_vectors, inverse_density_weights(half_vectors), light_size)
    for ring, (least, most) in zip((rings.inner, rings.outer), rings_deg(light_size), strict=True):
        frame, position = np.nonzero(ring >= 0)
        between = angles(half_vectors[frame], half_vectors[ring[frame, position]])
        assert len(between) > 1000 and between.min() > least - 0.01 and between.max() < most + 0.01
        assert (ring[7] == -1).all() and not (ring == 7).any()
    assert 7 not in rings.sweep


def test_rings_of_a_larger_light_lie_farther_out() -> None:
    assert rings_deg(1.0) == (INNER_RING_DEG, OUTER_RING_DEG)
    assert rings_deg(2.0) == ((9.0, 16.5), (19.5, 34.5))


def test_the_ratio_is_that_of_two_exponential_distributions_as_far_as_it_speaks_against_a_highlight() -> None:
    shading = np.array([[[0.15, 0.2, 0.5, 1.0]]], np.float32)
    expected = expon.logpdf(shading, scale=TRUE_MEAN) - expon.logpdf(shading, scale=FALSE_MEAN)
    np.testing.assert_allclose(shading_log_ratio(shading), expected, rtol=1e-5)
    assert (shading_log_ratio(np.array([[[0.0, 0.1, np.nan]]], np.float32)) == 0.0).all()
