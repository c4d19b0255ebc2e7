import time
from pathlib import Path

import pytest

from glint.flows.reporting.events import (
    CaptureWarning,
    ProgressThrottle,
    StageEnded,
    StageProgress,
    StageStarted,
)
from glint.flows.reporting.worker_events import PUBLISH_SECONDS, TOPIC, WorkerEvents, subscribe
from glint.flows.runtime.dask_cluster import Cluster
from tests.flows.recording_sink import RecordingSink
from tests.polling import PATIENCE, until

pytestmark = pytest.mark.server
FRONT = "glass/front"


def work() -> str:
    with WorkerEvents() as events:
        events.emit(StageStarted(FRONT, "frames", "frames"))
        progress = ProgressThrottle(events.emit, FRONT, "frames", "frames")
        for done in range(1, 101):
            progress(done, 100)
    return "done"


def work_slowly(path: str) -> str:
    """Report a start, and go on when the flow's process has heard of it; then report an end, a warning and fail."""
    with WorkerEvents() as events:
        events.emit(StageStarted(FRONT, "labels"))
        until(lambda: Path(path).exists())
        events.emit(StageEnded(FRONT, "labels", 2.0))
        time.sleep(0.2 * PUBLISH_SECONDS)
        events.emit(CaptureWarning(FRONT, "dark", "labels"))
        raise ValueError("broken")


def test_events_of_workers_arrive(cluster: Cluster) -> None:
    sink = RecordingSink()
    subscribe(cluster.client, sink.emit)
    assert cluster.client.submit(work, pure=False).result(timeout=PATIENCE) == "done"
    until(lambda: _progress(sink) and _progress(sink)[-1].done == 100, pause=0.02)
    assert sink.events[0] == StageStarted(FRONT, "frames", "frames")
    assert {(event.capture, event.stage, event.total, event.unit) for event in _progress(sink)} == {
        (FRONT, "frames", 100, "frames")
    }


def test_events_travel_together_and_in_time(cluster: Cluster, tmp_path: Path) -> None:
    sink, messages = RecordingSink(), list[int]()
    subscribe(cluster.client, sink.emit)
    future = cluster.client.submit(work_slowly, str(tmp_path / "heard"), pure=False)
    until(lambda: sink.events)
    assert sink.events == [StageStarted(FRONT, "labels")], "an event is not kept until the next one"
    cluster.client.subscribe_topic(TOPIC, lambda entry: messages.append(len(entry[1])))
    (tmp_path / "heard").touch()
    with pytest.raises(ValueError, match="broken"):
        future.result(timeout=PATIENCE)
    until(lambda: messages)
    assert messages == [2], "what a task has reported arrives in one message, also if it fails"


def test_an_event_tells_how_long_it_has_waited(cluster: Cluster) -> None:
    sink = RecordingSink()
    subscribe(cluster.client, sink.emit)
    cluster.client.submit(work_slowly, __file__, pure=False).exception(timeout=PATIENCE)
    until(lambda: len(sink.events) == 3)
    ages = [event.age for event in sink.events if isinstance(event, StageStarted | StageEnded | CaptureWarning)]
    assert ages[0] >= ages[1] >= 0.2 * PUBLISH_SECONDS > ages[2] >= 0.0


def _progress(sink: RecordingSink) -> list[StageProgress]:
    return [event for event in sink.events if isinstance(event, StageProgress)]
