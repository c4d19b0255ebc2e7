"""Selection of the frames that are offered for marking."""

import numpy as np

from glint.tasks.algorithms.frames.keyframes import keyframes
from glint.tasks.algorithms.geometry.vectors import half_vectors_of, unit


def test_keyframes_are_spread_over_the_sweep_and_show_highlights() -> None:
    generator = np.random.default_rng(0)
    half_vectors = half_vectors_of(unit(generator.normal((0, 0, 1), 0.6, (400, 3))))
    half_vectors[::7] = np.nan
    lit = generator.integers(0, 100, 400)
    chosen = keyframes(half_vectors, lit, 6)
    assert len(chosen) == 6 and chosen == sorted(set(chosen))
    assert np.isfinite(half_vectors[chosen]).all() and (lit[chosen] >= 30).all()
    gaps = np.linalg.norm(half_vectors[chosen][:, None] - half_vectors[chosen][None], axis=-1)
    assert gaps[~np.eye(6, dtype=bool)].min() > 0.25
    assert keyframes(np.full((5, 3), np.nan), np.ones(5)) == []


def test_frames_of_the_same_light_are_offered_once() -> None:
    half_vectors = np.repeat(unit(np.array([[0.0, 0.0, 1.0], [0.3, 0.0, 1.0]])), 5, axis=0)
    assert len(keyframes(half_vectors, np.ones(10), 6)) == 2
