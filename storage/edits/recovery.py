"""Recovery of edits whose newest snapshot cannot be read: a new revision with the content of the newest that can."""

from datetime import UTC, datetime
from uuid import uuid4

import icechunk

from glint.storage.edits import records
from glint.storage.edits.contents import read_edits, write_edits
from glint.storage.edits.models import EditedFields, Revision
from glint.storage.edits.records import RevisionCommit
from glint.storage.errors import DamagedError
from glint.storage.versions.garbage import new_branch_name
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.snapshots import index_errors, read_session
from glint.storage.versions.transaction import transaction

AUTHOR = "glint verify --repair"


def recover(repository: ObjectRepository) -> str:
    """Go back to the newest edits whose snapshot can be read; return what was done, empty where nothing had to be.

    Later edits stay in the history. Without this, no edit could be saved on top of a snapshot that is lost.

    Raises:
        StoreError: the store cannot be written.
    """
    return transaction(
        repository.location, repository.object_id, "recovering edits", lambda: _recover(repository, repository.index)
    )


def _recover(repository: ObjectRepository, index: icechunk.Repository) -> str:
    object_id, commits = repository.object_id, records.commits(index, repository.object_id)
    if not commits or _is_readable(repository, commits[-1]):
        return ""
    newest, base = commits[-1], next(filter(lambda item: _is_readable(repository, item), reversed(commits)), None)
    assert newest.revision is not None
    number, name = newest.number + 1, "the first" if base is None else f"edit {base.number}"
    capture = newest.revision.capture
    dropped = commits if base is None else commits[commits.index(base) + 1 :]
    captures = sorted({item.revision.capture for item in dropped if item.revision is not None} - {capture})
    also = f"; those of {', '.join(captures)} too" if captures else ""
    revision = Revision(
        number=number,
        capture=capture,
        author=AUTHOR,
        time=datetime.now(UTC),
        sentence=f"back to {'before ' * (base is None)}{name}, since edit {newest.number} is damaged{also}",
        fields=tuple(EditedFields.model_fields),
    )
    branch = new_branch_name()
    index.create_branch(branch, records.first_snapshot(index) if base is None else base.snapshot)
    try:
        session = index.writable_session(branch)
        content = read_edits(index, object_id, base, capture).model_copy(update={"revision": number})
        seals = {} if base is None or base.revision is None else base.revision.seals
        seal = write_edits(session.store, object_id, content)
        revision = revision.model_copy(update={"seals": {**seals, capture: seal}})
        token = uuid4().hex
        snapshot = records.commit(session, object_id, revision, token)
        index.reset_branch(records.BRANCH, snapshot, from_snapshot_id=newest.snapshot)
    finally:
        index.delete_branch(branch)
    records.tag(index, RevisionCommit(snapshot, revision, token))
    return f"edits of {object_id}: {revision.sentence}"


def _is_readable(repository: ObjectRepository, commit: RevisionCommit) -> bool:
    """Return whether the snapshot of a revision can be read."""
    try:
        with index_errors(repository.location.uri, f"reading edit {commit.number}", repository.object_id):
            read_session(repository.index, repository.object_id, commit.snapshot)
    except DamagedError:
        return False
    return True
