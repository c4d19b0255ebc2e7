"""What Dask workers are sent to do: stages, and nothing that needs Prefect, whose import takes seconds."""

from collections.abc import Sequence

from flows.progress import worker_reporter
from tasks.model import perform_model
from tasks.stage import Record, perform
from tasks.stages import BY_NAME
from tasks.workspace import Workspace


def perform_there(work: Workspace, stage: str, key: str) -> Record:
    """Perform a stage in a Dask worker."""
    return perform(work, BY_NAME[stage], key, worker_reporter(work.name, stage))


def merge_there(works: Sequence[Workspace], key: str, name: str, stage: str) -> Record:
    """Perform the stage of an object's model in a Dask worker, told as NAME's."""
    return perform_model(works, key, worker_reporter(name, stage))
