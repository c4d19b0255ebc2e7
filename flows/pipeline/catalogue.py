"""The flow of a catalogue: its objects side by side, each a flow run of its own; unchanged objects are skipped."""

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from prefect import flow, runtime
from prefect.client.schemas.objects import State

from glint.flows.errors import USER_ERRORS
from glint.flows.pipeline.context import run_context
from glint.flows.pipeline.object import ObjectCaptures, failed_object, run_object, submit, up_to_date
from glint.flows.pipeline.preflight import report_input_errors
from glint.flows.reporting.artifacts import create_catalogue_artifact
from glint.flows.reporting.events import CaptureEnded
from glint.flows.results import ObjectResult, RunResult, final_state, result_of
from glint.flows.runtime.retry import retry_on_disconnect
from glint.storage.locations.location import Location
from glint.tasks.engine.references import chosen_captures, load_catalogue

STAGGER_SECONDS = 0.3
"""Delay between the first flow runs. SQLite rejects one of two concurrent writers, and its client then backs off for
two seconds."""


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
    report_input_errors(loaded, chosen, context)
    max_objects = context.max_captures
    with ThreadPoolExecutor(max_objects) as pool:
        futures = []
        for object_id, capture_ids in chosen.items():
            captures = ObjectCaptures.of(loaded, catalogue, object_id, capture_ids, store, run, rehash, adopt)
            futures.append(submit(pool, run_or_skip, captures, drift))
            if len(futures) < max_objects:
                time.sleep(STAGGER_SECONDS)
        try:
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


def _summary(result: RunResult) -> str:
    """Return one line about a run without failures."""
    up_to_date = sum(capture.cached for capture in result.captures)
    changed = f", {len(result.drifts)} changed" if result.drifts else ""
    return (
        f"{len(result.captures)} captures: {len(result.captures) - up_to_date} done, {up_to_date} up to date{changed}"
    )
