"""Marks followed along highlights that move as they are told."""

import numpy as np

from tasks.algorithms.geometry import half_vectors_of
from tasks.algorithms.markup import Mark, pinned, track

COUNT, SIZE = 30, 60


def footage(*paths: tuple[float, float, float, float]) -> np.ndarray:
    """Frames (COUNT, SIZE, SIZE) with a spot of radius 3 for each path (x, y, pixels per frame in x and y)."""
    frames = np.full((COUNT, SIZE, SIZE), 20, np.uint8)
    rows, columns = np.mgrid[:SIZE, :SIZE]
    for number in range(COUNT):
        for x, y, dx, dy in paths:
            frames[number][np.hypot(columns - x - dx * number, rows - y - dy * number) < 3.0] = 255
    return frames


def followed(frames: np.ndarray, marks: list[Mark], mask: np.ndarray | None = None):  # type: ignore[no-untyped-def]
    angle = np.linspace(-0.5, 0.5, COUNT)
    half_vectors = half_vectors_of(np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)).astype(np.float32)
    half_vectors[5] = np.nan
    mask = np.ones((SIZE, SIZE), bool) if mask is None else mask
    bars = np.full((SIZE, SIZE), 200, np.uint8)
    return track(marks, lambda t, y, x: frames[t, y, x], bars, half_vectors, mask), half_vectors


def test_a_mark_follows_its_highlight_both_ways() -> None:
    tracks, half_vectors = followed(footage((10, 30, 1.2, 0.1)), [Mark(10, 23.0, 32.0, True)])
    marks = tracks.marks
    assert len(marks.kind) == COUNT - 1 and not tracks.conflicts and not tracks.warnings
    assert (marks.kind == 1).all()
    for (row, column), half_vector in zip(marks.pixels, marks.half_vectors, strict=True):
        frame = int(np.flatnonzero((half_vectors == half_vector).all(axis=1))[0])
        assert abs(column - 10 - 1.2 * frame) <= 1 and abs(row - 30 - 0.1 * frame) <= 1


def test_tracks_end_at_the_next_keyframe_and_at_the_mask() -> None:
    marks = [Mark(8, 19.6, 30.8, True), Mark(20, 34.0, 32.0, True)]
    tracks, _ = followed(footage((10, 30, 1.2, 0.1)), marks)
    assert len({tuple(pixel) for pixel in tracks.marks.pixels.tolist()}) == len(tracks.marks.kind)
    mask = np.zeros((SIZE, SIZE), bool)
    mask[:, :30] = True
    inside, _ = followed(footage((10, 30, 1.2, 0.1)), marks[:1], mask)
    assert inside.marks.pixels[:, 1].max() < 30


def test_meeting_highlights_end_the_track() -> None:
    tracks, _ = followed(footage((10, 30, 1.0, 0), (38, 30, -1.0, 0)), [Mark(2, 12.0, 30.0, True)])
    assert tracks.marks.pixels[:, 1].max() <= 24


def test_a_mark_beside_nothing_is_told() -> None:
    tracks, _ = followed(footage((10, 30, 1.0, 0)), [Mark(3, 40.0, 10.0, False)])
    assert len(tracks.marks.kind) == 0
    assert "frame 3, x 40.0, y 10.0" in tracks.warnings[0]


def test_true_and_false_at_one_place_are_a_conflict() -> None:
    marks = [Mark(10, 20.0, 30.0, True), Mark(10, 21.0, 31.0, False)]
    tracks, _ = followed(footage((10, 30, 1.0, 0)), marks)
    assert len(tracks.marks.kind) == 0 and tracks.conflicts and "neither counts" in tracks.conflicts[0]


def test_pins_reach_the_clusters_near_a_mark() -> None:
    normals = np.full((2, 3, 3, 3), np.nan)
    normals[0, 1, 1], normals[1, 1, 1] = (0, 0, 1), (0.6, 0, 0.8)
    tracks, _ = followed(footage((10, 30, 1.0, 0)), [Mark(3, 40.0, 10.0, False)])
    marks = type(tracks.marks)(np.array([[1, 1]]), np.array([[0.6, 0, 0.8]]), np.array([1]))
    marked, values, pins = pinned(marks, normals, np.ones((3, 3), bool))
    assert marked[1, 1] and marked.sum() == 1 and pins[:, 1, 1].tolist() == [-1, 1]
    np.testing.assert_allclose(values[1, 1], [0.6, 0, 0.8])
