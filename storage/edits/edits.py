"""Edits: what people did to the inputs of an object's captures, versioned beside its results.

Each saved change is a revision: one commit, with author, time and a sentence. Nothing that was saved is lost: undo is a
new revision with the earlier content. In a run, edits lie over what the catalogue says, see `overlay`.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime
from uuid import uuid4

import icechunk
from pydantic import TypeAdapter, ValidationError

from glint.storage.edits import records
from glint.storage.edits.contents import edits_damage, edits_group, read_edits, write_edits
from glint.storage.edits.merging import ConflictError, conflicts_of, differing, merged
from glint.storage.edits.models import CaptureEdits, Changes, EditedFields, Line, Revision
from glint.storage.edits.records import RevisionCommit
from glint.storage.edits.sentences import sentence_of
from glint.storage.errors import DamagedError, InputError
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.snapshots import index_errors
from glint.storage.versions.stages.names import check_name
from glint.storage.versions.transaction import transaction
from glint.storage.versions.verification import Verification, verify

_LINE: TypeAdapter[str] = TypeAdapter(Line)

Decision = Callable[[CaptureEdits], Changes]
"""Decides, from the newest edits of a capture, what is to be changed."""


class Edits:
    """The edits of one object; safe to use from several threads and processes at once."""

    def __init__(self, repository: ObjectRepository) -> None:
        self.location, self.object_id, self._index = repository.location, repository.object_id, repository.index

    @classmethod
    def open(cls, location: Location, object_id: str, create: bool = True) -> "Edits":
        """Open an object's edits; with `create`, create its repository where it is absent.

        Raises:
            StoreError: no such object, an id that cannot name one, or the store cannot be used.
        """
        return cls(ObjectRepository.open(location, object_id, create))

    @property
    def revision(self) -> int:
        """Number of the newest revision, 0 before the first."""
        newest = self._newest()
        return 0 if newest is None else newest.number

    def captures(self) -> list[str]:
        """Return the ids of the captures that were ever edited, sorted."""
        newest = self._newest()
        return [] if newest is None or newest.revision is None else sorted(newest.revision.seals)

    def current(self, capture_id: str, revision: int | None = None) -> CaptureEdits:
        """Return the edits of a capture, of the newest revision (None) or an earlier one (0: before the first).

        Raises:
            StoreError: there is no such revision, or an id that cannot name a capture; DamagedError: they are not what
                was written.
        """
        check_name(capture_id, "capture")
        with self._errors(f"reading the edits of {capture_id}"):
            if revision is None:
                at = records.newest_commit(self._index, self.object_id)
            else:
                at = records.commit_of(self._index, self.object_id, revision) if revision else None
            return read_edits(self._index, self.object_id, at, capture_id)

    def history(self, capture_id: str | None = None) -> list[Revision]:
        """Return all revisions, or those of a capture, oldest first.

        Raises:
            DamagedError: one is not what was written, or is lost.
        """
        with self._errors("reading the history of edits"):
            revisions = (commit.revision for commit in records.commits(self._index, self.object_id))
            return [item for item in revisions if item is not None and capture_id in (None, item.capture)]

    def verify(self, revision: int) -> Verification:
        """Read all bytes that a revision saved.

        Raises:
            StoreUnreachable: the store does not answer.
        """
        try:
            with self._errors(f"reading edit {revision}"):
                commit = records.commit_of(self._index, self.object_id, revision)
                assert commit.revision is not None
                group = edits_group(self._index, self.object_id, commit, commit.revision.capture)
            outcome = verify([] if group is None else [group])
            damages = (edits_damage(self.object_id, commit.revision.capture, error) for error in outcome.damages)
            return replace(outcome, damages=tuple(damages))
        except DamagedError as error:
            return Verification(0, 0, (error,))

    def save(
        self, capture_id: str, changes: Changes, author: str, base_revision: int, sentence: str = ""
    ) -> Revision | None:
        """Save changes of a capture's edits durably as one revision; None where nothing would change.

        base_revision: the `revision` of the edits that the author has seen. What others changed since is kept, unless
        it is the same field. sentence: what changed, by default in Glint's words.

        Raises:
            ConflictError: a field was changed since to another value; it names field, author and time, and nothing is
                saved. InputError: author, sentence or base cannot be. StoreError: the store cannot be written.
        """

        def decide(before: CaptureEdits) -> Changes:
            if not 0 <= base_revision <= before.revision:
                raise InputError(
                    f"{self._name(capture_id)} has edits up to {before.revision}, not {base_revision}",
                    "base changes on the edits that were read last",
                )
            conflicts = conflicts_of(before, differing(before, changes, changes.changed), base_revision)
            if conflicts:
                raise ConflictError(self._name(capture_id), conflicts)
            return changes

        return self._save(capture_id, decide, author, sentence)

    def undo(self, revision: int, author: str) -> Revision | None:
        """Take a revision back: its fields get the values that they had before it; None where they have them already.

        An undo is a revision too, and can be undone. Notes stay.

        Raises:
            ConflictError: a field was changed since to a third value; StoreError: there is no such revision.
        """
        with self._errors(f"reading edit {revision}"):
            undone = records.commit_of(self._index, self.object_id, revision).revision
        assert undone is not None
        fields = [field for field in undone.fields if field != "note"]
        earlier, later = self.current(undone.capture, revision - 1), self.current(undone.capture, revision)

        def decide(before: CaptureEdits) -> Changes:
            moved = set(differing(before, later, fields)) & set(differing(before, earlier, fields))
            if moved:
                raise ConflictError(self._name(undone.capture), conflicts_of(before, sorted(moved), revision))
            return Changes.model_construct(set(fields), **{field: getattr(earlier, field) for field in fields})

        return self._save(undone.capture, decide, author, f"undo of edit {revision}", undoes=revision)

    def next_undo(self, capture_id: str) -> int | None:
        """Return the newest revision that can be undone, None where there is none.

        It is neither an undo nor undone, and changes more than the note.
        """
        history = self.history(capture_id)
        undone = set[int]()
        for item in reversed(history):
            if item.undoes is not None and item.number not in undone:
                undone.add(item.undoes)
            is_undoable = item.undoes is None and item.number not in undone and set(item.fields) != {"note"}
            if is_undoable:
                return item.number
        return None

    def discard(self, capture_id: str, author: str) -> Revision | None:
        """Take all edits of a capture back, even damaged ones, whose notes are lost; None where there are none."""
        nothing = Changes.model_construct(set(EditedFields.model_fields))
        return self._save(capture_id, lambda before: nothing, author, "all edits taken back", or_damaged=True)

    def _save(
        self,
        capture_id: str,
        decide: Decision,
        author: str,
        sentence: str,
        undoes: int | None = None,
        or_damaged: bool = False,
    ) -> Revision | None:
        check_name(capture_id, "capture")
        author, token = _line(author, "the author's name"), uuid4().hex
        sentence = _line(sentence, "the sentence") if sentence else ""

        def change() -> Revision | None:
            records.open_branch(self._index)
            session = self._index.writable_session(records.BRANCH)
            newest = records.commit_at(self._index, self.object_id, session.snapshot_id)
            records.tag(self._index, newest)
            if newest.token == token:
                return newest.revision  # saved, though an object store's answer was lost
            before, fields = self._before(newest, capture_id, or_damaged)
            changes = decide(before)
            fields += [field for field in differing(before, changes, changes.changed) if field not in fields]
            if not fields and changes.note is None:
                return None
            revision = Revision(
                number=newest.number + 1,
                capture=capture_id,
                author=author,
                time=datetime.now(UTC),
                sentence=sentence or sentence_of(before, changes, fields, changes.note),
                fields=(*fields, *(["note"] if changes.note is not None else [])),
                undoes=undoes,
            )
            seals = {} if newest.revision is None else newest.revision.seals
            seal = write_edits(session.store, self.object_id, merged(before, changes, revision))
            revision = revision.model_copy(update={"seals": {**seals, capture_id: seal}})
            snapshot = records.commit(session, self.object_id, revision, token)
            # It is saved. Whatever keeps its tag from being set, the next writer sets it.
            with suppress(icechunk.IcechunkError):
                records.tag(self._index, RevisionCommit(snapshot, revision, token))
            return revision

        return transaction(self.location, self.object_id, f"saving edits of {capture_id}", change)

    def _before(self, newest: RevisionCommit, capture_id: str, or_damaged: bool) -> tuple[CaptureEdits, list[str]]:
        """Return the newest edits of a capture, and the fields that change in any case, since they are damaged."""
        try:
            return read_edits(self._index, self.object_id, newest, capture_id), []
        except DamagedError:
            if not or_damaged:
                raise
            return CaptureEdits(capture=capture_id, revision=newest.number), list(EditedFields.model_fields)

    def _newest(self) -> RevisionCommit | None:
        with self._errors("reading the edits"):
            return records.newest_commit(self._index, self.object_id)

    def _name(self, capture_id: str) -> str:
        return f"{self.object_id}/{capture_id}"

    @contextmanager
    def _errors(self, action: str) -> Iterator[None]:
        with index_errors(self.location.uri, action, self.object_id):
            yield


def _line(text: str, name: str) -> str:
    try:
        return _LINE.validate_python(text)
    except ValidationError as error:
        raise InputError(f"{name} {text[:60]!r} cannot be used", "write one line of at most 200 characters") from error
