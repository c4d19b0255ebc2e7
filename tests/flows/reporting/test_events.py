import time
from contextlib import AbstractContextManager

import pytest

from glint.flows.reporting.events import Event, Reporter, from_worker, listen, sentence
from glint.flows.runtime.dask_cluster import Cluster


class Kept(AbstractContextManager["Kept"]):
    """A display that keeps what it is told."""

    def __init__(self) -> None:
        self.events: list[Event] = []

    def show(self, event: Event) -> None:
        self.events.append(event)

    def __exit__(self, *unused: object) -> None:
        """Nothing to end."""


@pytest.mark.parametrize(
    ("event", "words"),
    [
        (
            Event("progress", "glass/front", "frames", done=1200, total=8000, seconds=1.5),
            "glass/front  frames  1200/8000 frames  800 frames/s",
        ),
        (
            Event("progress", "glass/front", "clusters", done=3, total=9, seconds=1.5),
            "glass/front  clusters  3/9 tiles",
        ),
        (Event("progress", "glass/front", "survey", done=7, seconds=0.0), "glass/front  survey  7 frames"),
        (
            Event("stage", "glass/front", "frames", seconds=4.0, frames=8000),
            "glass/front  frames  done in 4.0 s  2000 frames/s",
        ),
        (Event("stage", "glass/front", "depth", seconds=0.01, cached=True), "glass/front  depth  unchanged"),
        (Event("failed", "glass/front", text="no light: film again"), "glass/front  failed: no light: film again"),
        (Event("message", text="dashboard here"), "dashboard here"),
    ],
)
def test_events_in_words(event: Event, words: str) -> None:
    assert sentence(event) == words


def test_rates_are_of_frames_alone() -> None:
    assert Event("progress", stage="clusters", done=10, seconds=2.0).rate is None
    assert Event("progress", stage="frames", done=10, seconds=2.0).rate == 5.0
    assert Event("stage", stage="frames", frames=10, seconds=2.0, cached=True).rate is None


def test_a_reporter_is_seldom_heard_but_for_the_end() -> None:
    kept = Kept()
    reporter = Reporter(kept.show, "glass/front", "frames", every=60.0)
    for done in range(1, 101):
        reporter(done, 100)
    assert [event.done for event in kept.events][-1] == 100
    assert len(kept.events) <= 2


def work() -> str:
    reporter = Reporter(from_worker(), "glass/front", "frames")
    for done in range(1, 101):
        reporter(done, 100)
    return "done"


@pytest.mark.server
def test_workers_are_heard(cluster: Cluster) -> None:
    kept = Kept()
    listen(cluster.client, kept.show)
    assert cluster.client.submit(work, pure=False).result(timeout=60) == "done"
    deadline = time.monotonic() + 20
    while not kept.events or kept.events[-1].done != 100:
        assert time.monotonic() < deadline, "the worker's last event never came"
        time.sleep(0.02)
    assert {(event.capture, event.stage, event.total) for event in kept.events} == {("glass/front", "frames", 100)}
