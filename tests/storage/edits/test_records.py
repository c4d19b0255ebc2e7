"""Revisions as commits: what nobody has sealed, what belongs to another object, and a tag that leads elsewhere."""

from datetime import UTC, datetime
from typing import Any

import icechunk
import pytest

from glint.storage.edits import records
from glint.storage.edits.edits import Edits
from glint.storage.edits.models import Changes, Revision
from glint.storage.errors import DamagedError, StoreError
from glint.storage.locations.location import Location
from glint.storage.seals import sealed
from glint.storage.versions.repository import ObjectRepository
from tests.storage.stores import local_store


@pytest.fixture
def location(tmp_path: Any) -> Location:
    return local_store(tmp_path / "store")


@pytest.fixture
def repository(location: Location) -> icechunk.Repository:
    """The repository of an object with the branch of edits, and no edit yet."""
    opened = ObjectRepository.open(location, "duck").index
    records.open_branch(opened)
    return opened


def facts(object_id: str) -> dict[str, Any]:
    """What the commit of a first revision says of itself."""
    revision = Revision(
        number=1,
        capture="front",
        author="Ann",
        time=datetime(2026, 1, 2, tzinfo=UTC),
        sentence="verdict: good",
        fields=("verdict",),
    )
    return {"object": object_id, "token": "t", "revision": revision.model_dump(mode="json")}


def commit(repository: icechunk.Repository, metadata: dict[str, Any]) -> None:
    session = repository.writable_session(records.BRANCH)
    session.commit("edit 1", metadata, allow_empty=True)


def test_what_a_commit_says_counts_with_its_seal_and_of_its_own_object_alone(repository: icechunk.Repository) -> None:
    base = repository.lookup_branch(records.BRANCH)
    for metadata in (facts("duck"), sealed(facts("duck")) | {"token": "other"}, sealed(facts("goose"))):
        commit(repository, metadata)
        with pytest.raises(DamagedError, match="not what was written"):
            records.newest_commit(repository, "duck")
        repository.reset_branch(records.BRANCH, base)
    commit(repository, sealed(facts("duck")))
    newest = records.newest_commit(repository, "duck")
    assert newest is not None and (newest.number, newest.token) == (1, "t")


def test_a_tag_that_leads_to_another_edit_is_damage(location: Location, repository: icechunk.Repository) -> None:
    repository.create_tag("e1", records.first_snapshot(repository))
    edits = Edits.open(location, "duck")
    edits.save("front", Changes(verdict="good"), "Ann", 0)
    edits.save("front", Changes(verdict="usable"), "Ann", 1)
    for read in (edits.history, lambda: edits.current("front", 1)):
        with pytest.raises(DamagedError, match="its edit 1 is edit 0"):
            read()
    assert edits.current("front").verdict == "usable"


def test_an_object_without_edits_has_none_of_any_number(location: Location, repository: icechunk.Repository) -> None:
    with pytest.raises(StoreError, match="duck has no edits"):
        Edits.open(location, "duck").undo(1, "Ann")
