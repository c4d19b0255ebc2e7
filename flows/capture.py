"""The flow of one capture: its stages one after the other, each a Prefect task performed on Dask workers."""

from dataclasses import replace
from functools import partial
from typing import Any

from prefect import flow, get_run_logger, task
from prefect.cache_policies import NO_CACHE

from flows.artifacts import capture_artifact
from flows.performing import perform_there
from flows.progress import Event
from flows.surroundings import surroundings
from flows.workers import DashboardProgress, awaited, check_bytes, spread
from storage.errors import StoreUnreachable
from tasks.clusters import clusters
from tasks.memory import largest_need
from tasks.references import CaptureReference, load_catalogue
from tasks.stage import Record, perform, stage_keys
from tasks.stages import BY_NAME, STAGES
from tasks.workspace import Workspace


@flow(name="capture", flow_run_name="{reference}", validate_parameters=False, persist_result=False)
def capture(reference: CaptureReference, scheduler: str) -> list[Record]:
    """Survey, frames, lights, mask, clusters, markup, silhouette, labels, depth, surface: the surface of one view.

    scheduler: address of the Dask cluster.
    Raises InputError, StoreError or UnusableCapture where the capture cannot be worked on, ClusterError where it is too
    large for the workers, which is known after its survey.
    """
    work, here = reference.workspace(), surroundings(scheduler)
    keys = stage_keys(work, STAGES)
    records = []
    with here.interruptible():
        for stage in STAGES:
            records.append(TASKS[stage.name](work, stage.name, keys[stage.name], scheduler))
            if stage.name == "survey":
                needed, largest = largest_need(work)
                check_bytes(here.client, needed, f"{largest} of {work.name}")
    capture_artifact(work, records, sum(len(each.captures) for each in load_catalogue(reference.catalogue).objects))
    return records


@task(task_run_name="{stage}", cache_policy=NO_CACHE, persist_result=False)
def run_stage(work: Workspace, stage: str, key: str, scheduler: str) -> Record:
    """Perform a stage on a worker; clusters go to all workers, tile by tile."""
    here, logger = surroundings(scheduler), get_run_logger()
    shown = DashboardProgress(here.reporter(work.name, stage), f"{work.name} {stage}")
    if stage == "clusters":
        tiled = replace(BY_NAME[stage], step=partial(clusters, mapper=partial(spread, here.client, work.name)))
        record = perform(work, tiled, key, shown)
    else:
        future = here.client.submit(perform_there, work, stage, key, pure=False)
        record = awaited(future, f"{work.name} {stage}", lambda: shown.repeat(here.latest.get((work.name, stage))))
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


def may_come_back(task: Any, run: Any, state: Any) -> bool:
    """Whether trying a stage again can help: the store did not answer. A bad capture stays bad."""
    return isinstance(state.result(raise_on_failure=False), StoreUnreachable)


TASKS = {
    stage.name: run_stage.with_options(
        name=stage.name, retries=2, retry_delay_seconds=[5, 30], retry_condition_fn=may_come_back
    )
    for stage in STAGES
}
"""The tasks by the names that the dashboard shows."""
