import pytest

from glint.flows.reporting.events import (
    CaptureFailed,
    Event,
    Message,
    ProgressThrottle,
    StageEnded,
    StageProgress,
    StageStarted,
    sentence,
)
from tests.flows.recording_sink import RecordingSink

FRONT = "glass/front"


class ProgressSink(RecordingSink):
    """Keeps the events, of which it tells those of progress."""

    @property
    def progress(self) -> list[StageProgress]:
        return [event for event in self.events if isinstance(event, StageProgress)]


@pytest.mark.parametrize(
    ("event", "words"),
    [
        (
            StageProgress(FRONT, "frames", 1200, 8000, 1.5, "frames"),
            "glass/front  frames  1200/8000 frames  800 frames/s",
        ),
        (StageProgress(FRONT, "clusters", 3, 9, 1.5, "tiles"), "glass/front  clusters  3/9 tiles"),
        (StageProgress(FRONT, "survey", 7, unit="frames"), "glass/front  survey  7 frames"),
        (StageStarted(FRONT, "labels"), "glass/front  labels  0 parts"),
        (StageEnded(FRONT, "frames", 4.0, frames=8000), "glass/front  frames  done in 4.0 s  2000 frames/s"),
        (StageEnded(FRONT, "depth", 0.01, cached=True), "glass/front  depth  up to date"),
        (CaptureFailed(FRONT, "no light: film again"), "glass/front  failed: no light: film again"),
        (Message("dashboard here"), "dashboard here"),
    ],
)
def test_events_in_words(event: Event, words: str) -> None:
    assert sentence(event) == words


def test_rates_are_of_frames_alone() -> None:
    assert StageProgress(FRONT, "clusters", 10, seconds=2.0, unit="tiles").rate is None
    assert StageProgress(FRONT, "frames", 10, seconds=2.0, unit="frames").rate == 5.0
    assert StageEnded(FRONT, "frames", 2.0, frames=10, cached=True).rate is None


def test_a_throttle_emits_few_events_but_always_the_last() -> None:
    sink = ProgressSink()
    progress = ProgressThrottle(sink.emit, FRONT, "frames", interval=60.0)
    for done in range(1, 101):
        progress(done, 100)
    assert sink.progress[-1].done == 100
    assert len(sink.events) <= 2
