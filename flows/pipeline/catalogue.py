"""The flow of a catalogue: its objects side by side, each a flow run of its own; what has not changed is passed."""

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from prefect import flow, runtime
from prefect.client.schemas.objects import State

from glint.flows.errors import DEFECT, REFUSALS
from glint.flows.pipeline.context import surroundings
from glint.flows.pipeline.object import refused, run_object, submit, unchanged_object
from glint.flows.reporting.artifacts import catalogue_artifact
from glint.flows.reporting.events import Event
from glint.flows.results import ObjectResult, RunResult, final_state
from glint.flows.runtime.retry import patiently
from glint.tasks.engine.references import CaptureReference, chosen_captures, load_catalogue

APART_SECONDS = 0.3
"""Between the first objects: of two flow runs that begin at once SQLite turns one away, and its client sleeps for two
seconds."""


@flow(name="catalogue", flow_run_name="{name}", validate_parameters=False, persist_result=False)
def run_catalogue(
    catalogue: str,
    name: str,
    store: str,
    scheduler: str,
    only: Sequence[str] = (),
    side_by_side: int = 2,
    rehash: bool = False,
    drift: float | None = None,
) -> State[RunResult]:
    """Work through a catalogue, or those of its captures that `only` names (OBJECT or OBJECT/CAPTURE).

    side_by_side: objects that are worked on at the same time; drift: degrees by which normals may move unannounced.
    The flow run ends as done, partially done or failed, as its captures did; its state says how many of them failed.
    """
    started, run = time.monotonic(), str(runtime.flow_run.id)
    chosen = chosen_captures(load_catalogue(catalogue).objects, only)
    with ThreadPoolExecutor(side_by_side) as pool:
        futures = []
        for each, captures in chosen.items():
            futures.append(
                submit(pool, object_or_pass, catalogue, each, captures, store, scheduler, run, rehash, drift)
            )
            if len(futures) < side_by_side:
                time.sleep(APART_SECONDS)
        try:
            objects = [future.result() for future in futures]
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            surroundings(scheduler).abandon()
            raise
    result = RunResult(run, tuple(objects), time.monotonic() - started)
    catalogue_artifact(name, result)
    return final_state(result.captures, _summary(result), result)


def object_or_pass(
    catalogue: str, object_id: str, captures: Sequence[str], store: str, scheduler: str, run: str, rehash: bool,
    drift: float | None,
) -> ObjectResult:  # fmt: skip
    """Pass an object on which nothing is to be done, else run its flow; what goes wrong stays with this object."""
    here = surroundings(scheduler)
    here.check()
    references = [CaptureReference(catalogue, object_id, each, store, run, rehash) for each in captures]
    try:
        passed = unchanged_object(references)
        if passed is None:
            return patiently(_run, references, scheduler, drift)
    except REFUSALS as error:
        return refused(references, error.message, error.remedy, here.show)
    except Exception as defect:
        here.check()
        return refused(references, f"{type(defect).__name__}: {defect}", DEFECT, here.show)
    for each in passed.captures:
        here.show(Event("capture", each.name, seconds=0.0, cached=True))
    return passed


def _run(references: Sequence[CaptureReference], scheduler: str, drift: float | None) -> ObjectResult:
    first = references[0]
    every = load_catalogue(first.catalogue).object(first.object_id).captures
    state: Any = run_object(
        first.catalogue,
        first.object_id,
        first.store,
        scheduler,
        captures=[each.capture_id for each in references] if len(references) < len(every) else [],
        run=first.run,
        rehash=first.rehash,
        drift=drift,
        return_state=True,
    )
    result = state.result(raise_on_failure=False)
    if isinstance(result, ObjectResult):
        return result
    if isinstance(result, BaseException):
        raise result
    raise RuntimeError(f"its flow run ended as {state.name}: {state.message}")


def _summary(result: RunResult) -> str:
    """What a run with nothing failed did, in a line."""
    unchanged = sum(each.cached for each in result.captures)
    moved = f", {len(result.drifts)} moved" if result.drifts else ""
    return f"{len(result.captures)} captures: {len(result.captures) - unchanged} done, {unchanged} unchanged{moved}"
