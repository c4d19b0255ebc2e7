"""Tracks of marks along highlights whose motion is known."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.candidates.marked_tracks import Tracks, join_tracks, track
from glint.tasks.algorithms.candidates.markup import Mark
from glint.tasks.algorithms.candidates.tracking import MAX_TRACK_FRAMES
from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of
from tests.benchmarks.dual_layer_weights import read_region
from tests.pictures import read_picture

COUNT, SIZE = 30, 60


def footage(*paths: tuple[float, float, float, float]) -> np.ndarray:
    """Return frames (COUNT, SIZE, SIZE) with a spot of radius 3 per path (x, y, pixels per frame in x and y)."""
    frames = np.full((COUNT, SIZE, SIZE), 20, np.uint8)
    rows, columns = np.mgrid[:SIZE, :SIZE]
    for number in range(COUNT):
        for x, y, dx, dy in paths:
            frames[number][np.hypot(columns - x - dx * number, rows - y - dy * number) < 3.0] = 255
    return frames


def tracked(frames: np.ndarray, marks: list[Mark], mask: np.ndarray | None = None) -> tuple[Tracks, np.ndarray]:
    angle = np.linspace(-0.5, 0.5, COUNT)
    half_vectors = half_vectors_of(np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)).astype(np.float32)
    half_vectors[5] = np.nan
    mask = np.ones((SIZE, SIZE), bool) if mask is None else mask
    thresholds = np.full((SIZE, SIZE), 200, np.uint8)
    return track(marks, lambda t, y, x: frames[t, y, x], thresholds, half_vectors, mask, (100, 200)), half_vectors


def test_a_mark_is_tracked_forward_and_backward() -> None:
    tracks, half_vectors = tracked(footage((10, 30, 1.2, 0.1)), [Mark(10, 23.0, 32.0, True)])
    marks = tracks.marks
    assert len(marks.kind) == COUNT - 1 and not tracks.conflicts and not tracks.warnings
    assert (marks.kind == 1).all()
    for (row, column), half_vector in zip(marks.pixels, marks.half_vectors, strict=True):
        frame = int(np.flatnonzero((half_vectors == half_vector).all(axis=1))[0])
        assert abs(column - 10 - 1.2 * frame) <= 1 and abs(row - 30 - 0.1 * frame) <= 1


def test_a_mark_is_followed_so_many_frames_and_to_the_neighbouring_keyframes() -> None:
    spans = list[tuple[int, int]]()

    def follow(mark: Mark, span: slice) -> list[tuple[int, int, int]]:
        spans.append((span.start, span.stop))
        return [(0, mark.frame, mark.frame)]

    marks = [Mark(frame, float(frame), 0.0, True) for frame in (100, 130, 299)]
    tracks = join_tracks(marks, follow, np.full((300, 3), (0.0, 0.0, 1.0), np.float32), (0, 0))
    reach = MAX_TRACK_FRAMES
    assert spans == [(100 - reach, 130), (101, 130 + reach + 1), (299 - reach, 300)]
    assert [point.frame for point in tracks.path(1)] == [130]


@pytest.mark.parametrize(("row", "column", "meet"), [(6, 6, True), (5, 30, False), (30, 5, False)])
def test_true_and_false_marks_contradict_each_other_where_both_row_and_column_are_near(
    row: int, column: int, meet: bool
) -> None:
    marks = [Mark(2, 5.0, 5.0, True), Mark(2, float(column), float(row), False)]
    half_vectors = np.full((4, 3), (0.0, 0.0, 1.0), np.float32)
    tracks = join_tracks(marks, lambda mark, _: [(int(mark.y), int(mark.x), mark.frame)], half_vectors, (0, 0))
    assert (len(tracks.conflicts), len(tracks.marks.kind)) == ((1, 0) if meet else (0, 2))


def test_tracks_end_at_the_next_keyframe_and_at_the_mask() -> None:
    marks = [Mark(8, 19.6, 30.8, True), Mark(20, 34.0, 32.0, True)]
    tracks, _ = tracked(footage((10, 30, 1.2, 0.1)), marks)
    assert len({tuple(pixel) for pixel in tracks.marks.pixels.tolist()}) == len(tracks.marks.kind)
    mask = np.zeros((SIZE, SIZE), bool)
    mask[:, :30] = True
    inside, _ = tracked(footage((10, 30, 1.2, 0.1)), marks[:1], mask)
    assert inside.marks.pixels[:, 1].max() < 30


def test_merging_highlights_end_the_track() -> None:
    tracks, _ = tracked(footage((10, 30, 1.0, 0), (38, 30, -1.0, 0)), [Mark(2, 12.0, 30.0, True)])
    assert tracks.marks.pixels[:, 1].max() <= 24


def test_a_mark_without_a_highlight_gives_a_warning() -> None:
    tracks, _ = tracked(footage((10, 30, 1.0, 0)), [Mark(3, 40.0, 10.0, False)])
    assert len(tracks.marks.kind) == 0
    assert "mark 1 (false, frame 3, x 140, y 210) has no highlight within 4 pixels" in tracks.warnings[0]


@pytest.mark.parametrize("place", [(-200.0, 30.0), (30.0, -90.0), (30.0, 300.0), (-1.0, 30.0)])
def test_a_mark_beside_the_region_gives_a_warning(place: tuple[float, float]) -> None:
    tracks, _ = tracked(footage((10, 30, 1.0, 0)), [Mark(3, *place, True)])
    assert len(tracks.marks.kind) == 0 and "no highlight within 4 pixels" in tracks.warnings[0]


def test_a_mark_at_a_frame_without_light_gives_a_warning() -> None:
    frames = footage((10, 30, 1.0, 0))
    frames[:5] = frames[6:] = 20
    tracks, _ = tracked(frames, [Mark(5, 15.0, 30.0, True)])
    assert len(tracks.marks.kind) == 0 and "light was rejected" in tracks.warnings[0]


def test_true_and_false_at_one_place_are_a_conflict() -> None:
    marks = [Mark(10, 20.0, 30.0, True), Mark(10, 21.0, 31.0, False)]
    tracks, _ = tracked(footage((10, 30, 1.0, 0)), marks)
    assert len(tracks.marks.kind) == 0 and len(tracks.conflicts) == 1
    assert "marks 1 (true, frame 10, x 120, y 230) and 2 (false, frame 10, x 121, y 231)" in tracks.conflicts[0]


def test_a_highlight_that_splits_off_another_ends_the_track() -> None:
    tracks, _ = tracked(footage((20, 30, 0.0, 0), (14, 30, 1.0, 0.0)), [Mark(25, 20.0, 30.0, True)])
    assert tracks.warnings == () and tracks.marks.pixels[:, 1].min() > 13
    alone, _ = tracked(footage((20, 30, 0.0, 0)), [Mark(25, 20.0, 30.0, True)])
    assert len(tracks.marks.kind) < 20 < len(alone.marks.kind)


def test_a_highlight_of_another_fold_that_lights_up_beside_it_is_not_followed() -> None:
    frames = np.full((COUNT, SIZE, SIZE), 20, np.uint8)
    frames[:13, 40, 20:27] = 255
    frames[13:, 37, 20:27] = 255
    tracks, _ = tracked(frames, [Mark(10, 23.0, 40.0, True)])
    assert set(tracks.marks.pixels[:, 0].tolist()) == {40}
    assert max(point.frame for point in tracks.points) == 12


@pytest.mark.parametrize("step", [1, -1])
def test_another_highlight_that_moves_beside_it_is_not_followed(step: int) -> None:
    frames = np.full((COUNT, SIZE, SIZE), 20, np.uint8)
    frames[:13, 40:43, 20:27] = frames[:13, 40 - 5 * step : 43 - 5 * step, 20:27] = 255
    frames[13:, 40 - 3 * step : 43 - 3 * step, 20:27] = 255
    tracks, _ = tracked(frames, [Mark(10, 23.0, 41.0, True)])
    assert max(point.frame for point in tracks.points) == 12


def test_merged_highlights_count_at_the_marked_pixel() -> None:
    frames = np.full((COUNT, SIZE, SIZE), 20, np.uint8)
    frames[:, 20:40, 20:24] = frames[:, 36:40, 20:40] = 255
    tracks, half_vectors = tracked(frames, [Mark(8, 22.0, 25.0, True)])
    np.testing.assert_array_equal(tracks.marks.pixels, [[25, 22]])
    np.testing.assert_array_equal(tracks.marks.half_vectors[0], half_vectors[8])


def test_a_mark_stays_at_its_place_along_a_line() -> None:
    frames = np.full((COUNT, SIZE, SIZE), 20, np.uint8)
    for number in range(COUNT):
        frames[number, 5 : 55 - number, 20 + number // 2 : 25 + number // 2] = 255
    tracks, half_vectors = tracked(frames, [Mark(10, 26.0, 14.0, True)])
    assert len(tracks.marks.kind) == COUNT - 1
    assert set(tracks.marks.pixels[:, 0].tolist()) <= {13, 14, 15}
    for (_, column), half_vector in zip(tracks.marks.pixels, tracks.marks.half_vectors, strict=True):
        frame = int(np.flatnonzero((half_vectors == half_vector).all(axis=1))[0])
        assert column == 22 + frame // 2


def test_a_frame_beyond_the_footage_is_refused() -> None:
    with pytest.raises(ValueError, match="frame 30 of 30"):
        tracked(footage((10, 30, 1.0, 0)), [Mark(COUNT, 10.0, 30.0, True)])


def test_long_footage_is_read_in_small_parts() -> None:
    sizes = []

    def read(frames: slice, rows: slice, columns: slice) -> np.ndarray:
        shape = frames.stop - frames.start, min(rows.stop, 500) - rows.start, min(columns.stop, 500) - columns.start
        sizes.append(int(np.prod(shape)))
        block = np.zeros(shape, np.uint8)
        block[:, 20:25, 20:25] = 255
        return block

    half_vectors = np.tile(np.array([0, 0, 1], np.float32), (100_000, 1))
    thresholds, mask = np.full((500, 500), 200, np.uint8), np.ones((500, 500), bool)
    tracks = track([Mark(50_000, 22.0, 22.0, True)], read, thresholds, half_vectors, mask)
    assert len(tracks.marks.kind) > 0 and max(sizes) < 130**3


@pytest.mark.shared
@pytest.mark.parametrize("name", ["cylinder", "duck"])
def test_tracks_of_true_marks_have_true_normals(shared_data: Path, name: str) -> None:
    folder = shared_data / "captures" / name / "front"
    mask = read_picture(folder / "mask.png", cv2.IMREAD_GRAYSCALE) > 0
    truth = np.load(folder / "truth" / "normals.npy")
    half_vectors = half_vectors_of(np.load(folder / "truth" / "lights.npy")).astype(np.float32)
    half_vectors[half_vectors[:, 2] < np.cos(np.pi / 4)] = np.nan
    entries = json.loads((folder / "markup.json").read_text())
    marks = [Mark(entry["frame"], entry["x"] - 16, entry["y"] - 16, entry["kind"] == "true") for entry in entries]
    frames = read_region(folder / "video.mp4", mask.shape)
    thresholds = np.full(mask.shape, 225, np.uint8)
    tracks = track(marks, lambda t, y, x: frames[t, y, x], thresholds, half_vectors, mask)
    rows, columns = tracks.marks.pixels.T
    error = angles(tracks.marks.half_vectors, truth[rows, columns])
    true = tracks.marks.kind == 1
    assert len(error) > 3 * len(marks) and not tracks.warnings
    assert np.median(error[true]) < 1.2 and (error[true] < 5).mean() > 0.98 and (error[~true] < 5).mean() < 0.02
