"""Decoding in one pass: which frames a warning calls damaged."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from glint.storage.footage.decoding import undamaged_frames


class Recording:
    """A container whose packets hold one frame each, damaged or not."""

    def __init__(self, damaged: list[bool]) -> None:
        self._frames = [SimpleNamespace(number=number, is_corrupt=bad) for number, bad in enumerate(damaged)]
        stream = SimpleNamespace(codec_context=SimpleNamespace(thread_count=0), decode=lambda packet: packet.frames)
        self.streams = SimpleNamespace(video=[stream])

    def demux(self, _: Any) -> Iterator[SimpleNamespace]:
        for frame in self._frames:
            yield SimpleNamespace(frames=[frame], dts=frame.number, size=1)
        yield SimpleNamespace(frames=[], dts=None, size=0)


@pytest.mark.parametrize("count", [1, 64, 65])
def test_all_damaged_frames_before_a_sound_one_are_named(count: int) -> None:
    warnings = list[str]()
    recording = Recording([False, *[True] * count, False])
    frames: list[Any] = list(undamaged_frames(recording, warnings))
    assert [frame.number for frame in frames] == list(range(count + 2))
    assert warnings == [f"frames 1 to {count} are damaged in the file"]


def test_damaged_frames_at_the_end_are_left_out() -> None:
    warnings = list[str]()
    frames: list[Any] = list(undamaged_frames(Recording([False, True, True]), warnings))
    assert [frame.number for frame in frames] == [0]
    assert warnings == ["the video is damaged from frame 1 on"]
