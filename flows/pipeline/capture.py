"""One capture: a Prefect task that has its stages run by Dask workers, which report each."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from distributed import Future
from prefect import task
from prefect.cache_policies import NO_CACHE

from glint.flows.pipeline.context import run_context
from glint.flows.pipeline.dispatch import capacity, scatter_map, task_key, wait_for
from glint.flows.pipeline.prefect_sink import TaskRunReporter
from glint.flows.pipeline.worker import end_events, run_last_stages, run_stages
from glint.flows.reporting.artifacts import create_page_artifact
from glint.flows.reporting.events import ProgressThrottle, StageStarted
from glint.flows.runtime.retry import retry_on_disconnect
from glint.storage.errors import StoreUnreachable
from glint.storage.inputs.preflight import check_inputs
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.stage import StageRecord, perform, stage_keys
from glint.tasks.engine.stage_function import ImportedFunction
from glint.tasks.pipeline import NAMES, STAGES

PARALLEL = next(number for number, stage in enumerate(STAGES) if stage.parallel_tiles)
"""Index of the stage whose tiles many workers can process; it takes longest with long videos."""


def is_store_unreachable(task: Any, run: Any, state: Any) -> bool:
    """Return whether a capture is worth another attempt: the store did not answer. A bad capture stays bad."""
    return isinstance(state.result(raise_on_failure=False), StoreUnreachable)


@task(
    name="capture",
    task_run_name="{name}",
    cache_policy=NO_CACHE,
    persist_result=False,
    retries=2,
    retry_delay_seconds=[5, 30],
    retry_condition_fn=is_store_unreachable,
)
def process_capture(name: str, capture: CaptureContext, n_captures: int = 1) -> list[StageRecord]:
    """Run all stages of a capture, from survey to surface, and put its page on the dashboard.

    name: OBJECT/CAPTURE; n_captures: captures of the catalogue, whose pages share a limit of size.

    Raises:
        InputError, StoreError, UnusableCapture: the capture cannot be processed; ClusterError: it is too large for the
            workers, which is known after its survey.
    """
    context = run_context()
    check_inputs(capture.capture)
    with context.cancellable(), context.prefect.attach(name) as reporter:
        records, page = run_on_workers(capture, n_captures, reporter)
    retry_on_disconnect(create_page_artifact, name, page)
    return records


def run_on_workers(
    capture: CaptureContext, n_captures: int, reporter: TaskRunReporter
) -> tuple[list[StageRecord], str]:
    """Run all stages on one worker, but clusters on all workers if some are idle; return the records and the page."""
    context = run_context()
    keys, available = stage_keys(capture, STAGES), capacity(context.client)

    def send(function: Callable[..., Any], stages: Sequence[str], *args: Any) -> Future:
        key = task_key(capture.name, f"{stages[0]}..{stages[-1]}")
        return context.client.submit(function, capture, stages, keys, available.bytes, *args, pure=False, key=key)

    has_idle = len(context.active) < available.workers
    future, rest = send(run_stages, NAMES[:PARALLEL]), NAMES[PARALLEL:]
    if has_idle:
        _import_parallel()  # while the worker is busy
    records: list[StageRecord] = wait_for(future, capture.name, reporter)
    if len(context.active) < available.workers:
        records, rest = [*records, on_all_workers(capture, keys)], NAMES[PARALLEL + 1 :]
    result: tuple[list[StageRecord], str] = wait_for(
        send(run_last_stages, rest, records, n_captures), capture.name, reporter
    )
    return result


def on_all_workers(capture: CaptureContext, keys: Mapping[str, str]) -> StageRecord:
    """Run clusters in this process, with its tiles on all workers."""
    context, stage = run_context(), STAGES[PARALLEL]
    unit = stage.progress_unit
    context.emit(StageStarted(capture.name, stage.name, unit))
    mapper = partial(scatter_map, context.client, capture.name, stage.name)
    run: Any = stage.run
    parallel = replace(stage, run=partial(run, mapper=mapper))
    progress = ProgressThrottle(context.emit, capture.name, stage.name, unit)
    record = perform(capture, parallel, keys[stage.name], progress)
    for event in end_events(capture.name, record):
        context.emit(event)
    return record


def _import_parallel() -> None:
    """Import the function of the stage that may run in this process, which takes seconds."""
    run = STAGES[PARALLEL].run
    if isinstance(run, ImportedFunction):
        run.load()
