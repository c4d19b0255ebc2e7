"""What workers tell of a capture is in its log and on its bar, and neither before nor after others'."""

import time
from typing import Any

import pytest
from distributed import Client
from prefect import flow, task
from prefect.client.orchestration import get_client
from prefect.client.schemas.filters import ArtifactFilter, ArtifactFilterKey, LogFilter, LogFilterTaskRunId
from prefect.runtime import task_run

from glint.flows.pipeline import stage_runs
from glint.flows.pipeline.context import Surroundings, share, surroundings
from glint.flows.pipeline.stage_runs import Hearing
from glint.flows.pipeline.worker import ended
from glint.flows.reporting.events import Event
from glint.flows.runtime.dask_cluster import Cluster
from glint.tasks.engine.stage import Record

pytestmark = [pytest.mark.server, pytest.mark.usefixtures("server")]
NAME = "heard/front"


@task(name="capture", task_run_name=NAME, persist_result=False)
def hear(here: Surroundings, events: list[Event], good: bool) -> Any:
    with Hearing(here, NAME) as hearing:
        for event in events:
            here.show(event)
            hearing.pass_on()
        assert hearing.stage == events[-1].stage
        if not good:
            raise ValueError("broken")
    return task_run.id


@pytest.fixture
def here(cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> Surroundings:
    monkeypatch.setattr(stage_runs, "PROGRESS_SECONDS", 0.0)
    share(cluster.address, cluster.client)
    return surroundings(cluster.address)


def bars() -> list[tuple[float, str]]:
    """Progress and stage of this capture's bars on the server."""
    with get_client(sync_client=True) as client:
        found = client.read_artifacts(
            artifact_filter=ArtifactFilter(key=ArtifactFilterKey(any_=["heard-front-progress"]))
        )
    return [(float(each.data), str(each.description)) for each in found]  # type: ignore[arg-type]


def logged(run: Any, count: int) -> list[str]:
    """Lines of a task run's log, once there are so many."""
    chosen = LogFilter(task_run_id=LogFilterTaskRunId(any_=[run]))
    for _ in range(100):
        with get_client(sync_client=True) as client:
            lines = [each.message for each in client.read_logs(chosen)]
        if len(lines) >= count:
            return lines
        time.sleep(0.2)
    raise AssertionError(lines)


def test_stages_and_warnings_are_logged_and_progress_moves_one_bar(here: Surroundings) -> None:
    frames = Record("frames", "k", False, 2.5, {"frames": 300}, ("the camera moved",))
    events = [
        Event("progress", NAME, "frames", done=0),
        Event("progress", NAME, "frames", done=75, total=300, seconds=1.0),
        Event("progress", "other/front", "labels", done=1, total=2, seconds=1.0),
        *ended(NAME, frames),
        Event("progress", NAME, "labels", done=1, total=2, seconds=1.0),
        Event("stage", NAME, "labels", seconds=0.01, cached=True),
    ]

    @flow(name="object", persist_result=False)
    def working(good: bool, count: int) -> Any:
        return hear(here, events[:count], good, return_state=True)

    with pytest.raises(ValueError, match="broken"):
        working(False, 2).result()
    assert bars() == [(25.0, "frames")], "a bar of what failed stays where it was"
    lines = logged(working(True, len(events)).result(), 4)
    assert sorted(bars()) == [(25.0, "frames"), (100.0, "done")]
    told = [each for each in lines if "Finished" not in each]
    assert told == ["frames in 2.50 s", f"{NAME}: the camera moved", "labels in 0.01 s, was there already"]
    assert not here.listeners


def test_events_of_a_stage_tell_its_frames_and_warnings() -> None:
    first, second = ended(NAME, Record("frames", "k", True, 0.1, {"frames": 300}, ("dark",)))
    assert (first.kind, first.frames, first.cached) == ("stage", 300, True)
    assert (second.kind, second.stage, second.text) == ("warning", "frames", "dark")


def test_a_capture_at_work_is_known(cluster: Cluster) -> None:
    here = Surroundings(Client(cluster.address, set_as_default=False))
    with here.turn("a/front"), here.turn("b/front"):
        assert here.working == {"a/front", "b/front"}
    assert not here.working
    here.client.close()
