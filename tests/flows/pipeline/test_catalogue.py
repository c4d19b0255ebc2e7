"""The flow of a catalogue on a real server and cluster: a run for each object, truthful ends, nothing for unchanged."""

import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from uuid import UUID

import pytest
from prefect.client.orchestration import get_client
from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterId, FlowRunFilterParentFlowRunId
from prefect.client.schemas.objects import FlowRun

import glint.flows.object_captures
import glint.flows.pipeline.capture
from glint.flows.pipeline.catalogue import run_catalogue
from glint.flows.pipeline.context import activate
from glint.flows.pipeline.dispatch import Capacity
from glint.flows.reporting.events import CaptureEnded, CaptureWarning, Event, StageEnded
from glint.flows.results import RunResult
from glint.flows.runtime.dask_cluster import Cluster
from glint.storage.catalogue.loading import Catalogue, load, write
from glint.storage.errors import StoreError
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from glint.tasks.code_provenance import code_provenance
from glint.tasks.engine.stage import StageRecord
from glint.tasks.pipeline import STAGES
from tests.flows.recording_sink import RecordingSink
from tests.polling import until
from tests.prefect_api import ask

pytestmark = [pytest.mark.server, pytest.mark.usefixtures("server")]
Run = Callable[..., tuple[Any, list[Event]]]
QUICK = {"labels": {"method": "winner"}}
"""Labels in a tenth of the time: runs are what is tested here; one is with the usual labels."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, tiny: Path) -> Path:
    """Catalogues `good` (objects a, b), `mixed` (a whole, c with a bad capture) and `bad` (g/bad alone)."""
    place = tmp_path_factory.mktemp("catalogues")
    good = load(tiny).objects[0]
    capture = good.captures[0]
    missing = capture.model_copy(update={"id": "bad", "frames": str(place / "missing.mp4")})

    def catalogue(name: str, objects: dict[str, tuple[Any, ...]], parameters: dict[str, Any] | None = None) -> None:
        entries = [good.model_copy(update={"id": each, "captures": captures}) for each, captures in objects.items()]
        said = {
            "schema": 1,
            "name": name,
            "objects": entries,
            "parameters": QUICK if parameters is None else parameters,
        }
        write(Catalogue.model_validate(said), place / f"{name}.yaml")

    catalogue("good", {"a": (capture,), "b": (capture,)})
    catalogue("mixed", {"a": (capture,), "c": (capture, missing)})
    catalogue("bad", {"g": (missing,)})
    catalogue("large", {"d": (capture,)})
    catalogue("changed", {"a": (capture,)}, {"labels": {"method": "paper"}})
    catalogue("alone", {"e": (capture,)}, {})
    catalogue("crowded", {"f": (capture,)})
    return place


@pytest.fixture
def run(folder: Path, cluster: Cluster) -> Run:
    """Run a catalogue by its name: the final state, and what was shown."""

    def run_it(name: str, **options: Any) -> tuple[Any, list[Event]]:
        sink = RecordingSink()
        path, store = str(folder / f"{name}.yaml"), str(folder / "store")
        with activate(cluster.client, sink):
            return run_catalogue(path, name, store, return_state=True, **options), sink.events

    return run_it


def result_of(state: Any) -> RunResult:
    result = state.result(raise_on_failure=False)
    assert isinstance(result, RunResult)
    return result


def children(parent: str) -> dict[str, FlowRun]:
    """Flow runs below another by their names."""
    with get_client(sync_client=True) as client:
        chosen = FlowRunFilter(parent_flow_run_id=FlowRunFilterParentFlowRunId(any_=[UUID(parent)]))
        return {each.name: each for each in client.read_flow_runs(flow_run_filter=chosen)}


def task_runs(flow_run: str, count: int) -> set[str]:
    """Return the names of a flow run's task runs, captures and stages, once the server has recorded so many."""
    chosen = FlowRunFilter(id=FlowRunFilterId(any_=[UUID(flow_run)]))
    with get_client(sync_client=True) as client:
        until(lambda: len(client.read_task_runs(flow_run_filter=chosen)) >= count)
        return {run.name for run in client.read_task_runs(flow_run_filter=chosen)}


def told_events(name: str) -> list[dict[str, Any]]:
    """Payloads of the events of that name, once the server has them."""
    url = f"{os.environ['PREFECT_API_URL']}/events/filter"
    found = until(lambda: ask(url, {"filter": {"event": {"name": [name]}}})["events"])
    return [each["payload"] for each in found]


def test_every_object_is_a_run_with_its_captures_in_it(run: Run) -> None:
    state, events = run("good")
    assert state.is_completed() and "2 captures: 2 done" in state.message
    objects = children(result_of(state).run)
    assert set(objects) == {"a", "b"}
    assert task_runs(str(objects["a"].id), 1 + len(STAGES)) == {"a/front", *(stage.name for stage in STAGES)}
    assert {each.state.type.value for each in objects.values() if each.state} == {"COMPLETED"}
    assert len(str(objects["a"].parameters)) < 2000, "parameters name the catalogue and hold none of it"
    assert [event.kind for event in events].count("capture") == 2


def counted_tasks(workers: Mapping[str, Any]) -> dict[str, Any]:
    """The tasks that workers have done or hold; a worker that starts meanwhile has none."""
    counts = {name: worker["metrics"]["task_counts"] for name, worker in workers.items()}
    return {name: count for name, count in counts.items() if count}


def test_an_unchanged_catalogue_needs_no_run_no_worker_and_no_footage(run: Run, cluster: Cluster) -> None:
    run("good")
    before = cluster.client.scheduler_info(n_workers=-1)["workers"]
    state, events = run("good")
    result = result_of(state)
    assert state.is_completed() and "0 done, 2 up to date" in state.message
    assert children(result.run) == {}
    assert [event.cached for event in events if isinstance(event, CaptureEnded)] == [True, True] and len(events) == 2
    assert all(each.cached and len(each.records) == len(STAGES) for each in result.captures)
    after = cluster.client.scheduler_info(n_workers=-1)["workers"]
    assert counted_tasks(after) == counted_tasks(before)
    assert result.captures[0].count("frames", "frames") == 150


def test_a_run_with_failures_says_how_many_and_why(run: Run, folder: Path) -> None:
    state, _ = run("mixed")
    assert state.is_failed() and state.name == "PartiallyCompleted"
    assert state.message.startswith("1 of 3 captures failed; c/bad:") and "missing.mp4" in state.message
    objects = children(result_of(state).run)
    assert "a" not in objects, "what has not changed is passed even when others fail"
    assert objects["c"].state is not None and objects["c"].state.name == "PartiallyCompleted"
    version = ObjectRepository.open(Location.parse(folder / "store"), "c", create=False).version()
    assert set(version.stages) == {"front"}


def test_a_run_of_which_nothing_succeeds_has_failed(run: Run) -> None:
    state, _ = run("bad")
    assert state.is_failed() and state.name == "Failed"
    (failed,) = result_of(state).failed
    assert "missing.mp4" in failed.error and failed.remedy


def test_a_capture_too_large_for_the_workers_is_refused_up_front(
    run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("glint.flows.pipeline.capture.capacity", lambda client: Capacity(2, 1 << 20))
    state, events = run("large")
    (failed,) = result_of(state).failed
    assert re.match(r"\w+ of d/front needs .* in one process, its workers have 1\.00 MiB", failed.error)
    assert "region" in failed.remedy
    assert [event.stage for event in events if isinstance(event, StageEnded)] == ["survey"]


@pytest.mark.parametrize(("name", "workers", "spread"), [("alone", 2, 1), ("crowded", 1, 0)])
def test_clusters_go_to_all_workers_where_some_are_idle(
    run: Run, monkeypatch: pytest.MonkeyPatch, name: str, workers: int, spread: int
) -> None:
    calls, on_all_workers = [], glint.flows.pipeline.capture.on_all_workers

    def counted(*facts: Any) -> StageRecord:
        calls.append(1)
        return on_all_workers(*facts)

    monkeypatch.setattr(glint.flows.pipeline.capture, "on_all_workers", counted)
    monkeypatch.setattr(glint.flows.pipeline.capture, "capacity", lambda client: Capacity(workers, None))
    state, events = run(name)
    (done,) = result_of(state).captures
    assert [each.stage for each in done.records] == [each.name for each in STAGES] and len(calls) == spread
    assert [event.stage for event in events if isinstance(event, StageEnded)] == [stage.name for stage in STAGES]


def test_a_surface_that_moves_too_far_is_reported(run: Run, folder: Path) -> None:
    run("good")
    state, events = run("changed", drift=0.01)
    (moved,) = result_of(state).drifts
    assert state.is_completed() and moved.degrees > 0.01 and (moved.object_id, moved.capture_id) == ("a", "front")
    assert any(isinstance(event, CaptureWarning) and "moved" in event.text for event in events)
    assert told_events("glint.drift")[0]["object"] == "a"
    assert result_of(run("good", drift=179.0)[0]).drifts == []


def test_a_version_tells_everything_needed_to_repeat_it(run: Run, folder: Path) -> None:
    run("good")
    version = ObjectRepository.open(Location.parse(folder / "store"), "b", create=False).version()
    said = version.metadata
    assert said["run"] and said["catalogue"] == str(folder / "good.yaml")
    assert {name: said[name] for name in code_provenance()} == code_provenance() and len(said["source"]) == 64
    capture = said["captures"]["front"]
    assert set(capture["parameters"]) >= {"clusters", "labels", "depth"} and len(capture["inputs"]["frames"]) == 64
    assert capture["entry"]["frames"].endswith(".mp4")
    assert said["packages"]["numpy"] and said["python"].startswith("3.")


def test_what_cannot_be_foreseen_stays_with_its_object(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:

    def broken(works: Any) -> None:
        if works[0].object_id == "a":
            raise RuntimeError("nobody thought of this")
        raise StoreError("the store is away", "wait")

    monkeypatch.setattr(glint.flows.object_captures, "up_to_date_records", broken)
    state, _ = run("good")
    result = result_of(state)
    assert [each.object_id for each in result.failed] == ["a"] and "nobody thought" in result.failed[0].error
