"""Edits over a catalogue: a capture's entry with the edited fields in place of what the catalogue says.

An edited mask and edited marks become files in the store, which every worker reads like those that a catalogue names:
STORE/objects/<id>/inputs/, named by their content. They are a cache: written again when they are gone or not whole.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import obstore

from glint.storage.catalogue.models import Capture
from glint.storage.edits.contents import MARKUP_FILE, MASK_FILE, edits_group, edits_of
from glint.storage.edits.models import FieldChange
from glint.storage.edits.records import RevisionCommit, newest_commit
from glint.storage.errors import DamagedError, InputError
from glint.storage.inputs.digests import content_digest
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.snapshots import index_errors
from glint.storage.versions.stage_results import StageResult

FOLDER = "inputs"
_ENTRY_KEYS = ("spheres", "region", "camera", "pixel_size", "pose")
"""Fields that an edit sets as the catalogue would."""


@dataclass(frozen=True, slots=True)
class EditsUsed:
    """The edits of an entry: the newest revision of the object's edits, and the last author of each field."""

    revision: int
    changes: Mapping[str, FieldChange]

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON values."""
        changes = {name: change.model_dump(mode="json") for name, change in self.changes.items()}
        return {"revision": self.revision, "changes": changes}

    def __str__(self) -> str:
        """Name fields, authors and days."""
        parts = (f"{name} by {change.author} ({change.time:%Y-%m-%d})" for name, change in self.changes.items())
        return ", ".join(parts)


@dataclass(frozen=True, slots=True)
class EditedEntry:
    """A capture's entry with its edits; `edits`: None where no input is edited.

    damage: why its edits cannot be read; then `capture` is the catalogue's entry. None where they can.
    """

    capture: Capture
    edits: EditsUsed | None = None
    damage: DamagedError | None = None


def edited_entries(repository: ObjectRepository, captures: Iterable[Capture]) -> list[EditedEntry]:
    """Return the entries of an object's captures with the edits of the store over them.

    What contradicts the catalogue is an error of that capture's survey alone, and damaged edits are of that capture.

    Raises:
        DamagedError: the list of edits, which all captures need, is not what was written.
    """
    index, location, object_id = repository.index, repository.location, repository.object_id
    with index_errors(location.uri, "reading the edits", object_id):
        newest = newest_commit(index, object_id)
    if newest is None:
        return [EditedEntry(entry) for entry in captures]
    return [_edited_or_damaged(repository, newest, entry) for entry in captures]


def _edited_or_damaged(repository: ObjectRepository, newest: RevisionCommit, entry: Capture) -> EditedEntry:
    try:
        with index_errors(repository.location.uri, f"reading the edits of {entry.id}", repository.object_id):
            return _edited(repository, newest, entry)
    except DamagedError as damage:
        return EditedEntry(entry, damage=damage)


def _edited(repository: ObjectRepository, newest: RevisionCommit, entry: Capture) -> EditedEntry:
    group = edits_group(repository.index, repository.object_id, newest, entry.id)
    if group is None:
        return EditedEntry(entry)
    edits = edits_of(group, newest.number)
    values = {name: getattr(edits, name) for name in edits.edited if name in _ENTRY_KEYS}
    if edits.mask is not None:
        values["mask"] = _written(repository.location, group, MASK_FILE)
    if edits.marks is not None:
        values["markup"] = _written(repository.location, group, MARKUP_FILE) if edits.marks else None
    changes = {name: edits.changes[name] for name in edits.edited if name != "verdict"}
    return EditedEntry(entry.model_copy(update=values), EditsUsed(newest.number, changes) if changes else None)


def _written(location: Location, group: StageResult, name: str) -> str:
    """Return the address of a file of a group in the cache of inputs, where it is written unless it is whole there."""
    digest = group.files[name].sha256
    folder = location.child("objects", group.object_id, FOLDER)
    target = folder.child(f"{digest}.{name.rpartition('.')[2]}")
    try:
        if content_digest(target, location) == digest:
            return target.uri
    except InputError:
        pass  # it is not there
    with store_errors(location.uri, "writing an edited input"):
        obstore.put(folder.obstore(), target.name, group.read_file(name), use_multipart=False)
    return target.uri
