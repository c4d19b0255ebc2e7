import io
import json
import os
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest
from rich.console import Console

from glint.flows.reporting.console import JsonLines, PlainLines, open_console
from glint.flows.reporting.events import (
    CaptureEnded,
    CaptureWarning,
    RunProgress,
    StageEnded,
    StageProgress,
    StageStarted,
)
from glint.flows.reporting.progress_bars import ProgressBars


def test_json_lines_are_whole_objects_from_many_threads() -> None:
    stream = io.StringIO()
    console = JsonLines(stream)

    def talk(number: int) -> None:
        for done in range(50):
            console.emit(StageProgress(f'gläs"{number}\n', "frames", done, 50, 1.0, "frames"))

    threads = [threading.Thread(target=talk, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    objects = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert len(objects) == 400
    assert {item["capture"] for item in objects} == {f'gläs"{number}\n' for number in range(8)}
    assert set(objects[-1]) == {
        *("time", "kind", "capture", "stage", "done", "total", "seconds", "frames_per_second"),
    } - ({"frames_per_second"} if objects[-1]["done"] == 0 else set())


def test_json_says_false_but_not_what_is_unknown() -> None:
    stream = io.StringIO()
    JsonLines(stream).emit(CaptureEnded("glass/front", 0.0, cached=False))
    said = json.loads(stream.getvalue())
    del said["time"]
    assert said == {"kind": "capture", "capture": "glass/front", "seconds": 0.0, "cached": False}


def test_json_says_what_is_left_of_the_run() -> None:
    stream = io.StringIO()
    JsonLines(stream).emit(RunProgress(2, 5, 40.0))
    line = json.loads(stream.getvalue())
    del line["time"]
    assert line == {"kind": "run", "done": 2, "total": 5, "seconds_left": 40.0}


def test_the_start_of_a_stage_is_progress_for_machines() -> None:
    stream = io.StringIO()
    JsonLines(stream).emit(StageStarted("glass/front", "labels", "parts"))
    line = json.loads(stream.getvalue())
    del line["time"]
    assert line == {"kind": "progress", "capture": "glass/front", "stage": "labels", "done": 0, "seconds": 0.0}


def test_plain_lines_tell_progress_now_and_then_and_every_end() -> None:
    stream = io.StringIO()
    console = PlainLines(stream, interval=60.0)
    for done in range(100):
        console.emit(StageProgress("glass/front", "frames", done, 100, 1.0, "frames"))
    console.emit(StageEnded("glass/front", "frames", 1.0))
    console.emit(CaptureWarning("glass/front", "only 3% of the object showed a highlight"))
    assert stream.getvalue().splitlines() == [
        "glass/front  frames  done in 1.0 s",
        "glass/front  warning: only 3% of the object showed a highlight",
    ]
    eager = PlainLines(stream, interval=0.0)
    eager.emit(StageProgress("glass/front", "frames", 3, 100, 1.0, "frames"))
    assert stream.getvalue().splitlines()[-1] == "glass/front  frames  3/100 frames  3 frames/s"


def test_bars_show_what_runs_and_leave_lines_of_what_ended() -> None:
    stream = io.StringIO()
    console = Console(file=stream, force_terminal=True, width=100, color_system=None)
    with ProgressBars(console) as bars:
        bars.emit(StageProgress("glass/[front]", "frames", 1200, 8000, 1.5, "frames"))
        bars._progress.refresh()
        assert "1200/8000 frames  800 frames/s" in stream.getvalue()
        assert "glass/[front]" in stream.getvalue()
        bars.emit(StageProgress("glass/[front]", "frames", 8000, 8000, 9.0, "frames", seconds_left=40.0, share=0.08))
        bars.emit(StageEnded("glass/[front]", "frames", 9.0))
        (bar,) = bars._progress.tasks
        assert not bar.finished and bar.percentage < 10.0, "the bar is the capture's, and the clock goes on"
        bars._progress.refresh()
        assert "done, about 40 s left" in stream.getvalue()
        bars._progress.update(bar.id, end=time.monotonic() + 20.0)
        bars._progress.refresh()
        assert ", about 20 s left" in stream.getvalue(), "time passes without events"
        bars.emit(RunProgress(2, 5, 40.0))
        bars._progress.refresh()
        assert "2 of 5 captures, about 40 s left" in stream.getvalue()
        bars._progress.remove_task(bars._progress.tasks[-1].id)
        bars.emit(CaptureEnded("glass/[front]", 4.0))
        bars.emit(StageProgress("glass/[front]", "frames", 8000, 8000, 4.0, "frames"))
        assert bars._progress.tasks == []
    assert "glass/[front]  done in 4.0 s" in stream.getvalue()


@pytest.mark.parametrize("sink", [JsonLines, PlainLines])
def test_a_full_disk_under_the_log_does_not_stop_a_run(sink: type[JsonLines | PlainLines]) -> None:
    with Path("/dev/full").open("w") as log, sink(log) as console:
        for _ in range(2):
            console.emit(CaptureEnded("glass/front", 2.0))
        with suppress(OSError):  # what is buffered
            log.close()


def test_a_terminal_that_is_gone_does_not_stop_a_run() -> None:
    leader, follower = os.openpty()
    terminal = os.fdopen(follower, "w")
    with ProgressBars(Console(file=terminal, force_terminal=True)) as console:
        console.emit(StageStarted("glass/front", "frames"))
        os.close(leader)
        console.emit(StageProgress("glass/front", "frames", 1, 2, 1.0))
        for capture in ("front", "back"):
            console.emit(CaptureEnded(f"glass/{capture}", 2.0))
    with suppress(OSError):  # what is buffered
        terminal.close()


def test_the_display_fits_where_the_output_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(open_console(as_json=True), JsonLines)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: False, raising=False)
    assert isinstance(open_console(), PlainLines)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    assert isinstance(open_console(), ProgressBars)


def test_json_gives_the_time_of_an_event_not_of_its_arrival() -> None:
    stream = io.StringIO()
    began = time.time()
    JsonLines(stream).emit(StageStarted("glass/front", "labels", age=100.0))
    line = json.loads(stream.getvalue())
    assert began - 100.0 - 0.01 <= line["time"] <= time.time() - 100.0 + 0.01
    assert "age" not in line
