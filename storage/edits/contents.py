"""A capture's edits as a group of a versioned store, written and verified like the result of a stage.

Mask and marks are files of the group, byte for byte those that a catalogue would name; all else is in its record.
"""

import json
from collections.abc import Sequence
from typing import Any

import icechunk
from pydantic import ValidationError

from glint.storage.edits.models import CaptureEdits, mask_png
from glint.storage.edits.records import RevisionCommit
from glint.storage.errors import DamagedError, one_line
from glint.storage.footage.images import decode_image
from glint.storage.inputs.markup import AnnotationEntry
from glint.storage.seals import SEAL
from glint.storage.versions.snapshots import read_session
from glint.storage.versions.stage_results import StageResult, StoredFile
from glint.storage.versions.stages.reader import read_capture, stage_attributes
from glint.storage.versions.stages.writer import write_stage

GROUP = "edits"
"""Name of the group in that of its capture."""
MASK_FILE, MARKUP_FILE = "mask.png", "markup.json"


def read_edits(
    repository: icechunk.Repository, object_id: str, at: RevisionCommit | None, capture: str
) -> CaptureEdits:
    """Return a capture's edits at a revision, None: before the first.

    Raises:
        DamagedError: they are not what was written.
    """
    number, group = (0, None) if at is None else (at.number, edits_group(repository, object_id, at, capture))
    return CaptureEdits(capture=capture, revision=number) if group is None else edits_of(group, number)


def edits_of(group: StageResult, revision: int) -> CaptureEdits:
    """Return the edits that a group holds, as those of a revision.

    Raises:
        DamagedError: they are not what was written.
    """
    try:
        files = {name: group.read_file(name) for name in group.files}
    except DamagedError as error:
        raise edits_damage(group.object_id, group.capture, error) from error
    record = group.record | {"revision": revision}
    if MARKUP_FILE in files:
        record["marks"] = json.loads(files[MARKUP_FILE])
    try:
        edits = CaptureEdits.model_validate_json(json.dumps(record))
    except ValidationError as error:
        discard = f"`glint edits {group.object_id}/{group.capture} --discard` to continue without its edits"
        message = f"{group.name} was written by another version of Glint ({one_line(error)})"
        raise DamagedError(message, f"update Glint, or {discard}") from error
    if MASK_FILE not in files:
        return edits
    return edits.model_copy(update={"mask": decode_image(files[MASK_FILE], f"the mask of {group.name}") > 0})


def edits_group(
    repository: icechunk.Repository, object_id: str, at: RevisionCommit, capture: str
) -> StageResult | None:
    """Return the group of a capture's edits at a revision, None where it has none.

    Raises:
        DamagedError: it is not what was written.
    """
    if at.revision is None or capture not in at.revision.seals:
        return None
    store = read_session(repository, object_id, at.snapshot).store
    try:
        return read_capture(store, object_id, capture, f"edit {at.number}", {GROUP: at.revision.seals[capture]})[GROUP]
    except DamagedError as error:
        raise edits_damage(object_id, capture, error) from error


def edits_damage(object_id: str, capture: str, error: DamagedError) -> DamagedError:
    """Return the error of damaged edits: no catalogue rebuilds what a person did."""
    remedy = f"restore a backup, or `glint edits {object_id}/{capture} --discard` to continue without its edits"
    return DamagedError(error.message, remedy)


def write_edits(store: Any, object_id: str, edits: CaptureEdits) -> str:
    """Replace a capture's edits; return the seal of their group."""
    record = edits.model_dump(mode="json", exclude={"mask", "marks", "revision"}, exclude_none=True)
    files = dict[str, StoredFile]()
    if edits.mask is not None:
        files[MASK_FILE] = StoredFile(mask_png(edits.mask), "image/png")
    if edits.marks is not None:
        files[MARKUP_FILE] = StoredFile(markup_json(edits.marks), "application/json")
    write_stage(store, object_id, edits.capture, GROUP, str(edits.revision), arrays={}, record=record, files=files)
    return str(stage_attributes(store, object_id, edits.capture)[GROUP][SEAL])


def markup_json(marks: Sequence[AnnotationEntry]) -> bytes:
    """Write marks as the file that a catalogue names, one a line."""
    lines = ",\n  ".join(json.dumps(mark.model_dump()) for mark in marks)
    return (f"[\n  {lines}\n]\n" if lines else "[]\n").encode()
