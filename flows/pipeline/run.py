"""A whole run: start server and cluster while the catalogue is read, run its flow, and summarise the result."""

import os
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from glint.flows.reporting.events import CaptureEnded, Message, Sink
from glint.flows.reporting.input_reading import reading_shown
from glint.flows.runtime import signals
from glint.flows.runtime.environment import start_forkserver
from glint.flows.runtime.prefect_server import Server, start_server
from glint.tasks.engine.imports import collection_paused

if TYPE_CHECKING:
    from glint.flows.object_captures import ObjectCaptures
    from glint.flows.results import ObjectResult, RunResult
    from glint.storage.locations.location import Location

PRELOADED = ("glint.tasks.pipeline", "glint.tasks.warm_up")
"""Modules that every worker imports before its first task."""


@dataclass(frozen=True, slots=True)
class Summary:
    """The run's result, and its page on the dashboard."""

    result: "RunResult"
    page: str


def run(
    catalogue: str | Path,
    store: str,
    console: Sink,
    *,
    only: Sequence[str] = (),
    scheduler: str | None = None,
    workers: int | None = None,
    rehash: bool = False,
    drift: float | None = None,
    adopt: bool = False,
) -> Summary:
    """Run a catalogue.

    drift: degrees of change of an object's normals against its last version above which a warning is given.
    adopt: continue objects that another catalogue has published.

    Raises:
        CatalogueError, InputError: the catalogue is unusable; RunningError: the server or the cluster is.
    """
    started = time.monotonic()
    console.emit(Message(f"reading {catalogue} and what {store} holds of it"))
    with collection_paused():
        from glint.flows.object_captures import ObjectCaptures
        from glint.flows.results import RunResult
        from glint.storage.locations.conditional_writes import check_conditional_writes
        from glint.storage.locations.location import Location
        from glint.tasks.engine.references import chosen_captures, load_catalogue

    location, loaded = Location.parse(store), load_catalogue(catalogue)
    chosen = chosen_captures(loaded.objects, only)
    check_conditional_writes(location)
    server = start_server()
    _warn_of_full_disk(location, chosen, console)
    objects = (
        ObjectCaptures.of(loaded, str(catalogue), object_id, captures, location.uri, run="", rehash=rehash, adopt=adopt)
        for object_id, captures in chosen.items()
    )
    unchanged, busy = _unchanged_objects(objects, workers, scheduler, console)
    if not busy:
        _show_notice(server, console)
        return Summary(RunResult("", tuple(unchanged.values()), time.monotonic() - started), server.link())
    arguments = str(catalogue), store, only, rehash, drift, adopt
    result = _run_flow(arguments, server, console, scheduler, workers, busy, unchanged)
    return Summary(result, server.link(f"runs/flow-run/{result.run}"))


def _warn_of_full_disk(location: "Location", chosen: Mapping[str, Sequence[str]], console: Sink) -> None:
    """Warn if the captures that are new to the store may not fit on its disk; chosen: capture ids by object."""
    from glint.storage.maintenance.disk_space import DISK_SPACE_REMEDY, absent_objects, disk_space

    space = disk_space(location)
    new = 0 if space is None else sum(len(chosen[object_id]) for object_id in absent_objects(location, chosen))
    if space is not None and (warning := space.warning(new)):
        console.emit(Message(f"{warning}: {DISK_SPACE_REMEDY}"))


def _unchanged_objects(
    objects: Iterable["ObjectCaptures"], workers: int | None, scheduler: str | None, console: Sink
) -> tuple[dict[str, "ObjectResult"], int]:
    """Report objects that need no processing; return their results, and how many workers the others can keep busy."""
    from glint.flows.object_captures import unchanged_objects

    def report(result: "ObjectResult") -> None:
        signals.raise_if_interrupted()
        for capture in result.captures:
            console.emit(CaptureEnded(capture.name, 0.0, cached=True))

    def prepare() -> None:
        # The process that workers are forked from imports their modules while this one reads and imports the rest.
        if scheduler is None:
            start_forkserver()

    with reading_shown(console.emit):
        return unchanged_objects(objects, workers or os.cpu_count() or 1, report, prepare)


def _run_flow(
    arguments: tuple[Any, ...],
    server: Server,
    console: Sink,
    scheduler: str | None,
    workers: int | None,
    busy: int,
    unchanged: Mapping[str, "ObjectResult"],
) -> "RunResult":
    """Start or join a cluster, and run the flow of the catalogue on it, reported to the server.

    arguments: of `run_whole_catalogue`. scheduler: address of a running one, None for a local cluster of `workers`
    processes (None: one per processor), or of `busy` if no more have work. unchanged: results of objects that need no
    processing.
    """
    awaited = ["the dashboard's server"] * server.started + ["worker processes"] * (scheduler is None)
    console.emit(Message(f"starting {' and '.join(awaited) or 'the run'}"))
    with collection_paused():
        from glint.flows.runtime.dask_cluster import CPU_COUNT, Cluster

    with Cluster(scheduler, min(busy, workers or CPU_COUNT), PRELOADED) as cluster:
        # The cluster starts meanwhile.
        with collection_paused():
            from glint.flows.pipeline.catalogue import run_whole_catalogue
            from glint.flows.pipeline.context import activate
            from glint.flows.runtime.orphaned_runs import mark_orphaned_crashed, mark_own_crashed, tagged_with_process
            from glint.flows.runtime.retry import retry_on_disconnect

        server.wait()
        _show_notice(server, console)
        with server.connected(), tagged_with_process():
            mark_orphaned_crashed()
            signals.raise_if_interrupted()
            console.emit(Message(f"dashboard {server.link()}, {cluster.description}"))
            with activate(cluster.client, console, unchanged=unchanged):
                result = retry_on_disconnect(run_whole_catalogue, *arguments)
            mark_own_crashed()
        _show_notice(server, console)
    return result


def _show_notice(server: Server, console: Sink) -> None:
    if notice := server.notice():
        console.emit(Message(notice))
