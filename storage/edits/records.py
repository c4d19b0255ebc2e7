"""Revisions of an object's edits in its repository: commits on the branch `edits`, and a tag e1, e2, .. on each.

The tags keep the history from garbage collection, which shortens that of a branch. The commit comes first and makes the
revision; where its writer died before the tag, the next writer sets it. A commit's metadata hold the revision, sealed.
"""

import re
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import icechunk
from pydantic import ValidationError

from glint.storage.edits.models import Revision
from glint.storage.errors import StoreError
from glint.storage.seals import SEAL, is_sealed, sealed
from glint.storage.versions.snapshots import index_damage

BRANCH = "edits"


@dataclass(frozen=True, slots=True)
class RevisionCommit:
    """A snapshot of the branch: its revision (None: it was just created), and the token of its writer."""

    snapshot: str
    revision: Revision | None = None
    token: str = ""

    @property
    def number(self) -> int:
        """The revision's number, 0 before the first."""
        return 0 if self.revision is None else self.revision.number


def open_branch(repository: icechunk.Repository) -> None:
    """Create the branch where it is absent, from the empty snapshot with which the repository began."""
    if BRANCH not in repository.list_branches():
        with suppress(icechunk.AlreadyExistsError):
            repository.create_branch(BRANCH, first_snapshot(repository))


def first_snapshot(repository: icechunk.Repository) -> str:
    """Return the id of the empty snapshot with which a repository began."""
    *_, first = repository.ancestry(branch="main")
    return str(first.id)


def newest_commit(repository: icechunk.Repository, object_id: str) -> RevisionCommit | None:
    """Return the newest revision's commit, None where nothing was ever edited.

    Raises:
        DamagedError: its record is not what was written, or it is lost.
    """
    numbers = _tagged(repository)
    newest = None
    if BRANCH in repository.list_branches():
        newest = commit_at(repository, object_id, repository.lookup_branch(BRANCH))
    number = 0 if newest is None else newest.number
    expected = {len(numbers), len(numbers) + 1}  # the tag of the newest may not be set yet
    if numbers != list(range(1, len(numbers) + 1)) or ((numbers or number) and number not in expected):
        present = {*numbers, number}
        lost = next(number for number in range(1, max(present) + 2) if number not in present)
        raise index_damage("", object_id, f"it has lost edit {min(lost, max(present))}")
    return newest if number else None


def commits(repository: icechunk.Repository, object_id: str) -> list[RevisionCommit]:
    """Return the commits of all revisions, oldest first.

    Raises:
        DamagedError: a record is not what was written, or is lost.
    """
    newest = newest_commit(repository, object_id)
    if newest is None:
        return []
    return [*(_tagged_commit(repository, object_id, number) for number in range(1, newest.number)), newest]


def commit_of(repository: icechunk.Repository, object_id: str, number: int) -> RevisionCommit:
    """Return the commit of a revision by its number.

    Raises:
        StoreError: there is none; DamagedError: its record is not what was written.
    """
    newest = newest_commit(repository, object_id)
    if newest is None or not 1 <= number <= newest.number:
        absence = "no edits" if newest is None else f"edits 1 to {newest.number}, not {number}"
        raise StoreError(f"{object_id} has {absence}", f"see `glint history {object_id}`")
    return newest if number == newest.number else _tagged_commit(repository, object_id, number)


def _tagged_commit(repository: icechunk.Repository, object_id: str, number: int) -> RevisionCommit:
    stored = commit_at(repository, object_id, repository.lookup_tag(_tag(number)))
    if stored.number != number:
        raise index_damage("", object_id, f"its edit {number} is edit {stored.number}")
    return stored


def commit_at(repository: icechunk.Repository, object_id: str, snapshot_id: str) -> RevisionCommit:
    """Return the commit that a snapshot is.

    Raises:
        DamagedError: its record is not what was written.
    """
    snapshot = repository.lookup_snapshot(snapshot_id)
    facts: dict[str, Any] = dict(snapshot.metadata)
    if SEAL not in facts and snapshot.parent_id is None:
        return RevisionCommit(snapshot_id)
    if snapshot.id != snapshot_id or not is_sealed(facts) or facts.get("object") != object_id:
        raise index_damage("", object_id, "the record of an edit is not what was written")
    try:
        # The library gives lists and numbers as they are in JSON, and times as text.
        revision = Revision.model_validate(facts.get("revision"), strict=False)
    except ValidationError as error:
        raise StoreError(f"edits of {object_id} were written by another version of Glint", "update Glint") from error
    return RevisionCommit(snapshot_id, revision, str(facts.get("token", "")))


def tag(repository: icechunk.Repository, commit: RevisionCommit) -> None:
    """Set the tag of a revision where it is absent."""
    if commit.number and _tag(commit.number) not in repository.list_tags():
        with suppress(icechunk.AlreadyExistsError):
            repository.create_tag(_tag(commit.number), commit.snapshot)


def commit(session: icechunk.Session, object_id: str, revision: Revision, token: str) -> str:
    """Commit what a session of the branch holds as this revision; return the snapshot's id.

    Raises:
        icechunk.ConflictError: another writer was faster.
    """
    facts = {"object": object_id, "token": token, "revision": revision.model_dump(mode="json")}
    return str(session.commit(f"edit {revision.number}: {revision.sentence}", sealed(facts)))


def _tag(number: int) -> str:
    return f"e{number}"


def _tagged(repository: icechunk.Repository) -> list[int]:
    """Return the numbers of the revisions that have a tag, in order."""
    return sorted(int(name[1:]) for name in repository.list_tags() if re.fullmatch(r"e[1-9]\d*", name))
