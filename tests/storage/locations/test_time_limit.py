"""Inputs that never answer, or are far too large: refused in time, by their head, with progress."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pytest

from glint.flows.reporting import input_reading
from glint.flows.reporting.events import Event, Message
from glint.storage.catalogue.loading import load
from glint.storage.errors import InputError
from glint.storage.footage.video import Video
from glint.storage.inputs import digests
from glint.storage.inputs.digests import content_digest
from glint.storage.inputs.lp_file import read_lights
from glint.storage.locations import time_limit
from glint.storage.locations.location import Location
from glint.storage.locations.time_limit import items_within_time, within_time
from tests.storage.footage.videos import write_video

HOLDER = """
import fcntl, os, signal, sys, time
signal.signal(signal.SIGIO, signal.SIG_IGN)
handle = os.open(sys.argv[1], os.O_RDWR)
fcntl.fcntl(handle, fcntl.F_SETLEASE, fcntl.F_WRLCK)
print("held", flush=True)
time.sleep(600)
"""
"""Holds a lease on a file: whoever opens it waits in the kernel, as on a mount whose server is gone."""


@pytest.fixture
def hung(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A file whose opening blocks, and a short patience."""
    monkeypatch.setattr(time_limit, "SILENCE_SECONDS", 1.0)
    path = tmp_path / "hung"
    path.write_text("1\nx 0 0 1\n")
    holder = subprocess.Popen([sys.executable, "-c", HOLDER, str(path)], stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None
    if holder.stdout.readline() != "held\n":
        pytest.skip("the file system knows no leases")
    yield path
    holder.kill()
    holder.wait()


def test_files_that_hang_are_given_up(hung: Path, tmp_path: Path) -> None:
    started = time.monotonic()
    for read in (
        lambda: load(hung),
        lambda: read_lights(hung),
        lambda: content_digest(hung, Location.parse(tmp_path / "store")),
        lambda: content_digest(hung, Location.parse(tmp_path / "store"), key="frames"),
    ):
        with pytest.raises(InputError, match="has given nothing for 1 s") as caught:
            read()
        assert "mount" in caught.value.remedy
    assert time.monotonic() - started < 60


def test_what_goes_on_slowly_is_not_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time_limit, "SILENCE_SECONDS", 2.0)

    def slow(step: Callable[[], None]) -> str:
        for _ in range(8):
            time.sleep(0.4)
            step()
        return "read"

    assert within_time(slow, "tape") == "read"
    with pytest.raises(ZeroDivisionError):
        within_time(lambda step: 1 // 0, "tape")


def test_items_come_in_order_and_their_end_and_errors_too() -> None:
    assert list(items_within_time(iter(range(100)), "tape")) == list(range(100))

    def broken() -> Iterator[int]:
        yield 1
        raise ZeroDivisionError

    taken = items_within_time(broken(), "tape")
    assert next(taken) == 1
    with pytest.raises(ZeroDivisionError):
        next(taken)


def test_what_makes_items_ends_when_no_more_are_taken() -> None:
    closed = threading.Event()

    def endless() -> Iterator[int]:
        try:
            while True:
                yield 1
        finally:
            closed.set()

    taken = items_within_time(endless(), "tape")
    assert next(taken) == 1
    assert isinstance(taken, Generator)
    taken.close()
    assert closed.is_set()
    assert not any(thread.name == "reading tape" and thread.is_alive() for thread in threading.enumerate())


def test_a_video_that_hangs_while_it_is_decoded_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frames = list(np.random.default_rng(0).integers(0, 255, (60, 80, 100), np.uint8))
    data = write_video(tmp_path / "whole.mkv", frames, "ffv1", "gray").read_bytes()
    pipe, next_pipe = tmp_path / "stalled.mkv", tmp_path / "next.mkv"
    os.mkfifo(pipe)
    streams: list[BinaryIO] = []

    def write_half(stream: BinaryIO) -> None:
        with suppress(OSError):  # its reader closes it
            stream.write(data[: len(data) // 2])

    def serve() -> None:
        """Give whoever opens the pipe half of the video, and then nothing, as a mount whose server goes away."""
        while True:
            streams.append(pipe.open("wb", buffering=0))
            # Before its reader can have read and closed it: the next reader gets a pipe of its own.
            os.mkfifo(next_pipe)
            next_pipe.replace(pipe)
            threading.Thread(target=write_half, args=(streams[-1],), daemon=True).start()

    threading.Thread(target=serve, daemon=True).start()
    monkeypatch.setattr(time_limit, "SILENCE_SECONDS", 3.0)
    video = Video(Location.parse(pipe))
    taken = video.frames()
    assert next(taken).shape == (80, 100)
    started = time.monotonic()
    with pytest.raises(InputError, match=r"stalled.mkv has given nothing for 3 s"):
        list(taken)
    assert time.monotonic() - started < 60
    for stream in streams:
        stream.close()


def test_progress_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(input_reading, "INTERVAL_SECONDS", 0.0)
    (tmp_path / "video.mp4").write_bytes(b"x")
    os.truncate(tmp_path / "video.mp4", 50_000_000)
    events: list[Event] = []
    with input_reading.reading_shown(events.append):
        content_digest(tmp_path / "video.mp4", Location.parse(tmp_path / "store"))
    texts = [event.text for event in events if isinstance(event, Message)]
    assert (texts and texts[-1].endswith("video.mp4: 0.1 of 0.1 GB")) or texts[-1].endswith("0.0 of 0.1 GB")


def test_a_mount_that_dies_while_a_file_is_read_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time_limit, "SILENCE_SECONDS", 1.0)
    path, ended = tmp_path / "video.mp4", threading.Event()
    path.write_bytes(b"video")
    original, calls = digests.file_stamp, list[Location]()

    def stamp(file: Location) -> list[Any]:
        calls.append(file)
        if len(calls) > 1:
            ended.wait(10.0)
        return original(file)

    monkeypatch.setattr(digests, "file_stamp", stamp)
    with pytest.raises(InputError, match="has given nothing for 1 s"):
        content_digest(path, Location.parse(tmp_path / "store"))
    ended.set()
