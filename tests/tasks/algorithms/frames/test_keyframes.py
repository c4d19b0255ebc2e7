"""Which frames are offered for marking, and how they are drawn."""

import numpy as np

from glint.tasks.algorithms.frames.keyframes import draw_keyframe, keyframes
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


def test_a_keyframe_is_enlarged_with_its_grid() -> None:
    frame = np.zeros((40, 70), np.uint8)
    picture = draw_keyframe(frame, 12, 100, 200, width=700)
    assert picture.dtype == np.uint8 and picture.shape[1] >= 700
    assert (picture == 255).all(axis=-1).any() and picture[200:, 200:].max() > 0
    assert draw_keyframe(frame.astype(np.uint16) * 257, 1, 0, 0).shape[2] == 3
