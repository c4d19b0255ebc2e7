"""A video whose parts are decoded side by side gives what one pass over it gives."""

import itertools
import os
import threading
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import av
import numpy as np
import pytest

from glint.storage.footage import parts, side_by_side, video
from glint.storage.footage.source import open_footage
from tests.storage.footage.videos import ramp, turn, write_video

NOISE = np.random.default_rng(3)
COUNT = 130
FRAMES = [
    np.clip(ramp(index, 96, 128) + NOISE.normal(0, 6, (96, 128)), 0, 255).astype(np.uint8) for index in range(COUNT)
]
GOPS = {"g": "30", "bf": "3", "sc_threshold": "0"}
HEVC = {"preset": "ultrafast", "g": "30", "x265-params": "scenecut=0:bframes=3:log-level=none:open-gop="}

DIVISIBLE: list[tuple[str, dict[str, Any]]] = [
    ("closed.mp4", {"options": GOPS}),
    ("closed.mkv", {"options": GOPS}),
    ("ten_bits.mp4", {"options": GOPS, "pixels": "yuv420p10le"}),
    ("without_b.mov", {"options": {"g": "25", "bf": "0"}}),
    ("intra.mp4", {"options": {"g": "1"}}),
    ("hevc.mp4", {"codec": "libx265", "options": HEVC | {"x265-params": HEVC["x265-params"] + "0"}}),
    ("variable.mkv", {"options": GOPS, "times": np.cumsum([0, 3, 40, 900, *[77] * (COUNT - 4)]).tolist()}),
    ("gaps.mp4", {"options": GOPS, "times": [40 * n + 4000 * (n > 70) for n in range(COUNT)]}),
]
INDIVISIBLE: list[tuple[str, dict[str, Any]]] = [
    ("open.mp4", {"options": GOPS | {"x264-params": "open-gop=1"}}),
    ("hevc_open.mp4", {"codec": "libx265", "options": HEVC | {"x265-params": HEVC["x265-params"] + "1"}}),
    ("single_keyframe.mp4", {"options": GOPS | {"g": "1000"}}),
    ("intra_refresh.mp4", {"options": GOPS | {"x264-params": "intra-refresh=1"}}),
    ("without_times.h264", {"options": GOPS}),
    ("stream.ts", {"options": GOPS}),
    ("mpeg4.mp4", {"codec": "mpeg4", "options": {"g": "12"}}),
    ("ffv1.mkv", {"codec": "ffv1", "pixels": "gray"}),
]


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> list[side_by_side.SideBySide]:
    """The readers that were made."""
    made = list[side_by_side.SideBySide]()

    class Noted(side_by_side.SideBySide):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            made.append(self)

    monkeypatch.setattr(video, "SideBySide", Noted)
    return made


def _read(
    path: Path, decoders: int, monkeypatch: pytest.MonkeyPatch, start: int = 0, step: int = 1
) -> tuple[np.ndarray, list[str]]:
    monkeypatch.setattr(os, "cpu_count", lambda: decoders)
    with open_footage(path) as footage:
        return np.stack(list(footage.frames(start, step))), footage.warnings


def _check(path: Path, monkeypatch: pytest.MonkeyPatch, start: int = 0, step: int = 1) -> None:
    frames, warnings = _read(path, 1, monkeypatch, start, step)
    for decoders in (2, 3):
        again, told = _read(path, decoders, monkeypatch, start, step)
        assert again.dtype == frames.dtype and np.array_equal(again, frames) and told == warnings


@pytest.mark.parametrize(("name", "options"), DIVISIBLE)
def test_parts_give_the_frames_of_one_pass(
    tmp_path: Path, seen: list[side_by_side.SideBySide], monkeypatch: pytest.MonkeyPatch, name: str, options: Any
) -> None:
    _check(write_video(tmp_path / name, FRAMES, **options), monkeypatch)
    assert [reader.is_complete for reader in seen] == [True, True]


@pytest.mark.parametrize(("name", "options"), INDIVISIBLE)
def test_what_cannot_be_divided_is_read_in_one_pass(
    tmp_path: Path, seen: list[side_by_side.SideBySide], monkeypatch: pytest.MonkeyPatch, name: str, options: Any
) -> None:
    _check(write_video(tmp_path / name, FRAMES, **options), monkeypatch)
    assert not any(reader.is_complete for reader in seen)


@pytest.mark.parametrize(("start", "step"), [(7, 1), (0, 16), (64, 3), (COUNT - 1, 1)])
def test_some_of_the_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, start: int, step: int) -> None:
    _check(write_video(tmp_path / "a.mp4", FRAMES, options=GOPS), monkeypatch, start, step)


def test_a_turned_video(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_video(tmp_path / "a.mp4", FRAMES, options=GOPS, full_range=True)
    turn(path, 90)
    _check(path, monkeypatch)
    assert _read(path, 2, monkeypatch)[0].shape == (COUNT, 128, 96)


@pytest.mark.parametrize("place", [0.3, 0.55, 0.93])
def test_damage_is_told_as_in_one_pass(
    tmp_path: Path, seen: list[side_by_side.SideBySide], monkeypatch: pytest.MonkeyPatch, place: float
) -> None:
    path = write_video(tmp_path / "a.mp4", FRAMES, options=GOPS, container_options={"movflags": "faststart"})
    data = bytearray(path.read_bytes())
    start = int(place * len(data))
    data[start : start + 600] = np.random.default_rng(1).bytes(600)
    path.write_bytes(data)
    _check(path, monkeypatch)
    assert not any(reader.is_complete for reader in seen)


def test_damaged_frames_are_the_same_every_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_video(tmp_path / "a.mp4", FRAMES, options=GOPS, container_options={"movflags": "faststart"})
    data = bytearray(path.read_bytes())
    place = int(0.93 * len(data))
    data[place : place + 600] = np.random.default_rng(1).bytes(600)
    path.write_bytes(data)
    assert len({_read(path, 1, monkeypatch)[0].tobytes() for _ in range(20)}) == 1


def test_a_truncated_video(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_video(tmp_path / "a.mp4", FRAMES, options=GOPS, container_options={"movflags": "faststart"})
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    _check(path, monkeypatch)
    assert "ends early" in _read(path, 2, monkeypatch)[1][-1]


def test_an_edit_list_that_leaves_frames_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_video(tmp_path / "a.mp4", FRAMES, options=GOPS)
    data = bytearray(path.read_bytes())
    entry = data.index(b"elst") + 12
    with av.open(str(path)) as container:
        second = round(1 / container.streams.video[0].time_base)
    begin = int.from_bytes(data[entry + 4 : entry + 8], "big") + 2 * second
    data[entry + 4 : entry + 8] = begin.to_bytes(4, "big")
    path.write_bytes(data)
    _check(path, monkeypatch)
    assert len(_read(path, 2, monkeypatch)[0]) == COUNT - 50


def test_a_part_that_needs_the_one_before_is_noticed(
    tmp_path: Path, seen: list[side_by_side.SideBySide], monkeypatch: pytest.MonkeyPatch
) -> None:
    numbers = itertools.count()
    monkeypatch.setattr(parts._UnitReader, "read", lambda self, packet: (next(numbers) % 45 == 0, False))
    _check(write_video(tmp_path / "a.mp4", FRAMES, options=GOPS | {"bf": "0"}), monkeypatch)
    assert not any(reader.is_complete for reader in seen)


def test_long_parts_are_not_held(
    tmp_path: Path, seen: list[side_by_side.SideBySide], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(side_by_side, "HELD_BYTES", 60 * 96 * 128)
    _check(write_video(tmp_path / "a.mp4", FRAMES, options=GOPS), monkeypatch)
    assert not any(reader.is_complete for reader in seen)


def test_reading_can_be_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_video(tmp_path / "a.mp4", FRAMES, options=GOPS)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    with open_footage(path) as footage:
        frames = footage.frames()
        assert next(frames).shape == (96, 128)
        assert isinstance(frames, Generator)
        frames.close()
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("decoding")]


@dataclass(frozen=True)
class _Packet:
    pts: int | None
    is_idr: bool = False
    size: int = 1
    is_corrupt: bool = False
    is_discard: bool = False

    def has_sidedata(self, name: str) -> bool:
        return False


FIRST = [_Packet(0, is_idr=True), _Packet(3), _Packet(1)]


@pytest.mark.parametrize(
    ("packets", "parts_before"),
    [
        ([_Packet(4, is_idr=True), _Packet(None)], 1),
        ([_Packet(4, is_idr=True), _Packet(4)], 1),
        ([_Packet(3, is_idr=True), _Packet(5)], 1),
        ([_Packet(4, is_idr=True), _Packet(2)], 1),
        ([_Packet(3), _Packet(6, is_idr=True)], 0),
        ([_Packet(4, is_idr=True), _Packet(5, is_discard=True)], 1),
        ([_Packet(4, is_idr=True), _Packet(5, is_corrupt=True)], 1),
    ],
)
def test_packets_that_cannot_be_divided(
    monkeypatch: pytest.MonkeyPatch, packets: list[_Packet], parts_before: int
) -> None:
    monkeypatch.setattr(
        parts, "_UnitReader", lambda stream: SimpleNamespace(read=lambda packet: (packet.is_idr, False))
    )
    found = parts.parts_of([*FIRST, *packets, _Packet(9, is_idr=True)], None, 1, 10)
    for _ in range(parts_before):
        assert next(found) == parts.Part(0, FIRST, [0, 1, 3])
    with pytest.raises(ValueError, match=r"packet without|times that|parameters"):
        next(found)
