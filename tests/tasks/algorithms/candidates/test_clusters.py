"""Clusters of highlights whose normals are known."""

import numpy as np
import pytest

from glint.tasks.algorithms.candidates.clusters import Clusters, cluster_pixels, inverse_density_weights
from glint.tasks.algorithms.candidates.lit_frames import HighlightLevels
from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of, unit

DISC = 2.1


def sweep(count: int = 20_000, seed: int = 0) -> np.ndarray:
    """Return half vectors (count, 3) float32 spread over the cap of 45 degrees."""
    generator = np.random.default_rng(seed)
    z = generator.uniform(np.cos(np.pi / 4), 1.0, count)
    around = generator.uniform(0, 2 * np.pi, count)
    flat = np.sqrt(1 - z**2)
    return np.stack([flat * np.cos(around), flat * np.sin(around), z], axis=-1).astype(np.float32)


def lit(half_vectors: np.ndarray, normals: list[np.ndarray], disc: float = DISC) -> np.ndarray:
    """Return frames (T, 1, 1) of a pixel that is lit where a half vector lies in the disc of one of the normals."""
    near = np.any([angles(half_vectors, unit(normal)) < disc for normal in normals], axis=0)
    return np.where(near, 255, 30).astype(np.uint8)[:, None, None]


def cluster_frames(half_vectors: np.ndarray, frames: np.ndarray) -> Clusters:
    highlights = HighlightLevels(np.full(frames.shape[1:], 200, frames.dtype), saturation=255.0)
    return cluster_pixels(frames, highlights, half_vectors, inverse_density_weights(half_vectors))


def test_discs_become_their_centres_heaviest_first() -> None:
    half_vectors = sweep()
    narrow, wide = unit(np.array([0.3, 0.2, 1.0])), unit(np.array([-0.4, 0.1, 1.0]))
    frames = lit(half_vectors, [wide])
    frames[angles(half_vectors, narrow) < 1.0] = 255
    found = cluster_frames(half_vectors, frames)
    assert angles(found.normals[0, 0, 0], wide) < 0.3
    assert angles(found.normals[1, 0, 0], narrow) < 0.6
    assert np.isnan(found.normals[2, 0, 0]).all()
    assert found.weight[0, 0, 0] > found.weight[1, 0, 0] > found.weight[2, 0, 0] == 0
    assert found.observations[0, 0] == (frames == 255).sum() >= found.count.sum() > 50
    assert np.degrees(found.spread[0, 0, 0]) == pytest.approx(DISC / np.sqrt(2), rel=0.15)


def test_an_arc_beside_a_disc_does_not_pull_its_centre() -> None:
    half_vectors = sweep()
    centre = unit(np.array([0.1, 0.0, 1.0]))
    arc = [unit(np.array([0.1 + 0.11 * np.cos(a), 0.11 * np.sin(a), 1.0])) for a in np.linspace(0, np.pi, 12)]
    frames = lit(half_vectors, [centre])
    frames[np.any([angles(half_vectors, part) < 0.7 for part in arc], axis=0)] = 255
    assert angles(cluster_frames(half_vectors, frames).normals[0, 0, 0], centre) < 0.5


def test_a_lingering_light_has_one_vote() -> None:
    half_vectors = sweep()
    frequent, disc = unit(np.array([0.35, 0.0, 1.0])), unit(np.array([-0.35, 0.0, 1.0]))
    rest = np.repeat(frequent[None].astype(np.float32), 9000, axis=0)
    half_vectors = np.concatenate([half_vectors, rest])
    frames = lit(half_vectors, [disc])
    frames[angles(half_vectors, frequent) < 0.4] = 255
    found = cluster_frames(half_vectors, frames)
    assert angles(found.normals[0, 0, 0], disc) < 0.3
    assert angles(found.winner[0, 0], frequent) < 5


def test_the_brightest_place_of_a_disc_is_its_centre() -> None:
    half_vectors = sweep()
    bright, beside = unit(np.array([0.1, 0.0, 1.0])), unit(np.array([0.135, 0.0, 1.0]))
    frames = lit(half_vectors, [beside], 1.5)
    frames[frames == 255] = 182
    frames[angles(half_vectors, bright) < 1.0] = 255
    levels = HighlightLevels(np.full((1, 1), 180, np.uint8), saturation=255.0, least_rise=0.65)
    found = cluster_pixels(frames, levels, half_vectors, inverse_density_weights(half_vectors))
    frames[frames > 180] = 255
    flat = cluster_pixels(frames, levels, half_vectors, inverse_density_weights(half_vectors))
    assert angles(found.normals[0, 0, 0], bright) < 0.8 * angles(flat.normals[0, 0, 0], bright)


def test_a_dim_highlight_alone_is_a_candidate() -> None:
    half_vectors = sweep()
    normal = unit(np.array([-0.2, 0.3, 1.0]))
    frames = lit(half_vectors, [normal])
    frames[frames == 255] = 181
    levels = HighlightLevels(np.full((1, 1), 180, np.uint8), saturation=255.0, least_rise=0.3)
    found = cluster_pixels(frames, levels, half_vectors, inverse_density_weights(half_vectors))
    assert angles(found.normals[0, 0, 0], normal) < 0.3
    assert found.observations[0, 0] == (frames == 181).sum()
    assert found.weight[0, 0, 0] < 0.1 * cluster_frames(half_vectors, lit(half_vectors, [normal])).weight[0, 0, 0]


def test_one_frame_is_enough_and_rejected_frames_do_not_count() -> None:
    half_vectors = sweep(50)
    frames = np.full((50, 1, 2), 30, np.uint8)
    frames[7, 0, 0] = frames[9, 0, 1] = 255
    half_vectors[9] = np.nan
    found = cluster_frames(half_vectors, frames)
    assert angles(found.normals[0, 0, 0], half_vectors[7]) < 0.05
    assert found.observations.tolist() == [[1, 0]]
    assert np.isnan(found.normals[:, 0, 1]).all() and np.isnan(found.winner[0, 1]).all()


@pytest.mark.long
def test_tiles_of_any_width_and_depth_agree_with_their_pixels() -> None:
    half_vectors = sweep(600)
    generator = np.random.default_rng(1)
    normals = unit(generator.normal((0, 0, 1), 0.3, (5, 13, 3)))
    frames = np.where(angles(half_vectors[:, None, None], normals[None]) < 4, 60000, 9000).astype(np.uint16)
    thresholds = np.full((5, 13), 40000, np.uint16)
    thresholds[2, 3] = 65535
    weights = inverse_density_weights(half_vectors)
    whole = cluster_pixels(frames, HighlightLevels(thresholds, 65535.0), half_vectors, weights)
    tile = HighlightLevels(thresholds[1:3, 2:9], 65535.0)
    part = cluster_pixels(frames[:, 1:3, 2:9], tile, half_vectors, weights)
    np.testing.assert_array_equal(part.normals, whole.normals[:, 1:3, 2:9])
    np.testing.assert_array_equal(whole.observations, np.where(thresholds == 65535, 0, (frames > 50000).sum(axis=0)))


def test_winner_is_the_top_eigenvector() -> None:
    half_vectors = sweep(300)
    frames = lit(half_vectors, [np.array([0.2, 0.1, 1.0]), np.array([-0.2, 0.4, 1.0])], 12.0)
    rows = half_vectors[frames[:, 0, 0] == 255].astype(np.float64)
    expected = np.linalg.eigh(rows.T @ rows)[1][:, -1]
    found = cluster_frames(half_vectors, frames).winner[0, 0]
    assert angles(found, expected * np.sign(expected[2])) < 0.1


def test_rejected_frames_have_no_weight() -> None:
    weights = inverse_density_weights(
        np.array([[0, 0, 1], [0, 0, 1], [np.nan] * 3, half_vectors_of(np.array([1.0, 0, 0]))])
    )
    np.testing.assert_allclose(weights, [0.5, 0.5, 0, 1])
