"""Tasks of the Dask workers: they run stages, and import nothing of Prefect, which takes seconds."""

from collections.abc import Iterator, Mapping, Sequence

from dask.utils import format_bytes

from glint.flows.errors import ClusterError, sent_from_worker
from glint.flows.reporting.events import (
    CaptureWarning,
    ProgressThrottle,
    StageEnded,
    StageStarted,
    publish_from_worker,
)
from glint.storage.versions.repository import Version
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.stage import StageRecord, perform
from glint.tasks.memory import largest_need
from glint.tasks.pipeline import BY_NAME
from glint.tasks.publish import publish

PROGRESS_SECONDS = 0.5
"""Interval at which a worker reports a stage's progress."""


@sent_from_worker()
def run_stages(
    capture: CaptureContext, stages: Sequence[str], keys: Mapping[str, str], limit: int | None
) -> list[StageRecord]:
    """Run stages of a capture one after the other on a Dask worker, and publish their events.

    limit: bytes that a worker may use, None: any number.

    Raises:
        ClusterError: after the survey, the capture needs more bytes; else what the stages raise.
    """
    emit, records = publish_from_worker(), []
    for name in stages:
        stage = BY_NAME[name]
        unit = stage.progress_unit
        emit(StageStarted(capture.name, name, unit))
        progress = ProgressThrottle(emit, capture.name, name, unit, PROGRESS_SECONDS)
        record = perform(capture, stage, keys[name], progress)
        for event in end_events(capture.name, record):
            emit(event)
        if name == "survey":
            needed, largest = largest_need(capture)
            check_bytes(limit, needed, f"{largest} of {capture.name}")
        records.append(record)
    return records


@sent_from_worker()
def make_page(capture: CaptureContext, records: Sequence[StageRecord], n_captures: int) -> str:
    """Make the page of a capture on a Dask worker; see `capture_page`."""
    from glint.tasks.figures.capture_page import capture_page

    return capture_page(capture, records, n_captures)


@sent_from_worker()
def publish_captures(captures: Sequence[CaptureContext], run: str, catalogue: str, model: bool) -> Version:
    """Publish captures of one object on a Dask worker, which also checks their arrays; see `publish`."""
    return publish(captures, run, catalogue, model)


@sent_from_worker()
def run_model_stage(captures: Sequence[CaptureContext], key: str, name: str, stage: str) -> StageRecord:
    """Run the model stage of an object on a Dask worker, and publish its events as those of `name`."""
    from glint.tasks.model.model import perform_model

    emit = publish_from_worker()
    emit(StageStarted(name, stage))
    record = perform_model(captures, key, ProgressThrottle(emit, name, stage, interval=PROGRESS_SECONDS))
    for event in end_events(name, record):
        emit(event)
    return record


def end_events(capture: str, record: StageRecord) -> Iterator[StageEnded | CaptureWarning]:
    """Yield the events of a stage that has ended: its end and its warnings."""
    frames = int(record.counts["frames"]) if "frames" in record.counts else None
    yield StageEnded(capture, record.stage, record.seconds, record.cached, frames)
    for warning in record.warnings:
        yield CaptureWarning(capture, warning.message, record.stage)


def check_bytes(limit: int | None, needed: int, work: str) -> None:
    """Refuse work that needs more bytes in one process than a worker may use.

    Raises:
        ClusterError: it does not fit.
    """
    if limit is not None and needed > limit:
        raise ClusterError(
            f"{work} needs {format_bytes(needed)} in one process, its workers have {format_bytes(limit)}",
            "give a smaller region, use fewer --workers, or a --scheduler whose workers have more memory",
        )
