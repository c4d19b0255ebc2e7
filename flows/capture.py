"""The flow of one capture: its stages one after the other, each a Prefect task performed on Dask workers."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial

from distributed import Client
from prefect import flow, get_run_logger, task
from prefect.cache_policies import NO_CACHE

from flows.artifacts import capture_artifact
from flows.progress import Event, worker_reporter
from flows.surroundings import surroundings
from tasks.clusters import clusters
from tasks.references import CaptureReference
from tasks.stage import Record, perform, stage_keys
from tasks.stages import BY_NAME, STAGES
from tasks.workspace import Workspace


@flow(name="capture", flow_run_name="{reference}", validate_parameters=False, persist_result=False)
def capture(reference: CaptureReference, scheduler: str) -> list[Record]:
    """Survey, frames, lights, mask, clusters, markup, silhouette, labels, depth, surface: the surface of one view.

    scheduler: address of the Dask cluster.
    Raises InputError, StoreError or UnusableCapture where the capture cannot be worked on.
    """
    work = reference.workspace()
    keys = stage_keys(work, STAGES)
    records = [TASKS[stage.name](work, stage.name, keys[stage.name], scheduler) for stage in STAGES]
    capture_artifact(work, records)
    return records


@task(task_run_name="{stage}", cache_policy=NO_CACHE, persist_result=False)
def run_stage(work: Workspace, stage: str, key: str, scheduler: str) -> Record:
    """Perform a stage on a worker; clusters go to all workers, tile by tile."""
    here, logger = surroundings(scheduler), get_run_logger()
    if stage == "clusters":
        tiled = replace(BY_NAME[stage], step=partial(clusters, mapper=partial(spread, here.client)))
        record = perform(work, tiled, key, here.reporter(work.name, stage))
    else:
        record = here.client.submit(perform_there, work, stage, key, pure=False).result()
    here.show(
        Event(
            "stage",
            work.name,
            stage,
            seconds=record.seconds,
            cached=record.cached,
            frames=int(record.counts["frames"]) if "frames" in record.counts else None,
        )
    )
    logger.info("%s in %.2f s%s", stage, record.seconds, ", was there already" if record.cached else "")
    for warning in record.warnings:
        logger.warning("%s: %s", work.name, warning)
        here.show(Event("warning", work.name, stage, text=warning))
    return record


TASKS = {stage.name: run_stage.with_options(name=stage.name) for stage in STAGES}
"""The tasks by the names that the dashboard shows."""


def perform_there(work: Workspace, stage: str, key: str) -> Record:
    """Perform a stage in a Dask worker."""
    return perform(work, BY_NAME[stage], key, worker_reporter(work.name, stage))


def spread[Task, Shared, Result](
    client: Client, function: Callable[[Task, Shared], Result], tasks: Iterable[Task], common: Shared
) -> Iterator[Result]:
    """Apply a function to tasks on all workers, which get once what is common; results in the tasks' order."""
    shared = client.scatter(common, broadcast=True, hash=False)
    futures = client.map(function, list(tasks), common=shared, pure=False)
    while futures:
        future = futures.pop(0)
        yield future.result()
        future.release()
