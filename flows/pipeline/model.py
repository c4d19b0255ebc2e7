"""The model of an object, after its captures: one task, performed on a Dask worker."""

import time
from collections.abc import Sequence

from prefect import task
from prefect.cache_policies import NO_CACHE

from glint.flows.errors import DEFECT, REFUSALS
from glint.flows.pipeline.context import surroundings
from glint.flows.pipeline.dispatch import awaited
from glint.flows.pipeline.stage_runs import Hearing
from glint.flows.pipeline.worker import merge_there
from glint.flows.reporting.events import Event
from glint.flows.reporting.model_page import model_artifact
from glint.flows.results import CaptureResult
from glint.storage.catalogue.models import MODEL
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.stage import Record
from glint.tasks.stages.model import model_key


def work_on_model(works: Sequence[Workspace], scheduler: str) -> CaptureResult:
    """Merge an object's views; what goes wrong stays with the model, the captures are published all the same.

    works: all captures of the object; those that gave nothing are left out and named.
    """
    here, started, object_id = surroundings(scheduler), time.monotonic(), works[0].object_id
    name, records = f"{object_id}/{MODEL}", tuple[Record, ...]()
    error = remedy = ""
    try:
        records = (merge_views(works, name, scheduler),)
    except REFUSALS as refusal:
        error, remedy = refusal.message, refusal.remedy
    except Exception as defect:
        here.check()
        error, remedy = f"{type(defect).__name__}: {defect}", DEFECT
    seconds = time.monotonic() - started
    if error:
        here.show(Event("failed", name, text=f"{error}: {remedy}"))
    else:
        here.show(Event("capture", name, seconds=seconds, cached=records[0].cached))
    return CaptureResult(object_id, MODEL, seconds, records, error, remedy)


@task(name="model", task_run_name="{name}", cache_policy=NO_CACHE, persist_result=False)
def merge_views(works: Sequence[Workspace], name: str, scheduler: str) -> Record:
    """Place and merge the views on a worker."""
    here = surroundings(scheduler)
    with Hearing(here, name) as hearing:
        future = here.client.submit(merge_there, list(works), model_key(works), name, MODEL, pure=False)
        record: Record = awaited(future, name, hearing)
    model_artifact(works[0].repository, name, (record,))
    return record
