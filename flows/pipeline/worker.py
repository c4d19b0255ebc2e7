"""What Dask workers are sent to do: stages, and nothing that needs Prefect, whose import takes seconds."""

from collections.abc import Iterator, Mapping, Sequence

from dask.utils import format_bytes

from glint.flows.errors import ClusterError
from glint.flows.reporting.events import Event, Reporter, from_worker
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.stage import Record, perform
from glint.tasks.memory import largest_need
from glint.tasks.pipeline import BY_NAME
from glint.tasks.stages.model import perform_model

TOLD_SECONDS = 0.5
"""How often a worker tells of a stage's progress."""


def perform_there(work: Workspace, stages: Sequence[str], keys: Mapping[str, str], limit: int | None) -> list[Record]:
    """Perform stages one after the other in a Dask worker, which tells of each.

    limit: bytes that a worker may fill, None: any.

    Raises:
        ClusterError: after the survey, the capture needs more; else what the stages raise.
    """
    show, records = from_worker(), []
    for stage in stages:
        told = Reporter(show, work.name, stage, TOLD_SECONDS)
        told(0, None)
        record = perform(work, BY_NAME[stage], keys[stage], told)
        for event in ended(work.name, record):
            show(event)
        if stage == "survey":
            needed, largest = largest_need(work)
            check_bytes(limit, needed, f"{largest} of {work.name}")
        records.append(record)
    return records


def merge_there(works: Sequence[Workspace], key: str, name: str, stage: str) -> Record:
    """Perform the stage of an object's model in a Dask worker, told as NAME's."""
    show = from_worker()
    record = perform_model(works, key, Reporter(show, name, stage, TOLD_SECONDS))
    for event in ended(name, record):
        show(event)
    return record


def ended(name: str, record: Record) -> Iterator[Event]:
    """What there is to tell of a stage that has ended."""
    frames = int(record.counts["frames"]) if "frames" in record.counts else None
    yield Event("stage", name, record.stage, seconds=record.seconds, cached=record.cached, frames=frames)
    for warning in record.warnings:
        yield Event("warning", name, record.stage, text=warning)


def check_bytes(limit: int | None, needed: int, what: str) -> None:
    """Refuse work that needs more bytes in one process than a worker may fill.

    Raises:
        ClusterError: it does not fit.
    """
    if limit is not None and needed > limit:
        raise ClusterError(
            f"{what} needs {format_bytes(needed)} in one process, its workers have {format_bytes(limit)}",
            "give a smaller region, use fewer --workers, or a --scheduler whose workers have more memory",
        )
