"""Find who set each mark of a capture: the author of the change that added it."""

from collections.abc import Collection

from glint.storage.edits.edits import Edits
from glint.storage.inputs.markup import AnnotationEntry


class MarkAuthors:
    """Authors of the marks of a capture; each change is read only once.

    given: marks that the catalogue has, which have no author.
    """

    def __init__(self, capture_id: str, given: Collection[AnnotationEntry] = ()) -> None:
        self._capture, self._given = capture_id, frozenset(given)
        self._authors: dict[AnnotationEntry, str] = {}
        self._read = 0

    def at(self, edits: Edits, revision: int) -> dict[AnnotationEntry, str]:
        """Return the author of each mark that was ever set until a revision of the object's edits, if it has one.

        A mark that was removed and set again has its second author; one that an undo brings back has its first.

        Raises:
            StoreError: there is no such revision; DamagedError: an edit is not what was written.
        """
        if revision <= self._read:
            return dict(self._authors)
        changes = [item for item in edits.history(self._capture) if self._read < item.number <= revision]
        for change in changes:
            if "marks" not in change.fields:
                continue
            before = edits.current(self._capture, change.number - 1).marks
            earlier = self._given if before is None else frozenset(before)
            for mark in edits.current(self._capture, change.number).marks or ():
                if mark not in earlier and not (change.undoes and mark in self._authors):
                    self._authors[mark] = change.author
        self._read = revision
        return dict(self._authors)
