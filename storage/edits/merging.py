"""Changes of several people merged: of different fields all count; the same field changed meanwhile is a conflict."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from glint.storage.edits.models import CaptureEdits, Changes, EditedFields, FieldChange, Note, Revision
from glint.storage.errors import StoreError


@dataclass(frozen=True, slots=True)
class FieldConflict:
    """A field that somebody else changed: by whom, when, and with which revision."""

    field: str
    author: str
    time: datetime
    revision: int

    def __str__(self) -> str:
        """Return it in words."""
        return f"{self.author} changed {self.field} at {self.time:%Y-%m-%d %H:%M:%S} UTC (edit {self.revision})"


class ConflictError(StoreError):
    """Fields were changed by somebody else since the revision on which a change is based; nothing was saved."""

    def __init__(self, name: str, conflicts: tuple[FieldConflict, ...]) -> None:
        """Name the capture (OBJECT/CAPTURE) and the fields in conflict."""
        self.name, self.conflicts = name, conflicts
        super().__init__(
            f"{name}: {'; '.join(map(str, conflicts))}",
            "look at the newest edits, then save again what should hold; your change was not saved, nor theirs lost",
        )

    def __reduce__(self) -> Any:
        """Support pickling, since the constructor's arguments differ from the exception's."""
        return type(self), (self.name, self.conflicts)


def same_value(first: Any, second: Any) -> bool:
    """Return whether two values of a field are equal; masks by their pixels."""
    if isinstance(first, np.ndarray) and isinstance(second, np.ndarray):
        return np.array_equal(first, second)
    return first is second or (type(first) is type(second) and first == second)


def differing(first: EditedFields, second: EditedFields, fields: Iterable[str]) -> list[str]:
    """Return those of the fields whose values differ."""
    return [field for field in fields if not same_value(getattr(first, field), getattr(second, field))]


def conflicts_of(current: CaptureEdits, fields: Iterable[str], base: int) -> tuple[FieldConflict, ...]:
    """Return those of the fields that were changed after the revision `base`."""
    changes = ((field, current.changes[field]) for field in fields if field in current.changes)
    return tuple(
        FieldConflict(field, change.author, change.time, change.revision)
        for field, change in changes
        if change.revision > base
    )


def merged(current: CaptureEdits, changes: Changes, revision: Revision) -> CaptureEdits:
    """Return the edits of a capture after the changes of a revision."""
    change = FieldChange(revision=revision.number, author=revision.author, time=revision.time)
    fields = [field for field in revision.fields if field != "note"]
    notes = current.notes
    if changes.note is not None:
        notes += (Note(author=revision.author, time=revision.time, text=changes.note),)
    return current.model_copy(
        update={
            "revision": revision.number,
            "notes": notes,
            "changes": {**current.changes, **dict.fromkeys(fields, change)},
            **{field: getattr(changes, field) for field in fields},
        }
    )
