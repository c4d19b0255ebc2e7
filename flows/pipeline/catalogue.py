"""The flow of a catalogue: its objects side by side, each a flow run of its own; unchanged objects are skipped."""

import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from contextvars import copy_context
from typing import Any

from prefect import flow, runtime
from prefect.client.schemas.objects import State

from glint.flows.errors import USER_ERRORS
from glint.flows.object_captures import ObjectCaptures, up_to_date
from glint.flows.pipeline.context import RunContext, run_context
from glint.flows.pipeline.object import failed_object, run_object, submit
from glint.flows.pipeline.preflight import report_input_errors
from glint.flows.reporting.artifacts import create_catalogue_artifact, show_run_progress
from glint.flows.reporting.events import CaptureEnded
from glint.flows.results import ObjectResult, RunResult, final_state, result_of, without_models
from glint.flows.runtime.retry import retry_on_disconnect
from glint.storage.locations.location import Location
from glint.tasks.engine.references import chosen_captures, load_catalogue

STAGGER_SECONDS = 0.3
"""Delay between the first flow runs. SQLite rejects one of two concurrent writers, and its client then backs off for
two seconds."""
RUN_PROGRESS_SECONDS = 5.0
"""Interval at which the dashboard shows how far the run is."""


def run_whole_catalogue(
    catalogue: str,
    store: str,
    only: Sequence[str] = (),
    rehash: bool = False,
    drift: float | None = None,
    adopt: bool = False,
) -> RunResult:
    """Run the flow of a catalogue in the current run context, and return its result.

    Raises:
        BaseException: what ended the flow run instead of a result.
    """
    address, name = Location.parse(catalogue).uri, load_catalogue(catalogue).name
    place = Location.parse(store).uri
    state: Any = run_catalogue(
        address, name, place, only=list(only), rehash=rehash, drift=drift, adopt=adopt, return_state=True
    )
    result: RunResult = result_of(state)
    return result


@flow(name="catalogue", flow_run_name="{name}", validate_parameters=False, persist_result=False)
def run_catalogue(
    catalogue: str,
    name: str,
    store: str,
    only: Sequence[str] = (),
    rehash: bool = False,
    drift: float | None = None,
    adopt: bool = False,
) -> State[RunResult]:
    """Process a catalogue, or those of its captures that `only` names (OBJECT or OBJECT/CAPTURE).

    drift: degrees of change against the last version above which a warning is given. adopt: continue objects that
    another catalogue has published.
    The flow run ends as Completed, PartiallyCompleted or Failed; its state says how many captures failed.
    """
    started, run, context = time.monotonic(), str(runtime.flow_run.id), run_context()
    loaded = load_catalogue(catalogue)
    chosen = chosen_captures(loaded.objects, only)
    report_input_errors(loaded, {name: ids for name, ids in chosen.items() if name not in context.unchanged}, context)
    names = [f"{object_id}/{capture_id}" for object_id, ids in chosen.items() for capture_id in ids]
    context.time_left.expect(names, [name for name in names if name.partition("/")[0] in context.unchanged])
    max_objects = context.max_captures
    with ThreadPoolExecutor(max_objects) as pool:
        futures = []
        try:
            for object_id, capture_ids in chosen.items():
                captures = ObjectCaptures.of(
                    loaded, catalogue, object_id, capture_ids, store, run=run, rehash=rehash, adopt=adopt
                )
                futures.append(submit(pool, run_or_skip, captures, drift))
                if len(futures) < max_objects and object_id not in context.unchanged:
                    time.sleep(STAGGER_SECONDS)
            with _progress_shown(context, name):
                objects = [future.result() for future in futures]
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            context.cancel()
            raise
    result = RunResult(run, tuple(objects), time.monotonic() - started)
    create_catalogue_artifact(name, result)
    return final_state(result.captures, _summary(result), result)


def run_or_skip(captures: ObjectCaptures, drift: float | None) -> ObjectResult:
    """Skip an object that is up to date, else run its flow; an error is this object's alone."""
    context = run_context()
    context.raise_if_cancelled()
    if captures.object_id in context.unchanged:
        return context.unchanged[captures.object_id]
    try:
        skipped = up_to_date(captures)
        if skipped is None:
            return retry_on_disconnect(_run, captures, drift)
    except USER_ERRORS as error:
        return failed_object(captures, error)
    except Exception as error:
        context.raise_if_cancelled()
        return failed_object(captures, error)
    for capture in skipped.captures:
        context.emit(CaptureEnded(capture.name, 0.0, cached=True))
    return skipped


def _run(captures: ObjectCaptures, drift: float | None) -> ObjectResult:
    first = captures.chosen[0]
    is_whole = len(captures.chosen) == len(captures.all)
    state: Any = run_object(
        captures.catalogue,
        first.object_id,
        first.store,
        captures=[] if is_whole else [context.capture.id for context in captures.chosen],
        run=first.run,
        rehash=first.rehash,
        drift=drift,
        adopt=captures.adopt,
        return_state=True,
    )
    result = result_of(state)
    if not isinstance(result, ObjectResult):
        raise RuntimeError(f"the flow run of {first.object_id} ended as {state.name}: {state.message}")
    return result


@contextmanager
def _progress_shown(context: RunContext, name: str) -> Iterator[None]:
    """Show on the dashboard how far the run is and how long it still takes, while the body runs.

    A thread of its own does it: a server that does not answer must not hold the run up.
    """
    ended = threading.Event()

    def show() -> None:
        bar: Any = None
        while not ended.wait(RUN_PROGRESS_SECONDS):
            with suppress(Exception):  # it is shown again with the next update
                bar = show_run_progress(bar, name, context.time_left.report())

    threading.Thread(target=copy_context().run, args=(show,), name="glint-run-progress", daemon=True).start()
    try:
        yield
    finally:
        ended.set()


def _summary(result: RunResult) -> str:
    """Return one line about a run without failures."""
    captures = without_models(result.captures)
    up_to_date = sum(capture.cached for capture in captures)
    changed = f", {len(result.drifts)} changed" if result.drifts else ""
    return f"{len(captures)} captures: {len(captures) - up_to_date} done, {up_to_date} up to date{changed}"
