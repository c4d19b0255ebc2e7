"""Flows that a worker of Prefect runs by itself: what is new in an inbox, the reference captures, objects on demand.

They find or start what `glint run` would: a Dask scheduler by its address, else a local cluster in their own process.
`glint deploy` puts them on a server with their schedules.
"""

import contextvars
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from datetime import timedelta
from typing import Any

from prefect import flow, get_run_logger, runtime
from prefect.artifacts import create_markdown_artifact, create_table_artifact
from prefect.client.orchestration import get_client
from prefect.client.schemas.objects import FlowRun, State
from prefect.deployments import run_deployment
from prefect.states import Completed, Failed

from glint.flows.cli.evaluate import evaluations_of
from glint.flows.deployments.inbox import Batch, Inbox, News
from glint.flows.pipeline.catalogue import run_whole_catalogue
from glint.flows.pipeline.context import activate
from glint.flows.pipeline.object import run_object
from glint.flows.pipeline.run import PRELOADED
from glint.flows.reporting.artifacts import artifact_key, plain
from glint.flows.runtime.dask_cluster import Cluster
from glint.flows.runtime.environment import prepare_environment
from glint.flows.runtime.orphaned_runs import RUN_TAG, mark_orphaned_crashed, process_tag, tagged_with_process
from glint.storage.locations.location import Location
from glint.storage.locations.probe import probe
from glint.tasks.engine.references import chosen_captures, load_catalogue

APART = 16
"""Objects that are asked for at the same time; the deployment's own limit says how many of them run."""


@flow(name="inbox", flow_run_name="{inbox}", validate_parameters=False, persist_result=False)
def watch_inbox(
    inbox: str,
    store: str,
    scheduler: str | None = None,
    workers: int | None = None,
    settled_minutes: float = 10.0,
    drift: float | None = None,
    apart: bool = False,
) -> State[None]:
    """Run what is new or changed in an inbox, a folder or prefix of sub-folders.

    settled_minutes: a sub-folder that changed later than so long ago is left for the next time; drift: degrees by
    which normals may move unannounced; apart: each object by `one-object/on-demand`, to be cancelled by itself.
    """
    mark_this_run()
    place = Inbox(inbox, store)
    news = place.news(timedelta(minutes=settled_minutes))
    told = {name: f"cannot be run: {problem}" for name, problem in news.problems.items()}
    if news.batches:
        with working(store, scheduler, workers):
            for batch in news.batches:
                failed = _run_batch(batch, store, scheduler, drift, apart)
                told |= {batch.arrivals[each].name: why for each, why in failed.items()}
                # A sub-folder of several objects is finished when all of them are.
                place.finish([each for each in batch.arrivals.values() if each.name not in told])
    _tell_news(inbox, news, told)
    done = sum(len(batch.arrivals) for batch in news.batches)
    if told:
        name, why = next(iter(told.items()))
        return Failed(message=f"{len(told)} sub-folders failed; {name}: {why}")
    return Completed(message=f"{done} objects run, {news.unchanged} unchanged, {len(news.waiting)} still arriving")


@flow(name="reference", flow_run_name="{catalogue}", validate_parameters=False, persist_result=False)
def evaluate_reference(
    catalogue: str,
    store: str,
    scheduler: str | None = None,
    workers: int | None = None,
    drift: float = 0.5,
) -> State[None]:
    """Run a catalogue whose truth is known, reading all its files again, and judge what it gives."""
    mark_this_run()
    with working(store, scheduler, workers):
        result = run_whole_catalogue(catalogue, store, rehash=True, drift=drift)
        evaluations = evaluations_of(catalogue, Location.parse(store).uri, result, lambda event: None)
    if evaluations:
        from glint.tasks.evaluation.report import markdown

        create_markdown_artifact(markdown(evaluations), key=artifact_key(f"evaluation {catalogue}"))
    if result.failed:
        first = result.failed[0]
        return Failed(message=f"{len(result.failed)} captures failed; {first.name}: {first.error} -> {first.remedy}")
    moved = f", {len(result.drifts)} moved" if result.drifts else ""
    return Completed(message=f"{len(evaluations)} captures judged{moved}")


@flow(name="one-object", flow_run_name="{object_id}", validate_parameters=False, persist_result=False)
def run_one(
    catalogue: str,
    object_id: str,
    store: str,
    scheduler: str | None = None,
    workers: int | None = None,
    captures: Sequence[str] = (),
    drift: float | None = None,
) -> State[None]:
    """Run one object of a catalogue, or some of its captures."""
    mark_this_run()
    with working(store, scheduler, workers):
        place = Location.parse(store).uri
        state: State[Any] = run_object(
            Location.parse(catalogue).uri,
            object_id,
            place,
            captures=list(captures),
            drift=drift,
            return_state=True,
        )
    if state.is_completed():
        return Completed(message=state.message)
    return Failed(message=state.message, name=state.name)


@flow(name="all-objects", flow_run_name="{catalogue}", validate_parameters=False, persist_result=False)
def run_apart(
    catalogue: str, store: str, scheduler: str | None = None, only: Sequence[str] = (), drift: float | None = None
) -> State[None]:
    """Run each object of a catalogue as a flow run of `one-object/on-demand`, cancelled and retried by itself."""
    mark_this_run()
    chosen = chosen_captures(load_catalogue(catalogue).objects, only)
    failed = _ask_for(catalogue, chosen, store, scheduler, drift)
    if failed:
        name, why = next(iter(failed.items()))
        return Failed(message=f"{len(failed)} of {len(chosen)} objects failed; {name}: {why}")
    return Completed(message=f"{len(chosen)} objects")


@contextmanager
def working(store: str, scheduler: str | None, workers: int | None) -> Iterator[None]:
    """A store that was tried and a cluster, for flows that are called inside.

    Raises:
        StoreError, ClusterError: one of them cannot be used.
    """
    prepare_environment()
    probe(Location.parse(store))
    mark_orphaned_crashed()
    with Cluster(scheduler, workers, PRELOADED) as cluster, tagged_with_process(), activate(cluster.client):
        get_run_logger().info(cluster.description)
        yield


def mark_this_run() -> None:
    """Tag this flow run with its process, so that it can be told dead (see `flows.zombies`)."""
    identity = runtime.flow_run.id
    if identity:
        with get_client(sync_client=True) as client:
            client.update_flow_run(identity, tags=sorted({*runtime.flow_run.tags, RUN_TAG, process_tag()}))


def _run_batch(batch: Batch, store: str, scheduler: str | None, drift: float | None, apart: bool) -> dict[str, str]:
    """Run a batch's objects; what is wrong with those that gave no whole version, by object."""
    if apart:
        return _ask_for(batch.catalogue, list(batch.arrivals), store, scheduler, drift)
    result = run_whole_catalogue(batch.catalogue, store, list(batch.arrivals), drift=drift)
    return {each.object_id: f"{each.name}: {each.error} -> {each.remedy}" for each in reversed(result.failed)}


def _ask_for(
    catalogue: str, objects: Sequence[str] | dict[str, list[str]], store: str, scheduler: str | None,
    drift: float | None,
) -> dict[str, str]:  # fmt: skip
    """Have objects run by the deployment, and wait; what is wrong with those that failed."""

    def ask(object_id: str) -> tuple[str, FlowRun]:
        parameters = {
            "catalogue": Location.parse(catalogue).uri,
            "object_id": object_id,
            "store": Location.parse(store).uri,
            "scheduler": scheduler,
            "captures": objects[object_id] if isinstance(objects, dict) else [],
            "drift": drift,
        }
        found: Any = run_deployment("one-object/on-demand", parameters=parameters, flow_run_name=object_id)
        return object_id, found

    call: Callable[[str], tuple[str, FlowRun]] = ask
    with ThreadPoolExecutor(APART) as pool:
        ended = list(pool.map(lambda name: contextvars.copy_context().run(call, name), objects))
    return {
        name: f"{run.state.name}: {run.state.message or 'see its flow run'}" if run.state else "it has no state"
        for name, run in ended
        if run.state is None or not run.state.is_completed()
    }


def _tell_news(inbox: str, news: News, failed: dict[str, str]) -> None:
    """A table of every sub-folder that is not simply as it was."""
    rows = [
        {"sub-folder": arrival.name, "object": name, "result": failed.get(arrival.name, "done")}
        for batch in news.batches
        for name, arrival in batch.arrivals.items()
    ]
    rows += [{"sub-folder": name, "object": "", "result": failed[name]} for name in news.problems]
    rows += [{"sub-folder": name, "object": "", "result": "still arriving: next time"} for name in news.waiting]
    rows += [{"sub-folder": name, "object": "", "result": "no footage in it"} for name in news.empty]
    create_table_artifact(rows, key=artifact_key(f"inbox {inbox}"), description=plain(inbox))
