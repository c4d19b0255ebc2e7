import io
import json
import sys
import threading

import pytest
from rich.console import Console

from glint.flows.reporting.console import JsonLines, PlainLines, open_display
from glint.flows.reporting.events import Event
from glint.flows.reporting.progress_bars import Bars


def test_json_lines_are_whole_objects_from_many_threads() -> None:
    stream = io.StringIO()
    display = JsonLines(stream)

    def talk(number: int) -> None:
        for done in range(50):
            display.show(Event("progress", f'gläs"{number}\n', "frames", done=done, total=50, seconds=1.0))

    threads = [threading.Thread(target=talk, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    objects = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert len(objects) == 400
    assert {each["capture"] for each in objects} == {f'gläs"{number}\n' for number in range(8)}
    assert set(objects[-1]) == {
        *("time", "kind", "capture", "stage", "done", "total", "seconds", "frames_per_second"),
    } - ({"frames_per_second"} if objects[-1]["done"] == 0 else set())


def test_json_says_false_but_not_what_is_unknown() -> None:
    stream = io.StringIO()
    JsonLines(stream).show(Event("capture", "glass/front", seconds=0.0, cached=False))
    said = json.loads(stream.getvalue())
    del said["time"]
    assert said == {"kind": "capture", "capture": "glass/front", "seconds": 0.0, "cached": False}


def test_plain_lines_tell_progress_now_and_then_and_every_end() -> None:
    stream = io.StringIO()
    display = PlainLines(stream, every=60.0)
    for done in range(100):
        display.show(Event("progress", "glass/front", "frames", done=done, total=100, seconds=1.0))
    display.show(Event("stage", "glass/front", "frames", seconds=1.0))
    display.show(Event("warning", "glass/front", text="only 3% of the object glinted"))
    assert stream.getvalue().splitlines() == [
        "glass/front  frames  done in 1.0 s",
        "glass/front  warning: only 3% of the object glinted",
    ]
    eager = PlainLines(stream, every=0.0)
    eager.show(Event("progress", "glass/front", "frames", done=3, total=100, seconds=1.0))
    assert stream.getvalue().splitlines()[-1] == "glass/front  frames  3/100 frames  3 frames/s"


def test_bars_show_what_runs_and_leave_lines_of_what_ended() -> None:
    stream = io.StringIO()
    console = Console(file=stream, force_terminal=True, width=100, color_system=None)
    with Bars(console) as bars:
        bars.show(Event("progress", "glass/[front]", "frames", done=1200, total=8000, seconds=1.5))
        bars._progress.refresh()
        assert "1200/8000 frames  800 frames/s" in stream.getvalue()
        assert "glass/[front]" in stream.getvalue()
        bars.show(Event("capture", "glass/[front]", seconds=4.0, frames=8000))
        bars.show(Event("progress", "glass/[front]", "frames", done=8000, total=8000, seconds=4.0))
        assert bars._progress.tasks == []
    assert "glass/[front]  done in 4.0 s  2000 frames/s" in stream.getvalue()


def test_the_display_fits_where_the_output_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(open_display(as_json=True), JsonLines)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: False, raising=False)
    assert isinstance(open_display(), PlainLines)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    assert isinstance(open_display(), Bars)
