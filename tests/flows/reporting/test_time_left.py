"""The time left: nothing before something is measured, then what the run's own speed says."""

import pytest

from glint.flows.reporting.events import (
    CaptureEnded,
    CaptureFailed,
    Event,
    Message,
    RunProgress,
    StageEnded,
    StageProgress,
    StageStarted,
    left_in_words,
    sentence,
)
from glint.flows.reporting.time_left import MAX_SHARE, MS, MS_PER_FRAME, OTHER_MS, TimeLeft
from glint.tasks.pipeline import NAMES

FRAMES = 8000
SLOWNESS = 2.5
"""Seconds of this machine for a second of the work that the module knows."""
SECONDS = {
    name: SLOWNESS * (MS_PER_FRAME.get(name, 0) * FRAMES + MS.get(name, 0 if name in MS_PER_FRAME else OTHER_MS)) / 1e3
    for name in NAMES
}


def played(time_left: TimeLeft, capture: str, start: float) -> list[tuple[float, Event]]:
    """Follow a capture whose stages take SECONDS; return what is shown, with its moments."""
    shown, now = list[tuple[float, Event]](), start

    def emit(event: Event) -> None:
        shown.extend((now, item) for item in time_left.follow(event, now))

    for name in NAMES:
        began, is_frames = now, name == "frames"
        emit(StageStarted(capture, name))
        for tenth in range(1, 11):
            now = began + SECONDS[name] * tenth / 10
            emit(StageProgress(capture, name, FRAMES * tenth // 10, FRAMES, now - began, "frames" if is_frames else ""))
        emit(StageEnded(capture, name, SECONDS[name], frames=FRAMES if is_frames else None))
    emit(CaptureEnded(capture, now - start))
    return shown


def test_a_capture_tells_what_it_has_left_once_its_frames_show_the_speed() -> None:
    shown = played(TimeLeft(NAMES), "glass/front", 100.0)
    end = 100.0 + sum(SECONDS.values())
    reported = [(now, event) for now, event in shown if isinstance(event, StageProgress)]
    assert {event.seconds_left for _, event in reported if event.stage == "survey"} == {None}
    known = [(end - now, event.seconds_left) for now, event in reported if event.seconds_left is not None]
    assert len(known) > len(reported) * 0.85
    shares = [event.share for _, event in reported if event.share is not None]
    assert shares == sorted(shares) and 0.0 < shares[0] < 0.2
    assert shares[-1] == MAX_SHARE, "a full bar never stands still"
    for true, left in known:
        assert left == pytest.approx(true, abs=0.2 + 0.02 * true)


def test_a_run_counts_its_captures_and_the_time_of_those_that_have_not_begun() -> None:
    time_left = TimeLeft(NAMES)
    names = [f"glass/{number}" for number in range(5)]
    time_left.expect(names, names[:1])
    runs = [event for _, event in played(time_left, names[1], 0.0) if isinstance(event, RunProgress)]
    whole = sum(SECONDS.values())
    assert runs[0] == RunProgress(1, 5) and sentence(runs[0]) == "1 of 5 captures"
    assert (runs[-1].done, runs[-1].total) == (2, 5) and runs[-1].seconds_left == pytest.approx(3 * whole, rel=0.02)
    assert sentence(runs[-1]) == "2 of 5 captures, about 2 min left"
    (_, failed) = time_left.follow(CaptureFailed(names[2], "no light"), whole + 1)
    assert isinstance(failed, RunProgress)
    assert failed.done == 3 and failed.seconds_left == pytest.approx(2 * whole, rel=0.02)


def test_a_capture_whose_length_is_not_known_yet_counts_as_one_to_come() -> None:
    time_left = TimeLeft(NAMES)
    names = [f"glass/{number}" for number in range(3)]
    time_left.expect(names)
    played(time_left, names[0], 0.0)
    whole = sum(SECONDS.values())
    *_, report = time_left.follow(StageStarted(names[1], "survey"), whole + 2.0)
    assert isinstance(report, RunProgress) and report.seconds_left == pytest.approx(2 * whole, rel=0.02)


def test_captures_side_by_side_share_the_time() -> None:
    time_left = TimeLeft(NAMES)
    time_left.expect(["a/1", "a/2", "a/3", "a/4"])
    for name in ("a/1", "a/2"):
        list(time_left.follow(StageStarted(name, "survey"), 0.0))
    played(time_left, "a/1", 0.0)
    runs = [event for _, event in played(time_left, "a/2", 0.0) if isinstance(event, RunProgress)]
    assert runs[-1].seconds_left == pytest.approx(sum(SECONDS.values()), rel=0.02)


def test_stages_that_were_stored_measure_no_speed_and_have_nothing_left() -> None:
    time_left = TimeLeft(NAMES)
    for name in NAMES[: NAMES.index("labels")]:
        list(time_left.follow(StageStarted("a/1", name), 0.0))
        list(time_left.follow(StageEnded("a/1", name, 0.01, cached=True, frames=FRAMES if name == "frames" else None)))
    list(time_left.follow(StageStarted("a/1", "labels"), 0.0))
    (event,) = time_left.follow(StageProgress("a/1", "labels", 1, 2), 4.0)
    assert isinstance(event, StageProgress) and event.seconds_left is not None
    assert 4.0 < event.seconds_left < 7.0


def test_neither_a_pause_between_stages_nor_the_beginning_of_one_changes_the_speed() -> None:
    time_left = TimeLeft(NAMES)
    time_left.expect(["a/1", "a/2"])
    list(time_left.follow(StageStarted("a/1", "frames"), 0.0))
    list(time_left.follow(StageProgress("a/1", "frames", FRAMES, FRAMES), 20.0))
    list(time_left.follow(StageEnded("a/1", "frames", 20.0, frames=FRAMES), 20.0))
    runs = [list(time_left.follow(Message(""), now))[-1] for now in (22.0, 60.0)]
    assert isinstance(runs[0], RunProgress) and runs[0].seconds_left is not None and runs[0] == runs[1]
    list(time_left.follow(StageStarted("a/1", "labels"), 60.0))
    left = [
        event.seconds_left
        for done, now in ((0, 60.0), (1, 62.0))
        for event in time_left.follow(StageProgress("a/1", "labels", done, 100), now)
        if isinstance(event, StageProgress)
    ]
    assert left[0] is not None and left[1] == pytest.approx(left[0] - 2.0, abs=0.1)


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (None, ""), (0.4, ""), (3.4, ", about 3 s left"), (38.0, ", about 40 s left"),
        (290.0, ", about 5 min left"), (9000.0, ", about 2.5 h left"),
    ],
)  # fmt: skip
def test_time_in_round_numbers(seconds: float | None, words: str) -> None:
    assert left_in_words(seconds) == words
