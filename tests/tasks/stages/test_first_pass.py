"""A video whose crops the catalogue gives is decoded once, and the result is that of two passes."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glint.storage.footage.source import open_footage
from glint.storage.footage.video import Video
from glint.storage.frames.cache import FrameCache
from glint.tasks.algorithms.errors import UnusableFrames
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.stages.capture_geometry import OBJECT, load_geometry
from glint.tasks.stages.first_pass import SampleRecorder
from glint.tasks.stages.frames import load_thumbnails, open_frames
from glint.tasks.stages.levels import BACKGROUND, CLIPPED, PEAK, LevelRecorder, stored_levels
from glint.tasks.stages.thumbnails import ThumbnailRecorder
from tests.storage.footage.videos import ramp, write_images, write_video
from tests.tasks.make_context import make_context, perform_all


@pytest.fixture
def passes(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """First frame and step of each pass over a video."""
    made, frames = list[tuple[int, int]](), Video.frames

    def counted(self: Video, start: int = 0, step: int = 1) -> Iterator[np.ndarray]:
        made.append((start, step))
        return frames(self, start, step)

    monkeypatch.setattr(Video, "frames", counted)
    return made


def _check_frames(work: CaptureContext) -> None:
    """Check the stored frames and thumbnails against the video, and the levels against the frames."""
    cache, geometry = open_frames(work), load_geometry(work)
    assert cache.crops == geometry.crops
    with open_footage(str(work.file("frames"))) as footage:
        recorder = ThumbnailRecorder(footage)
        crops = [frame[geometry.region.rows, geometry.region.columns] for frame in recorder.frames()]
        expected = recorder.arrays()
    assert np.array_equal(cache.read(OBJECT), np.stack(crops))
    for stored, taken in zip(load_thumbnails(work), expected.values(), strict=True):
        assert np.array_equal(stored, taken)
    levels = work.load("frames")
    for name, taken in stored_levels(cache).items():
        assert np.array_equal(levels.read(name), taken), name


def test_given_crops_are_stored_while_the_video_is_sampled(
    simulated: Path, tmp_path: Path, passes: list[tuple[int, int]]
) -> None:
    work = make_context(simulated, tmp_path / "store", {"survey": {"stabilize": False}})
    perform_all(work, "frames")
    assert passes == [(0, 1)]
    _check_frames(work)


def test_a_sphere_that_the_survey_moves_is_cropped_at_its_new_place(simulated: Path, tmp_path: Path) -> None:
    given = make_context(simulated, tmp_path / "store").capture.spheres[0]
    wrong = given.model_dump(mode="json") | {"x": given.x + 0.15 * given.radius}
    work = make_context(simulated, tmp_path / "store", spheres=[wrong])
    perform_all(work, "frames")
    assert load_geometry(work).spheres[0].x != wrong["x"]
    _check_frames(work)
    stored = [entry.name for entry in (tmp_path / "store/frames").iterdir() if entry.is_dir()]
    assert stored == [open_frames(work).digest], "nothing is left of the wrong crops"


def test_a_sample_is_the_same_however_it_is_taken(simulated: Path, tmp_path: Path) -> None:
    def ignore(done: int, total: int | None) -> None:
        pass

    samples: list[Any] = []
    address = str(make_context(simulated, tmp_path / "store").file("frames"))
    for step in (None, 1):
        with open_footage(address) as footage:
            recorder = SampleRecorder(footage, 40, ignore)
            if step is not None:
                for _ in recorder.frames():
                    pass
                assert recorder.has_all
            samples.append(recorder.sample())
    assert np.array_equal(samples[0].peak, samples[1].peak) and np.array_equal(samples[0].frames, samples[1].frames)
    with open_footage(address) as footage:
        recorder = SampleRecorder(footage, 40, ignore)
        for _ in recorder.frames(start=8):
            pass
        assert not recorder.has_all, "frames before the first one that passed are missing"
        assert np.array_equal(recorder.sample().peak, samples[0].peak)


@pytest.mark.parametrize("count", [5, 12, 400])
def test_a_video_of_unknown_length_leaves_a_sample_of_the_planned_size_spread_over_it(
    tmp_path: Path, count: int
) -> None:
    path = write_video(tmp_path / "without_length.h264", [ramp(number) for number in range(901)])
    with open_footage(path) as footage:
        assert footage.count == 0
        recorder = SampleRecorder(footage, count, lambda done, total: None)
        frames = np.stack(list(recorder.frames()))
        sample = recorder.sample()
        apart = SampleRecorder(footage, count, lambda done, total: None).sample()
    assert count // 2 <= sample.reduced.count <= 2 * count
    assert np.array_equal(sample.frames, apart.frames) and sample.reduced.count == apart.reduced.count
    assert min(count, 128) // 2 <= len(sample.frames) <= min(count, 128) + 1
    positions = [int(np.flatnonzero((frames == frame).all(axis=(1, 2)))[0]) for frame in sample.frames]
    gaps = np.diff(positions)
    assert positions[0] == 0 and gaps.min() == gaps.max() and len(frames) - positions[-1] <= gaps[0]


def test_levels_are_taken_from_stored_frames_where_not_all_passed(simulated: Path, tmp_path: Path) -> None:
    work = make_context(simulated, tmp_path / "store")
    perform_all(work, "frames")
    cache, region = open_frames(work), load_geometry(work).region
    with open_footage(str(work.file("frames"))) as footage:
        recorder = LevelRecorder(footage, region)
        for _ in recorder.frames(start=1):
            pass
        passing = recorder.frames()
        next(passing)
        arrays = recorder.arrays(cache)
        assert arrays.keys() == {BACKGROUND, PEAK, CLIPPED}
        for name, taken in arrays.items():
            assert np.array_equal(taken, work.load("frames").read(name)), name


def test_the_frames_of_the_object_are_not_read_for_a_light_that_never_shows(
    simulated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    work, read = make_context(simulated, tmp_path / "store"), FrameCache.read
    perform_all(work, "frames")
    crops = list[str]()

    def counted(self: FrameCache, name: str, *slices: slice) -> np.ndarray:
        crops.append(name)
        return read(self, name, *slices)

    monkeypatch.setattr(FrameCache, "read", counted)
    perform_all(work, "lights")
    assert crops and OBJECT not in crops


def test_photographs_of_which_most_are_copies_are_too_few_and_the_copies_named(tmp_path: Path) -> None:
    write_images(tmp_path, [np.full((40, 60), 90, np.uint8)] * 9, "{}.png")
    with (
        open_footage(tmp_path) as footage,
        pytest.raises(UnusableFrames, match=r"holds 1 frame, .*8 images are copies of others"),
    ):
        SampleRecorder(footage, 100, lambda done, total: None).sample()


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_dark_images_are_named_as_dark_and_few_bits_are_asked_after(kind: type, tmp_path: Path) -> None:
    step = 1 if kind == np.uint8 else 500
    write_images(tmp_path, [np.full((40, 60), step * level, kind) for level in range(9)], "{}.png")
    with open_footage(tmp_path) as footage, pytest.raises(UnusableFrames) as raised:
        SampleRecorder(footage, 100, lambda done, total: None).sample()
    level = "8 of 255" if kind == np.uint8 else "16 of 255 (4000 of 65,535)"
    assert raised.value.message.endswith(f"is dark: its brightest pixel has the level {level}")
    assert ("12 bits" in raised.value.remedy) == (kind == np.uint16)


def test_two_photographs_are_too_few(tmp_path: Path) -> None:
    write_images(tmp_path, [np.full((40, 60), level, np.uint8) for level in (50, 90)], "{}.png")
    with open_footage(str(tmp_path / "*.png")) as footage:
        recorder = SampleRecorder(footage, 100, lambda done, total: None)
        with pytest.raises(UnusableFrames, match="holds 2 frames, too few") as raised:
            recorder.sample()
    assert "a few dozen photographs" in str(raised.value)
