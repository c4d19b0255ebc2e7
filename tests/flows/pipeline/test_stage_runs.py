"""Stages on Prefect's timeline, as a real server records them; warnings in the log and progress beside them."""

import time
from typing import Any

import pytest
from prefect import flow, task
from prefect.client.orchestration import get_client
from prefect.client.schemas.filters import ArtifactFilter, ArtifactFilterKey, LogFilter, LogFilterTaskRunId
from prefect.client.schemas.objects import TaskRun
from prefect.runtime import flow_run, task_run

from glint.flows.errors import ClusterError
from glint.flows.pipeline import prefect_sink
from glint.flows.pipeline.prefect_sink import PrefectSink
from glint.flows.pipeline.stage_runs import CACHED
from glint.flows.pipeline.worker import end_events
from glint.flows.reporting.events import CaptureWarning, Event, StageEnded, StageProgress, StageStarted
from glint.flows.runtime.prefect_server import Server
from glint.tasks.engine.stage import StageRecord
from glint.tasks.engine.stage_warning import StageWarning
from tests.polling import until
from tests.prefect_api import ask

pytestmark = [pytest.mark.server, pytest.mark.usefixtures("server")]
NAME = "glass/front"
PAUSE = 0.3


@pytest.fixture(autouse=True)
def short_intervals(monkeypatch: pytest.MonkeyPatch) -> None:
    """Show a stage as running after 0.1 s, and progress at once."""
    monkeypatch.setattr(prefect_sink, "RUNNING_SECONDS", 0.1)
    monkeypatch.setattr(prefect_sink, "ARTIFACT_SECONDS", 0.0)


@task(name="capture", task_run_name=NAME, persist_result=False)
def capture(sink: PrefectSink, events: list[Event | float], error: Exception | None) -> str:
    """Emit events, waiting where a number stands, as the workers of a capture would."""
    with sink.attach(NAME) as reporter:
        for event in events:
            if isinstance(event, float):
                time.sleep(event)
            else:
                sink.emit(event)
        assert reporter.stage
        if error is not None:
            raise error
    return str(task_run.id)


@flow(name="object", persist_result=False)
def process(sink: PrefectSink, events: list[Event | float], error: Exception | None) -> tuple[str, Any]:
    return str(flow_run.id), capture(sink, events, error, return_state=True)


def run(events: list[Event | float], error: Exception | None = None) -> tuple[str, Any]:
    """Run one capture: the flow run's id, and the state of the capture."""
    with PrefectSink() as sink:
        return process(sink, events, error)


def graph(server: Server, run: str) -> dict[str, dict[str, Any]]:
    """Nodes of a flow run's graph by their labels."""
    return {node["label"]: node for _, node in ask(f"{server.api_url}/flow_runs/{run}/graph-v2")["nodes"]}


def recorded(node: dict[str, Any]) -> TaskRun:
    with get_client(sync_client=True) as client:
        return client.read_task_run(node["id"])


def progress_bars() -> list[tuple[float, str]]:
    """Progress and description of this capture's progress artifacts."""
    chosen = ArtifactFilter(key=ArtifactFilterKey(any_=["glass--front-progress"]))
    with get_client(sync_client=True) as client:
        artifacts = client.read_artifacts(artifact_filter=chosen)
    return [(float(artifact.data), str(artifact.description)) for artifact in artifacts]  # type: ignore[arg-type]


def log_lines(run: Any) -> list[str]:
    with get_client(sync_client=True) as client:
        return [line.message for line in client.read_logs(LogFilter(task_run_id=LogFilterTaskRunId(any_=[run])))]


def test_the_graph_shows_each_stage_inside_its_capture(server: Server) -> None:
    """Guard an upgrade of Prefect: stages are announced through a function that is not public."""
    events: list[Event | float] = [
        StageStarted(NAME, "survey"),
        StageEnded(NAME, "survey", 0.001, cached=True),
        StageStarted(NAME, "frames"),
        PAUSE,
        StageEnded(NAME, "frames", PAUSE),
        StageStarted(NAME, "labels"),
        PAUSE,
    ]
    flow_id, state = run(events, ClusterError("labels needs 9 GiB", "give a smaller region"))
    assert state.is_failed()
    nodes = until(lambda: found if len(found := graph(server, flow_id)) == 4 and _is_final(found) else {})
    assert set(nodes) == {NAME, "survey", "frames", "labels"}
    stages = [nodes[name] for name in ("survey", "frames", "labels")]
    assert all([parent["id"] for parent in stage["encapsulating"]] == [nodes[NAME]["id"]] for stage in stages)
    assert [stage["state_type"] for stage in stages] == ["COMPLETED", "COMPLETED", "FAILED"]
    survey, frames, labels = (recorded(stage) for stage in stages)
    assert survey.state is not None and survey.state.name == CACHED
    assert frames.state is not None and frames.state.name == "Completed"
    assert labels.state is not None and labels.state.message == "labels needs 9 GiB: give a smaller region"
    assert all(stage.start_time and stage.end_time for stage in (survey, frames, labels))
    for stage in (frames, labels):
        assert stage.end_time and stage.start_time
        assert PAUSE <= (stage.end_time - stage.start_time).total_seconds() < PAUSE + 30
    assert frames.end_time and labels.start_time and frames.end_time <= labels.start_time


def _is_final(nodes: dict[str, dict[str, Any]]) -> bool:
    return all(node["state_type"] in ("COMPLETED", "FAILED", "CRASHED") for node in nodes.values())


def test_a_long_stage_is_shown_while_it_runs(server: Server) -> None:
    shown: list[str] = []

    @task(name="capture", task_run_name=NAME, persist_result=False)
    def running(sink: PrefectSink) -> None:
        with sink.attach(NAME):
            sink.emit(StageStarted(NAME, "labels"))
            found = until(lambda: graph(server, str(flow_run.id)).get("labels"))
            shown.append(str(found and found["state_type"]))
            sink.emit(StageEnded(NAME, "labels", 1.0))

    @flow(name="object", persist_result=False)
    def working() -> str:
        with PrefectSink() as sink:
            running(sink)
        return str(flow_run.id)

    flow_id = working()
    assert shown == ["RUNNING"]
    until(lambda: graph(server, flow_id)["labels"]["state_type"] == "COMPLETED")


def test_a_stage_whose_worker_died_is_shown_as_crashed_and_run_again(server: Server) -> None:
    events: list[Event | float] = [
        StageStarted(NAME, "labels"),
        PAUSE,
        StageStarted(NAME, "survey"),
        StageEnded(NAME, "survey", 0.001, cached=True),
        StageStarted(NAME, "labels"),
        PAUSE,
    ]
    flow_id, _ = run(events, ClusterError(f"{NAME} labels: the worker process died", "run again"))

    def stage_states() -> list[tuple[str, str]]:
        nodes = [
            node for _, node in ask(f"{server.api_url}/flow_runs/{flow_id}/graph-v2")["nodes"] if node["label"] != NAME
        ]
        return [(node["label"], node["state_type"]) for node in sorted(nodes, key=lambda node: node["start_time"])]

    expected = [("labels", "CRASHED"), ("survey", "COMPLETED"), ("labels", "FAILED")]
    until(lambda: stage_states() == expected)


def test_warnings_are_logged_and_progress_moves_one_bar() -> None:
    frames = StageRecord("frames", "k", False, 2.5, {"frames": 300}, (StageWarning("the camera moved", "camera"),))
    events: list[Event | float] = [
        StageStarted(NAME, "frames"),
        StageProgress(NAME, "frames", 150, 300, 1.0, share=0.25),
        StageProgress("other/front", "labels", 1, 2, 1.0),
        *end_events(NAME, frames),
    ]
    _, state = run(events[:2], ValueError("broken"))
    assert state.is_failed()
    assert until(progress_bars) == [(25.0, "frames")], "the progress of what failed stays where it was"
    _, state = run(events)
    lines = until(lambda: [line for line in log_lines(state.result()) if "Finished" not in line])
    assert lines == [f"{NAME}: the camera moved"], "stages are on the timeline and need no line in the log"
    bars = [(25.0, "frames"), (100.0, "done")]
    until(lambda: sorted(progress_bars()) == bars)


def test_the_end_of_a_stage_has_its_frames_and_warnings() -> None:
    ended, warning = end_events(
        NAME, StageRecord("frames", "k", True, 0.1, {"frames": 300}, (StageWarning("dark", "camera"),))
    )
    assert ended == StageEnded(NAME, "frames", 0.1, cached=True, frames=300)
    assert warning == CaptureWarning(NAME, "dark", "frames")
