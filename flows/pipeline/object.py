"""The flow of one object: its captures side by side, and a version of what succeeded."""

import contextvars
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any

from prefect import flow, runtime
from prefect.client.schemas.objects import State

from glint.flows.errors import DEFECT, REFUSALS
from glint.flows.pipeline.capture import capture
from glint.flows.pipeline.context import surroundings
from glint.flows.pipeline.drift import tell_drifts
from glint.flows.pipeline.model import work_on_model
from glint.flows.reporting.events import Event
from glint.flows.results import CaptureResult, ObjectResult, final_state
from glint.flows.runtime.retry import patiently
from glint.storage.locations.location import Location
from glint.storage.locking.locks import run_lock
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.references import CaptureReference, chosen_captures, load_catalogue
from glint.tasks.publish import publish
from glint.tasks.stages.model import wants_model
from glint.tasks.up_to_date import unchanged
from glint.tasks.version_diff import drifts

MOST_THREADS = 32
"""Captures of an object that may wait for their turn in a thread of their own."""


@flow(name="object", flow_run_name="{object_id}", validate_parameters=False, persist_result=False)
def run_object(
    catalogue: str,
    object_id: str,
    store: str,
    scheduler: str,
    captures: Sequence[str] = (),
    run: str = "",
    rehash: bool = False,
    drift: float | None = None,
) -> State[ObjectResult]:
    """Work on an object's captures (none named: all) and publish those that succeed as its next version.

    run: name of the whole run, by default this flow run's; drift: degrees by which normals may move unannounced.
    The flow run ends as failed when a capture does; what the others gave is a version all the same.
    """
    run = run or str(runtime.flow_run.id)
    references = references_of(catalogue, object_id, store, captures, run, rehash)
    result = work_on_object(references, scheduler, drift)
    done = "nothing" if result.version is None else f"{result.version.name}: {len(result.captures)} captures"
    return final_state(list(result.captures), done, result)


def references_of(
    catalogue: str, object_id: str, store: str, captures: Sequence[str], run: str, rehash: bool
) -> list[CaptureReference]:
    """The captures of an object by reference; none named: all.

    Raises:
        CatalogueError, InputError: the catalogue is unusable, or has none of that name.
    """
    objects, only = load_catalogue(catalogue).objects, [f"{object_id}/{each}" for each in captures] or [object_id]
    chosen = chosen_captures([each for each in objects if each.id == object_id] or objects, only)[object_id]
    return [CaptureReference(catalogue, object_id, each, store, run, rehash) for each in chosen]


def unchanged_object(references: Sequence[CaptureReference]) -> ObjectResult | None:
    """The result of an object on which nothing is to be done; None where something is, or cannot be read."""
    try:
        found = unchanged([each.workspace() for each in references])
    except REFUSALS:
        return None
    if found is None:
        return None
    version, records = found
    captures = (CaptureResult(each.object_id, each.capture_id, 0.0, records[each.capture_id]) for each in references)
    return ObjectResult(references[0].object_id, tuple(captures), version)


def work_on_object(references: Sequence[CaptureReference], scheduler: str, drift: float | None) -> ObjectResult:
    """Work on captures of one object, alone, and publish those that succeeded as a version."""
    first, here = references[0], surroundings(scheduler)
    captures: tuple[CaptureResult, ...] = ()
    try:
        with (
            run_lock(Location.parse(first.store), first.object_id, first.run),
            ThreadPoolExecutor(min(len(references), MOST_THREADS)) as pool,
        ):
            futures = [submit(pool, work_on_capture, each, scheduler) for each in references]
            captures = tuple(future.result() for future in futures)
            done = [one for one, each in zip(references, captures, strict=True) if not each.error]
            if not done:
                return ObjectResult(first.object_id, captures)
            works = [one.workspace() for one in done]
            every = all_works(first)
            if wants_model(every):
                captures += (work_on_model(every, scheduler),)
            version = publish(works, first.run, first.catalogue, model=wants_model(every) and not captures[-1].error)
            moved = []
            names = works[0].repository.version_names()
            if drift is not None and version.created and len(names) > 1:
                moved = drifts(works[0].repository, names[-2], version.name, drift)
                tell_drifts(moved, drift, here.show)
            return ObjectResult(first.object_id, captures, version, tuple(moved))
    except REFUSALS as error:
        return refused(references, error.message, error.remedy, here.show)


def work_on_capture(reference: CaptureReference, scheduler: str) -> CaptureResult:
    """Work on one capture when it is its turn; what goes wrong stays with this capture."""
    here = surroundings(scheduler)
    with here.turn(str(reference)):
        started = time.monotonic()
        records = []
        error = remedy = ""
        try:
            records = patiently(capture, reference, scheduler)
        except REFUSALS as refusal:
            error, remedy = refusal.message, refusal.remedy
        except Exception as defect:
            here.check()
            error, remedy = f"{type(defect).__name__}: {defect}", DEFECT
        seconds = time.monotonic() - started
        result = CaptureResult(reference.object_id, reference.capture_id, seconds, tuple(records), error, remedy)
        if error:
            here.show(Event("failed", result.name, text=f"{error}: {remedy}"))
        else:
            here.show(Event("capture", result.name, seconds=result.seconds, cached=result.cached))
        return result


def all_works(reference: CaptureReference) -> list[Workspace]:
    """All captures of the object that one of its captures belongs to."""
    captures = load_catalogue(reference.catalogue).object(reference.object_id).captures
    return [replace(reference, capture_id=each.id).workspace() for each in captures]


def refused(
    references: Sequence[CaptureReference], error: str, remedy: str, show: Callable[[Event], None]
) -> ObjectResult:
    """The result of an object none of whose captures could be worked on or kept."""
    captures = [CaptureResult(each.object_id, each.capture_id, 0.0, (), error, remedy) for each in references]
    for each in captures:
        show(Event("failed", each.name, text=f"{error}: {remedy}"))
    return ObjectResult(references[0].object_id, tuple(captures))


def submit[**P, R](pool: ThreadPoolExecutor, function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> Future[R]:
    """Run in a thread that knows the flow run around it."""
    call: Callable[[], Any] = partial(function, *args, **kwargs)
    return pool.submit(contextvars.copy_context().run, call)
