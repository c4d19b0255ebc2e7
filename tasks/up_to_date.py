"""Objects on which nothing is to be done: found by their keys alone, without a flow run, a worker or any footage."""

from collections.abc import Sequence

from glint.storage.versions.repository import Version
from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.stage import Record, stage_keys, stored
from glint.tasks.pipeline import STAGES
from glint.tasks.stages.model import STAGE, model_key, wants_model


def unchanged(works: Sequence[Workspace]) -> tuple[Version, dict[str, tuple[Record, ...]]] | None:
    """The version that already holds all results of these captures of one object, and their records; else None.

    Raises:
        InputError, StoreError: an input or the store cannot be read.
    """
    repository, records, keys = works[0].repository, dict[str, tuple[Record, ...]](), dict[str, dict[str, str]]()
    for work in works:
        saved = repository.records(work.capture.id)
        records[work.capture.id] = stored(saved, stage_keys(work, STAGES))
        keys[work.capture.id] = {stage: key for stage, (key, _) in saved.items()}
        if not records[work.capture.id]:
            return None
    if wants_model(works):
        key = model_key(works)
        if repository.stage_key(WHOLE_OBJECT, STAGE) != key:
            return None
        keys[WHOLE_OBJECT] = {STAGE: key}
    version = repository.published(keys)
    return None if version is None else (version, records)
