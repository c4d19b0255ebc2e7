"""Objects on which nothing is to be done: recognized by their keys alone, without a flow run, a worker or a video."""

from collections.abc import Sequence

from glint.storage.versions.repository import Version
from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.storage.versions.verification import verify_capture
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.stage import StageRecord, cached_records, stage_keys
from glint.tasks.model.model_key import STAGE, model_key, wants_model, with_rollbacks
from glint.tasks.pipeline import NAMES, STAGES


def up_to_date_records(contexts: Sequence[CaptureContext]) -> tuple[Version, dict[str, tuple[StageRecord, ...]]] | None:
    """Return the version that already holds all results of these captures of one object, and their records; else None.

    None too where a byte of what the version holds of them is damaged; with `rehash` also of the newest results, which
    may be other files.

    Raises:
        InputError, StoreError: an input or the store cannot be read.
    """
    repository, records = contexts[0].repository, dict[str, tuple[StageRecord, ...]]()
    keys = dict[str, dict[str, str]]()
    for context in contexts:
        saved = repository.records(context.capture.id)
        if not saved:  # before any file of the capture is read for its digest
            return None
        records[context.capture.id] = cached_records(saved, stage_keys(context, STAGES))
        keys[context.capture.id] = {stage: key for stage, (key, _) in saved.items()}
        if not records[context.capture.id]:
            return None
    if wants_model(contexts):
        keys[WHOLE_OBJECT] = {STAGE: model_key(with_rollbacks(contexts))}
    version = repository.published(keys)
    if version is None:
        return None
    refs = (version.name, "work") if contexts[0].rehash else (version.name,)
    if any(verify_capture(repository, capture, ref).damages for capture in keys for ref in refs):
        return None
    return version, records


def pending_stages(context: CaptureContext) -> tuple[str, ...]:
    """Return the names of the stages of a capture that are not stored under their keys.

    Raises:
        InputError, StoreError: an input or the store cannot be read.
    """
    saved = context.repository.records(context.capture.id)
    if not saved:
        return NAMES
    keys = stage_keys(context, STAGES)
    return tuple(stage for stage, key in keys.items() if stage not in saved or saved[stage][0] != key)
