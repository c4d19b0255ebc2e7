"""The model of an object, after its captures: one task, performed on a Dask worker."""

import time
from collections.abc import Sequence

from prefect import task
from prefect.cache_policies import NO_CACHE

from flows.errors import DEFECT, REFUSALS
from flows.hearing import Hearing
from flows.model_page import model_artifact
from flows.outcomes import CaptureResult
from flows.performing import merge_there
from flows.progress import Event
from flows.surroundings import surroundings
from flows.workers import awaited
from storage.catalogue_models import MODEL
from tasks.model import model_key
from tasks.stage import Record
from tasks.workspace import Workspace


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
