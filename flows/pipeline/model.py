"""The model of an object, after its captures: one Prefect task, run by a Dask worker."""

from collections.abc import Sequence

from prefect import task
from prefect.cache_policies import NO_CACHE

from glint.flows.pipeline.context import run_context
from glint.flows.pipeline.dispatch import task_key, wait_for
from glint.flows.pipeline.worker import run_model_stage
from glint.flows.reporting.artifacts import create_page_artifact
from glint.flows.runtime.retry import retry_on_disconnect
from glint.storage.catalogue.models import MODEL
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.stage import StageRecord
from glint.tasks.figures.model_page import model_page
from glint.tasks.model.model_key import model_key, with_rollbacks


@task(name="model", task_run_name="{name}", cache_policy=NO_CACHE, persist_result=False)
def process_model(captures: Sequence[CaptureContext], name: str) -> list[StageRecord]:
    """Merge an object's views into its model, and put its page on the dashboard.

    captures: all captures of the object; those without a result are left out and named. name: OBJECT/model.
    """
    context = run_context()
    with context.cancellable(), context.prefect.attach(name) as reporter:
        key = task_key(name, MODEL)
        views = with_rollbacks(captures)
        arguments = views, model_key(views), name, MODEL
        future = context.client.submit(run_model_stage, *arguments, pure=False, key=key)
        record: StageRecord = wait_for(future, name, reporter)
    page = model_page(captures[0].repository, name, [record])
    retry_on_disconnect(create_page_artifact, name, page)
    return [record]
