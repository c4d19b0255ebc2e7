"""Tasks of the Dask workers: they run stages, and import nothing of Prefect, which takes seconds."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress

from dask.utils import format_bytes

from glint.flows.errors import ClusterError, sent_from_worker
from glint.flows.reporting.events import (
    CaptureWarning,
    ProgressThrottle,
    StageEnded,
    StageStarted,
)
from glint.flows.reporting.worker_events import WorkerEvents
from glint.storage.errors import GlintError
from glint.storage.versions.repository import Version
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.stage import StageRecord, perform, stage_keys
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.memory import largest_need
from glint.tasks.pipeline import BY_NAME, STAGES
from glint.tasks.publish import publish

SURVEY = STAGES[0]
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
    records = list[StageRecord]()
    with WorkerEvents() as events:
        for name in stages:
            stage = BY_NAME[name]
            unit = stage.progress_unit
            events.emit(StageStarted(capture.name, name, unit))
            progress = ProgressThrottle(events.emit, capture.name, name, unit, PROGRESS_SECONDS)
            record = perform(capture, stage, keys[name], progress)
            for event in end_events(capture.name, record):
                events.emit(event)
            if name == "survey":
                needed, largest = largest_need(capture)
                check_bytes(limit, needed, f"{largest} of {capture.name}")
            records.append(record)
    return records


@sent_from_worker()
def run_last_stages(
    capture: CaptureContext,
    stages: Sequence[str],
    keys: Mapping[str, str],
    limit: int | None,
    earlier: Sequence[StageRecord],
    n_captures: int,
) -> tuple[list[StageRecord], str]:
    """Run the last stages of a capture on a Dask worker, and make its page; see `run_stages` and `capture_page`.

    earlier: records of the stages before. Returns the records of all stages, and the page.
    """
    from glint.tasks.figures.capture_page import capture_page

    records = [*earlier, *run_stages(capture, stages, keys, limit)]
    return records, capture_page(capture, records, n_captures)


@sent_from_worker()
def compare_captures(
    captures: Sequence[CaptureContext], failed: Collection[str], without_sphere: Collection[str]
) -> tuple[dict[str, list[StageWarning]], dict[str, str]]:
    """Compare spheres and scales of an object's captures on a Dask worker.

    See `agreement_warnings` and `sphere_offer`.

    failed: ids of the captures without a result; without_sphere: those of them that failed for their sphere.
    Returns, by capture, warnings of what contradicts the others, and what those without a sphere are offered.
    """
    from glint.tasks.agreement import agreement_warnings
    from glint.tasks.sphere_agreement import sphere_offer, surveyed_spheres

    surveyed = [context for context in captures if _is_surveyed(context, failed)]
    spheres = surveyed_spheres(surveyed)
    offers = {item.capture.id: sphere_offer(item, spheres) for item in captures if item.capture.id in without_sphere}
    return agreement_warnings(surveyed, spheres), offers


def _is_surveyed(context: CaptureContext, failed: Collection[str]) -> bool:
    """Return whether the spheres that are stored of a capture are those of its present inputs.

    A capture whose inputs or results cannot be read takes no part: those of the others do not depend on it.
    """
    capture_id = context.capture.id
    if capture_id in failed:
        return False
    with suppress(GlintError):
        return context.repository.stage_key(capture_id, SURVEY.name) == stage_keys(context, [SURVEY])[SURVEY.name]
    return False


@sent_from_worker()
def publish_captures(captures: Sequence[CaptureContext], run: str, catalogue: str, model: bool) -> Version:
    """Publish captures of one object on a Dask worker, which also checks their arrays; see `publish`."""
    return publish(captures, run, catalogue, model)


@sent_from_worker()
def run_model_stage(captures: Sequence[CaptureContext], key: str, name: str, stage: str) -> StageRecord:
    """Run the model stage of an object on a Dask worker, and publish its events as those of `name`."""
    from glint.tasks.model.model import perform_model

    with WorkerEvents() as events:
        events.emit(StageStarted(name, stage))
        record = perform_model(captures, key, ProgressThrottle(events.emit, name, stage, interval=PROGRESS_SECONDS))
        for event in end_events(name, record):
            events.emit(event)
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
