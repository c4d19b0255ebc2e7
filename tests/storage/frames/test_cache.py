"""The frame cache holds what decoding gives, whatever interrupts the writing of it."""

import json
import multiprocessing
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import glint.storage.frames.ingest
from glint.storage.catalogue.loading import Region
from glint.storage.errors import InputError, StoreError
from glint.storage.footage.source import Footage, open_footage
from glint.storage.footage.video import Video
from glint.storage.frames.cache import FrameCache, cache_digest
from glint.storage.frames.errors import DamagedFrames
from glint.storage.frames.layout import MAX_SHARD_BYTES, shard_frames
from glint.storage.frames.layout import SHARD_FRAMES as SHARD
from glint.storage.locations.location import Location
from tests.polling import PATIENCE
from tests.storage.footage.videos import ramp, write_images, write_video

CROPS = {
    "object": Region(x=3, y=5, width=70, height=66),
    "sphere-0": Region(x=80, y=60, width=20, height=21),
    "corner": Region(x=90, y=70, width=10, height=11),
    "all": Region(x=0, y=0, width=100, height=81),
}
SPAWN = multiprocessing.get_context("spawn")


def _frames(count: int) -> np.ndarray:
    """(T, 81, 100), every frame different."""
    frames = np.stack([ramp(index, 81, 100) for index in range(count)])
    frames[:, 40, 50] = np.arange(count) % 251
    return frames


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, np.ndarray]:
    """A lossless video of 330 frames, and the frames."""
    frames = _frames(330)
    return write_video(tmp_path_factory.mktemp("video") / "video.mkv", list(frames), "ffv1", "gray"), frames


def _place(folder: Path) -> Location:
    return Location.parse(folder / "store")


def _same(cache: FrameCache, frames: np.ndarray) -> None:
    assert cache.complete
    assert cache.frames == cache.total == len(frames)
    assert set(cache.crops) == set(CROPS)
    for name, crop in CROPS.items():
        assert cache.crops[name] == crop
        assert np.array_equal(cache.read(name), frames[:, crop.rows, crop.columns])


class _Counted:
    """Footage that knows where it was read from."""

    def __init__(self, footage: Footage) -> None:
        self._footage = footage
        self.starts: list[int] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._footage, name)

    def frames(self, start: int = 0, step: int = 1) -> Iterator[np.ndarray]:
        self.starts.append(start)
        return self._footage.frames(start, step)


@pytest.mark.parametrize("count", [1, 63, 64, 65, 130])
def test_the_cache_is_what_decoding_gives(tmp_path: Path, count: int) -> None:
    frames = _frames(count)
    path = write_video(tmp_path / "video.mkv", list(frames), "ffv1", "gray")
    reported: list[tuple[int, int | None]] = []
    cache = FrameCache.ingest(open_footage(path), _place(tmp_path), "d", CROPS, lambda *step: reported.append(step))
    _same(cache, frames)
    assert cache.frame_size == (81, 100)
    assert cache.bits == 8
    assert cache.warnings == ()
    assert reported == [(min(end, count), count) for end in range(SHARD, count + SHARD, SHARD)]
    _same(FrameCache.open(_place(tmp_path), "d"), frames)


def test_shards_are_as_long_as_memory_allows() -> None:
    small, large = Region(x=0, y=0, width=240, height=250), Region(x=0, y=0, width=6000, height=4000)
    assert [shard_frames({"object": small}, 8, count) for count in (0, 300, 600, 8000)] == [64, 64, 128, 128]
    assert shard_frames({"object": Region(x=0, y=0, width=2000, height=1770)}, 8, 3000) == 64
    for bits in (8, 16):
        length = shard_frames({"object": large, "sphere-0": small}, bits, 60)
        assert 8 <= length < 64 and length * 6016 * 4032 * bits // 8 <= MAX_SHARD_BYTES


def test_long_shards_hold_what_decoding_gives(tmp_path: Path) -> None:
    frames = np.random.default_rng(0).integers(0, 256, (1030, 30, 90), np.uint8)
    path = write_video(tmp_path / "video.mkv", list(frames), "ffv1", "gray")
    crops = {"object": Region(x=0, y=0, width=90, height=30)}
    cache = FrameCache.ingest(open_footage(path), _place(tmp_path), "d", crops)
    assert cache.shard_frames == 128
    assert np.array_equal(cache.read("object"), frames)
    assert np.array_equal(cache.read("object", slice(250, 260), columns=slice(60, 70)), frames[250:260, :, 60:70])


def test_part_of_the_frames_and_pixels(tmp_path: Path, video: tuple[Path, np.ndarray]) -> None:
    path, frames = video
    cache = FrameCache.ingest(open_footage(path), _place(tmp_path), "d", CROPS)
    part = cache.read("object", slice(60, 200, 7), slice(60, 66), slice(1, 70, 3))
    crop = CROPS["object"]
    assert np.array_equal(part, frames[60:200:7, crop.rows, crop.columns][:, 60:66, 1:70:3])
    assert cache.read("object", slice(320, 9999)).shape == (10, 66, 70)
    assert cache.read("object", slice(-3, None)).shape == (3, 66, 70)
    assert cache.read("object", slice(700, 710)).shape == (0, 66, 70)
    with pytest.raises(StoreError, match="no frames of 'other'"):
        cache.read("other")


def test_16_bits_and_images(tmp_path: Path) -> None:
    frames = _frames(70).astype(np.uint16) * 257 + 3
    folder = write_images(tmp_path / "images", list(frames))[0].parent
    cache = FrameCache.ingest(open_footage(folder), _place(tmp_path), "d", CROPS)
    assert cache.bits == 16
    _same(cache, frames)


def test_black_frames_are_black(tmp_path: Path) -> None:
    frames = np.zeros((130, 81, 100), np.uint8)
    path = write_video(tmp_path / "video.mkv", list(frames), "ffv1", "gray")
    _same(FrameCache.ingest(open_footage(path), _place(tmp_path), "d", CROPS), frames)


def test_a_complete_cache_is_not_written_again(tmp_path: Path, video: tuple[Path, np.ndarray]) -> None:
    footage: Any = _Counted(open_footage(video[0]))
    FrameCache.ingest(footage, _place(tmp_path), "d", CROPS)
    FrameCache.ingest(footage, _place(tmp_path), "d", CROPS)
    assert footage.starts == [0]


def test_more_frames_than_the_file_states(tmp_path: Path, video: tuple[Path, np.ndarray]) -> None:
    footage = open_footage(video[0])
    assert isinstance(footage, Video)
    footage.count = 0
    _same(FrameCache.ingest(footage, _place(tmp_path), "d", CROPS), video[1])


def test_fewer_frames_than_the_file_states_are_reported(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    frames = random.integers(0, 255, (150, 81, 100), np.uint8)
    path = write_video(tmp_path / "video.mkv", list(frames), "ffv1", "gray")
    path.write_bytes(path.read_bytes()[: int(0.6 * path.stat().st_size)])
    cache = FrameCache.ingest(open_footage(path), _place(tmp_path), "d", CROPS)
    assert cache.complete
    assert 64 < cache.frames < 100
    assert np.array_equal(cache.read("all")[:-1], frames[: cache.frames - 1])
    assert f"frames 0 to {cache.frames - 1} of 150 can be read" in cache.warnings[0]


@pytest.mark.parametrize(
    "crop",
    [
        Region(x=90, y=70, width=11, height=11),
        Region(x=90, y=70, width=10, height=12),
        Region(x=100, y=0, width=1, height=1),
    ],
)
def test_a_crop_that_leaves_the_frame(tmp_path: Path, video: tuple[Path, np.ndarray], crop: Region) -> None:
    with pytest.raises(InputError, match="the region of object") as caught:
        FrameCache.ingest(open_footage(video[0]), _place(tmp_path), "d", {"object": crop})
    assert "leaves the frame of 100 x 81 pixels" in caught.value.message
    assert not (tmp_path / "store").exists()


def test_the_digest_tells_footage_and_crops_apart() -> None:
    region = Region(x=0, y=0, width=3, height=3)
    digests = {
        cache_digest("a", {"object": region}),
        cache_digest("b", {"object": region}),
        cache_digest("a", {"sphere-0": region}),
        cache_digest("a", {"object": Region(x=0, y=0, width=3, height=4)}),
    }
    assert len(digests) == 4
    assert cache_digest("a", {"object": region, "b": region}) == cache_digest("a", {"b": region, "object": region})


def _ingest_and_die(path: Path, folder: Path, moment: str, shard: int) -> None:
    """Ingest until the shard with this number is about to be counted, or was, and die as by a cut of power."""
    written = 0

    def die(*arguments: Any) -> None:
        nonlocal written
        written += 1
        if written == shard * (len(CROPS) if moment == "before" else 1):
            os.kill(os.getpid(), signal.SIGKILL)

    if moment == "before":
        glint.storage.frames.ingest.flush = die  # type: ignore[assignment]
    FrameCache.ingest(open_footage(path), _place(folder), "d", CROPS, die if moment == "after" else None)


@pytest.mark.long
@pytest.mark.parametrize(("moment", "count"), [("before", 2 * SHARD), ("after", 3 * SHARD)])
def test_after_a_kill_it_goes_on_where_it_was(
    tmp_path: Path, video: tuple[Path, np.ndarray], moment: str, count: int
) -> None:
    worker = SPAWN.Process(target=_ingest_and_die, args=(video[0], tmp_path, moment, 3))
    worker.start()
    worker.join(timeout=PATIENCE)
    assert worker.exitcode == -signal.SIGKILL
    part = FrameCache.open(_place(tmp_path), "d")
    assert not part.complete
    assert part.frames == count
    for name, crop in CROPS.items():
        assert np.array_equal(part.read(name), video[1][:count, crop.rows, crop.columns])
    first = tmp_path / "store/frames/d/object/c/0/0/0"
    before = first.stat().st_mtime_ns
    footage: Any = _Counted(open_footage(video[0]))
    _same(FrameCache.ingest(footage, _place(tmp_path), "d", CROPS), video[1])
    assert footage.starts == [count]
    assert first.stat().st_mtime_ns == before


def _ingest_slowly(path: Path, folder: Path, done: Any) -> None:
    def wait(count: int, _: int | None) -> None:
        done.value = count

    class Slow(_Counted):
        def frames(self, start: int = 0, step: int = 1) -> Iterator[np.ndarray]:
            for frame in super().frames(start, step):
                time.sleep(0.002)
                yield frame

    footage: Any = Slow(open_footage(path))
    FrameCache.ingest(footage, _place(folder), "d", CROPS, wait)


@pytest.mark.slow
def test_killed_at_any_time_it_is_whole_in_the_end(tmp_path: Path, video: tuple[Path, np.ndarray]) -> None:
    random = np.random.default_rng(0)
    for _ in range(2):
        done = SPAWN.Value("i", 0)
        worker = SPAWN.Process(target=_ingest_slowly, args=(video[0], tmp_path, done))
        worker.start()
        begin = done.value
        while worker.is_alive() and done.value == begin:
            worker.join(0.01)
        worker.join(float(random.uniform(0, 0.1)))
        assert worker.pid is not None
        os.kill(worker.pid, signal.SIGKILL)
        worker.join(timeout=PATIENCE)
        part = FrameCache.open(_place(tmp_path), "d")
        assert done.value <= part.frames
        crop = CROPS["all"]
        assert np.array_equal(part.read("all"), video[1][: part.frames, crop.rows, crop.columns])
    _same(FrameCache.ingest(open_footage(video[0]), _place(tmp_path), "d", CROPS), video[1])


def test_footage_that_fails_in_the_middle_keeps_what_was_read(tmp_path: Path) -> None:
    frames = _frames(150)
    paths = write_images(tmp_path / "images", list(frames))
    whole = paths[140].read_bytes()
    paths[140].write_bytes(b"damaged")
    with pytest.raises(InputError, match="img_141"):
        FrameCache.ingest(open_footage(tmp_path / "images"), _place(tmp_path), "d", CROPS)
    assert FrameCache.open(_place(tmp_path), "d").frames == 128
    paths[140].write_bytes(whole)
    _same(FrameCache.ingest(open_footage(tmp_path / "images"), _place(tmp_path), "d", CROPS), frames)


def _ingest(path: Path, folder: Path, outcome: Any) -> None:
    cache = FrameCache.ingest(open_footage(path), _place(folder), "d", CROPS)
    outcome.put((cache.complete, int(cache.read("all").sum(dtype=np.int64))))


@pytest.mark.slow
def test_two_writers_make_one_cache(tmp_path: Path, video: tuple[Path, np.ndarray]) -> None:
    outcome = SPAWN.Queue()
    workers = [SPAWN.Process(target=_ingest, args=(video[0], tmp_path, outcome)) for _ in range(2)]
    for worker in workers:
        worker.start()
    answers = [outcome.get(timeout=PATIENCE) for _ in workers]
    for worker in workers:
        worker.join(timeout=PATIENCE)
    assert answers == [(True, int(video[1].sum(dtype=np.int64)))] * 2
    _same(FrameCache.open(_place(tmp_path), "d"), video[1])


def test_a_full_disk_is_a_store_error_and_resumes(tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", str(disk)], capture_output=True)
    if mounted.returncode:
        pytest.skip("may not mount a small disk here")
    try:
        frames = np.random.default_rng(0).integers(0, 255, (200, 81, 100), np.uint8)
        path = write_video(tmp_path / "video.mkv", list(frames), "ffv1", "gray")
        with pytest.raises(StoreError, match="free space"):
            FrameCache.ingest(open_footage(path), _place(disk), "d", CROPS)
        part = FrameCache.open(_place(disk), "d")
        assert part.frames == 64
        assert np.array_equal(part.read("all"), frames[:64])
        subprocess.run(["mount", "-o", "remount,size=32m", str(disk)], check=True)
        _same(FrameCache.ingest(open_footage(path), _place(disk), "d", CROPS), frames)
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_a_store_that_cannot_be_written(tmp_path: Path, video: tuple[Path, np.ndarray]) -> None:
    (tmp_path / "store").write_text("a file")
    with pytest.raises(StoreError, match="a file in place of a folder"):
        FrameCache.ingest(open_footage(video[0]), _place(tmp_path), "d", CROPS)
    with pytest.raises(StoreError, match="writing frames failed at /proc/store"):
        FrameCache.ingest(open_footage(video[0]), Location.parse("/proc/store"), "d", CROPS)


def test_no_cache(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="there are no frames"):
        FrameCache.open(_place(tmp_path), "d")


@pytest.fixture
def ready(tmp_path: Path, video: tuple[Path, np.ndarray]) -> Path:
    """The folder of a complete cache."""
    FrameCache.ingest(open_footage(video[0]), _place(tmp_path), "d", CROPS)
    return tmp_path / "store/frames/d"


@pytest.mark.parametrize("kind", ["missing", "empty", "cut off", "overwritten"])
def test_a_damaged_shard_is_reported(tmp_path: Path, ready: Path, kind: str) -> None:
    shard = ready / "all/c/2/0/0"
    data = shard.read_bytes()
    if kind == "missing":
        shard.unlink()
    else:
        shard.write_bytes({"empty": b"", "cut off": data[:-40], "overwritten": bytes(len(data))}[kind])
    cache = FrameCache.open(_place(tmp_path), "d")
    assert cache.read("all", slice(0, 128)).shape == (128, 81, 100)
    with pytest.raises(StoreError, match=r"are damaged: run again|have layout 99: run again"):
        cache.read("all")


@pytest.mark.parametrize("columns", [slice(0, 128), slice(0, 64)])
def test_shards_that_change_places_are_reported(tmp_path: Path, columns: slice) -> None:
    # Noise is not compressed: the chunks of both shards have the same places and sizes.
    noise = np.random.default_rng(0).integers(0, 256, (2 * SHARD, 64, 128), np.uint8)
    path = write_video(tmp_path / "video.mkv", list(noise), "ffv1", "gray")
    FrameCache.ingest(open_footage(path), _place(tmp_path), "d", {"all": Region(x=0, y=0, width=128, height=64)})
    first, second = (tmp_path / f"store/frames/d/all/c/{number}/0/0" for number in (0, 1))
    data = first.read_bytes()
    assert len(data) == second.stat().st_size
    first.write_bytes(second.read_bytes())
    second.write_bytes(data)
    with pytest.raises(DamagedFrames):
        FrameCache.open(_place(tmp_path), "d").read("all", slice(0, SHARD), columns=columns)


def test_the_metadata_of_an_array_that_changed_are_reported(tmp_path: Path, ready: Path) -> None:
    document = json.loads((ready / "all/zarr.json").read_text())
    assert document["data_type"] == "uint8"
    (ready / "all/zarr.json").write_text(json.dumps(document | {"data_type": "int8"}))
    cache = FrameCache.open(_place(tmp_path), "d")
    assert cache.read("object", slice(0, 1)).dtype == np.uint8
    with pytest.raises(DamagedFrames):
        cache.read("all", slice(0, 1))


def test_the_cache_of_other_frames_is_damaged_in_this_place(tmp_path: Path, ready: Path) -> None:
    shutil.copytree(ready, ready.with_name("e"))
    with pytest.raises(DamagedFrames):
        FrameCache.open(_place(tmp_path), "e")


@pytest.mark.parametrize("text", ["", "{", "[]", '{"zarr_format": 3, "node_type": "group", "attributes": {}}'])
def test_damaged_attributes_are_reported_and_rebuilt(
    tmp_path: Path, ready: Path, video: tuple[Path, np.ndarray], text: str
) -> None:
    (ready / "zarr.json").write_text(text)
    with pytest.raises(StoreError):
        FrameCache.open(_place(tmp_path), "d")
    _same(FrameCache.ingest(open_footage(video[0]), _place(tmp_path), "d", CROPS), video[1])


@pytest.mark.parametrize(
    ("key", "value"), [("frames", "many"), ("layout", 99), ("bits", None), ("frame_size", [1]), ("crops", {"a": {}})]
)
def test_attributes_that_make_no_sense_are_reported(tmp_path: Path, ready: Path, key: str, value: Any) -> None:
    document = json.loads((ready / "zarr.json").read_text())
    document["attributes"][key] = value
    (ready / "zarr.json").write_text(json.dumps(document))
    with pytest.raises(StoreError, match=r"are damaged: run again|have layout 99: run again"):
        FrameCache.open(_place(tmp_path), "d")


def test_a_deleted_cache_is_rebuilt(tmp_path: Path, ready: Path, video: tuple[Path, np.ndarray]) -> None:
    shutil.rmtree(ready)
    _same(FrameCache.ingest(open_footage(video[0]), _place(tmp_path), "d", CROPS), video[1])
