"""One capture: a Prefect task whose stages Dask workers perform, and which tells of each."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from prefect import task
from prefect.cache_policies import NO_CACHE

from glint.flows.pipeline.context import Surroundings, surroundings
from glint.flows.pipeline.dispatch import awaited, capacity, spread
from glint.flows.pipeline.stage_runs import Hearing
from glint.flows.pipeline.worker import ended, perform_there
from glint.flows.reporting.artifacts import capture_artifact
from glint.storage.errors import StoreUnreachable
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.references import CaptureReference, load_catalogue
from glint.tasks.engine.stage import Record, perform, stage_keys
from glint.tasks.pipeline import BY_NAME, STAGES
from glint.tasks.stages.clusters import clusters

NAMES = tuple(stage.name for stage in STAGES)
SPREAD = NAMES.index("clusters")
"""The stage that can be done by many workers, and that takes longest with long videos."""


def may_come_back(task: Any, run: Any, state: Any) -> bool:
    """Whether trying a capture again can help: the store did not answer. A bad capture stays bad."""
    return isinstance(state.result(raise_on_failure=False), StoreUnreachable)


@task(
    name="capture",
    task_run_name="{reference}",
    cache_policy=NO_CACHE,
    persist_result=False,
    retries=2,
    retry_delay_seconds=[5, 30],
    retry_condition_fn=may_come_back,
)
def capture(reference: CaptureReference, scheduler: str) -> list[Record]:
    """Survey, frames, lights, mask, clusters, markup, silhouette, labels, depth, surface: the surface of one view.

    scheduler: address of the Dask cluster.
    Raises InputError, StoreError or UnusableCapture where the capture cannot be worked on, ClusterError where it is too
    large for the workers, which is known after its survey.
    """
    work, here = reference.workspace(), surroundings(scheduler)
    with here.interruptible(), Hearing(here, work.name) as hearing:
        records = on_workers(work, here, hearing)
    capture_artifact(work, records, sum(len(each.captures) for each in load_catalogue(reference.catalogue).objects))
    return records


def on_workers(work: Workspace, here: Surroundings, hearing: Hearing) -> list[Record]:
    """All stages on one worker; where other workers would have nothing to do, clusters on all of them."""
    keys, found = stage_keys(work, STAGES), capacity(here.client)

    def on_one(stages: Sequence[str]) -> list[Record]:
        future = here.client.submit(perform_there, work, stages, keys, found.bytes, pure=False)
        records: list[Record] = awaited(future, work.name, hearing)
        return records

    records = on_one(NAMES[:SPREAD])
    if len(here.working) >= found.workers:
        return records + on_one(NAMES[SPREAD:])
    return [*records, on_all(work, keys, here, hearing), *on_one(NAMES[SPREAD + 1 :])]


def on_all(work: Workspace, keys: Mapping[str, str], here: Surroundings, hearing: Hearing) -> Record:
    """Clusters, their tiles on all workers."""
    name = NAMES[SPREAD]
    report = here.reporter(work.name, name)

    def told(done: int, total: int | None) -> None:
        report(done, total)
        hearing.pass_on()

    tiled = replace(BY_NAME[name], step=partial(clusters, mapper=partial(spread, here.client, work.name)))
    record = perform(work, tiled, keys[name], told)
    for event in ended(work.name, record):
        here.show(event)
    return record
