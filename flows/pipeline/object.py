"""The flow of one object: its captures side by side, its model, and a version of what succeeded."""

import contextvars
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any

from prefect import flow, runtime
from prefect.client.schemas.objects import State
from prefect.utilities.annotations import quote

from glint.flows.errors import USER_ERRORS, message_and_remedy
from glint.flows.object_captures import ObjectCaptures
from glint.flows.pipeline.capture import process_capture
from glint.flows.pipeline.context import run_context
from glint.flows.pipeline.dispatch import task_key, wait_for
from glint.flows.pipeline.drift import report_drifts
from glint.flows.pipeline.model import process_model
from glint.flows.pipeline.worker import SURVEY, compare_captures, publish_captures
from glint.flows.reporting.events import CaptureEnded, CaptureFailed, CaptureWarning, Message
from glint.flows.results import CaptureResult, ObjectResult, final_state, without_models
from glint.flows.runtime.orphaned_runs import untagged_tasks
from glint.storage.catalogue.models import MODEL
from glint.storage.locking.locks import run_lock
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.errors import SPHERE_ERRORS
from glint.tasks.engine.references import load_catalogue
from glint.tasks.engine.stage import StageRecord
from glint.tasks.model.model_key import wants_model
from glint.tasks.publish import check_catalogue
from glint.tasks.version_diff import Drift, drifts

MAX_THREADS = 32
"""Captures of an object that may wait for a slot, each in a thread."""


@flow(name="object", flow_run_name="{object_id}", validate_parameters=False, persist_result=False)
def run_object(
    catalogue: str,
    object_id: str,
    store: str,
    captures: Sequence[str] = (),
    run: str = "",
    rehash: bool = False,
    drift: float | None = None,
    adopt: bool = False,
) -> State[ObjectResult]:
    """Process an object's captures (none named: all) and publish those that succeed as its next version.

    run: name of the whole run, by default this flow run's; drift: degrees of change against the last version above
    which a warning is given; adopt: continue an object of another catalogue. The flow run fails if a capture does; the
    other captures are published nevertheless.
    """
    run = run or str(runtime.flow_run.id)
    loaded = load_catalogue(catalogue)
    chosen = ObjectCaptures.of(loaded, catalogue, object_id, captures, store, run=run, rehash=rehash, adopt=adopt)
    result = process_object(chosen, drift)
    n_captures = len(without_models(result.captures))
    done = "nothing" if result.version is None else f"{result.version.name}: {n_captures} captures"
    return final_state(list(result.captures), done, result)


def process_object(captures: ObjectCaptures, drift: float | None) -> ObjectResult:
    """Process captures of one object under its lock, and publish those that succeeded as a version."""
    first = captures.chosen[0]
    try:
        with run_lock(first.location, first.object_id, first.run):
            captures = captures.with_edits()
            for context in captures.chosen:
                if context.edits is not None:
                    text = f"edited by a person: {context.edits}; edit {context.edits.revision}"
                    run_context().emit(Message(text, context.name))
            if not captures.adopt:
                check_catalogue(captures.all, captures.catalogue)
            results = with_agreement(captures, run_captures(captures))
            completed = [context for context, result in zip(captures.chosen, results, strict=True) if not result.error]
            if not completed:
                return ObjectResult(first.object_id, results)
            has_model = wants_model(captures.all)
            if has_model:
                results += (run_model(captures.all),)
            with_model = has_model and not results[-1].error
            arguments = completed, first.run, captures.catalogue, with_model
            version = on_worker(first.object_id, "version", publish_captures, *arguments)
            changes = list[Drift]() if drift is None or not version.created else compared(first, version.name, drift)
            return ObjectResult(first.object_id, results, version, tuple(changes))
    except USER_ERRORS as error:
        return failed_object(captures, error)


def compared(context: CaptureContext, version: str, drift: float) -> list[Drift]:
    """Report what changed by more than `drift` degrees since the version before; a failure leaves the new one as is."""
    names = context.repository.version_names()
    if len(names) < 2:
        return []
    try:
        changes = drifts(context.repository, names[-2], version, drift)
        report_drifts(changes, drift)
    except USER_ERRORS as error:
        message, remedy = message_and_remedy(error)
        text = f"{version} is published but was not compared with {names[-2]}: {message}: {remedy}"
        run_context().emit(CaptureWarning(context.object_id, text))
        return []
    return changes


def run_captures(captures: ObjectCaptures) -> tuple[CaptureResult, ...]:
    """Process the chosen captures side by side, each as soon as the run has a slot for it."""

    def run_capture(capture: CaptureContext) -> CaptureResult:
        # The slot comes first: a capture that waits for one is not yet a running task on the dashboard.
        with run_context().slot(capture.name):
            # Prefect looks for other runs in all that a task is given, unless it is quoted.
            process = partial(process_capture, capture.name, quote(capture), captures.n_captures)
            return run_reported(capture.object_id, capture.capture.id, process)

    with ThreadPoolExecutor(min(len(captures.chosen), MAX_THREADS)) as pool:
        try:
            futures = [submit(pool, run_capture, capture) for capture in captures.chosen]
            return tuple(future.result() for future in futures)
        except BaseException as end:
            pool.shutdown(wait=False, cancel_futures=True)
            if not isinstance(end, Exception):  # a deployment runs objects in the main thread, which is interrupted
                run_context().cancel()
            raise


def with_agreement(captures: ObjectCaptures, results: Sequence[CaptureResult]) -> tuple[CaptureResult, ...]:
    """Return the results of an object's chosen captures with what spheres and scales of its others say of theirs.

    A warning is added to the survey's, and a capture that failed for its sphere is offered those of the others.
    """
    failed = {result.capture_id for result in results if result.error}
    if len(captures.all) - len(failed) < 2:
        return tuple(results)
    without_sphere = {result.capture_id for result in results if result.failed_for_sphere}
    warnings, offers = on_worker(
        captures.object_id, "agreement", compare_captures, captures.all, failed, without_sphere
    )
    agreed = list[CaptureResult]()
    for result in results:
        own, offer = warnings.get(result.capture_id, []), offers.get(result.capture_id, "")
        for text in [warning.message for warning in own] + [offer] * bool(offer):
            run_context().emit(CaptureWarning(result.name, text, SURVEY.name))
        records = (
            replace(record, warnings=(*record.warnings, *own)) if record.stage == SURVEY.name else record
            for record in result.records
        )
        remedy = f"{result.remedy}; {offer}" if offer else result.remedy
        agreed.append(replace(result, records=tuple(records), remedy=remedy))
    return tuple(agreed)


def run_model(captures: Sequence[CaptureContext]) -> CaptureResult:
    """Merge the views of an object; a failure is the model's alone, the captures are published nevertheless."""
    object_id = captures[0].object_id
    return run_reported(object_id, MODEL, partial(process_model, captures, f"{object_id}/{MODEL}"))


def on_worker[**P, R](object_id: str, name: str, function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """Have a worker run a function for an object; name: what it does, on Dask's dashboard.

    Raises:
        ClusterError: its worker died twice; else what the function raises.
    """
    context = run_context()
    with context.cancellable():
        future = context.client.submit(function, *args, **kwargs, pure=False, key=task_key(object_id, name))
        result: R = wait_for(future, object_id)
    return result


def run_reported(object_id: str, capture_id: str, process: Callable[[], Sequence[StageRecord]]) -> CaptureResult:
    """Run the task of a capture or model, and report its end; an error becomes part of the result.

    Raises:
        CancelledError: the run was cancelled.
    """
    context, started = run_context(), time.monotonic()
    records, error, remedy, failed_for_sphere = tuple[StageRecord, ...](), "", "", False
    try:
        with untagged_tasks():
            records = tuple(process())
    except Exception as failure:
        context.raise_if_cancelled()
        error, remedy = message_and_remedy(failure)
        failed_for_sphere = isinstance(failure, SPHERE_ERRORS)
    seconds = time.monotonic() - started
    result = CaptureResult(object_id, capture_id, seconds, records, error, remedy, failed_for_sphere)
    if error:
        context.emit(CaptureFailed(result.name, f"{error}: {remedy}"))
    else:
        context.emit(CaptureEnded(result.name, result.seconds, result.cached))
    return result


def failed_object(captures: ObjectCaptures, failure: Exception) -> ObjectResult:
    """Return the result of an object none of whose captures could be processed or published."""
    error, remedy = message_and_remedy(failure)
    results = tuple(
        CaptureResult(object_id, capture_id, 0.0, (), error, remedy) for object_id, capture_id in captures.ids
    )
    for result in results:
        run_context().emit(CaptureFailed(result.name, f"{error}: {remedy}"))
    return ObjectResult(captures.object_id, results)


def submit[**P, R](pool: ThreadPoolExecutor, function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> Future[R]:
    """Run a function in a thread that has the run context and the flow run of this one."""
    call: Callable[[], Any] = partial(function, *args, **kwargs)
    return pool.submit(contextvars.copy_context().run, call)
