"""Verification names what is damaged; repair brings back what does not need the catalogue."""

import shutil
from pathlib import Path

import icechunk
import numpy as np
import pytest
import zarr

from glint.storage.edits.edits import Edits
from glint.storage.edits.models import Changes
from glint.storage.errors import DamagedError, StoreError
from glint.storage.locations.location import Location
from glint.storage.locking.locks import run_lock
from glint.storage.maintenance.repair import repair
from glint.storage.maintenance.verify import Damage, _with_remedy, verify_store
from glint.storage.versions.opening import open_or_create
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.verification import Verification, verify_capture
from tests.damage.damage import build, problems, served


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store of two objects and the frames of two videos."""
    return build(tmp_path_factory.mktemp("built"))


@pytest.fixture
def store(built: Path, tmp_path: Path) -> Path:
    """A copy of it, to be damaged."""
    return Path(shutil.copytree(built, tmp_path / "store"))


def _flip(path: Path, place: int = -1) -> None:
    data = bytearray(path.read_bytes())
    data[place] ^= 1
    path.write_bytes(data)


def _largest(folder: Path) -> Path:
    return max(folder.iterdir(), key=lambda path: path.stat().st_size)


def test_a_whole_store_is_whole(store: Path) -> None:
    steps: list[tuple[int, int]] = []
    outcome = verify_store(Location.parse(store), frames=True, progress=lambda *step: steps.append(step))
    assert outcome.damages == ()
    assert outcome.objects == 2
    assert outcome.versions == 4
    assert outcome.bytes > 500_000
    assert steps == [(number, len(steps)) for number in range(1, len(steps) + 1)]
    assert "no damage found" in outcome.summary


def test_what_has_not_begun_is_left_unread_after_an_interrupt(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    location, read = Location.parse(store), list[str]()

    def counted(repository: ObjectRepository, capture: str, ref: str) -> Verification:
        read.append(capture)
        return verify_capture(repository, capture, ref)

    def interrupt(done: int, total: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("glint.storage.maintenance.verify.verify_capture", counted)
    verify_store(location, ["vase"])
    captures = len(read)
    read.clear()
    with pytest.raises(KeyboardInterrupt):
        verify_store(location, ["vase"] * 100, progress=interrupt)
    assert 0 < len(read) < 50 * captures


def test_a_damaged_chunk_is_named_in_each_version_that_holds_it(store: Path) -> None:
    _flip(_largest(store / "objects" / "vase" / "repo" / "chunks"))
    damages = verify_store(Location.parse(store)).damages
    assert {damage.object_id for damage in damages} == {"vase"}
    assert {damage.version for damage in damages} <= {"v1", "v2", "work"}
    needed = bool({"v2", "work"} & {damage.version for damage in damages})
    for damage in damages:
        place = "" if damage.version == "work" else f" in {damage.version}"
        assert damage.message.startswith(("array '", "file '"))
        assert f"{place} is damaged (" in damage.message
        assert ("glint verify vase --repair" if needed else "only a backup brings v1 back") in damage.remedy
    assert verify_store(Location.parse(store), ["wine-glass"]).damages == ()


def test_a_lost_index_is_named_and_restored_from_its_newest_copy(store: Path) -> None:
    location, index = Location.parse(store), store / "objects" / "vase" / "repo" / "repo"
    before = ObjectRepository.open(location, "vase").version_names()
    for damage in (index.unlink, lambda: index.write_bytes(b"")):
        damage()
        with pytest.raises(DamagedError, match=r"index of object vase.*verify vase --repair"):
            ObjectRepository.open(location, "vase", create=False)
        (found,) = verify_store(location).damages
        assert (found.object_id, found.version) == ("vase", "")
        assert repair(location, (found,)) == ["restored the index of vase as it was before its last change"]
        assert ObjectRepository.open(location, "vase").version_names() == before
        assert verify_store(location).damages == ()


def test_a_snapshot_in_the_place_of_another_is_never_read(store: Path, tmp_path: Path) -> None:
    everything = served(store, ["work"], ["vase"], tmp_path)
    index = icechunk.Repository.open(Location.parse(store).child("objects", "vase", "repo").icechunk_storage())
    folder = store / "objects" / "vase" / "repo" / "snapshots"
    newest = folder / index.lookup_branch("work")
    noticed, earlier = 0, [path for path in folder.iterdir() if path != newest]
    for path in earlier:
        newest.write_bytes(path.read_bytes())
        after = served(store, ["work"], ["vase"], tmp_path)
        assert problems(everything, after) == [], path.name
        noticed += any(isinstance(value, DamagedError) for value in after.values())
    assert noticed == len(earlier) > 5


def test_damaged_frames_are_found_on_request_and_removed(store: Path) -> None:
    location = Location.parse(store)
    for name in "ab":
        (store / "frames" / name).rename(store / "frames" / (name * 64))
    assert verify_store(location).damages == ()
    damages = verify_store(location, frames=True).damages  # their names are not those in their attributes
    assert {damage.frames for damage in damages} == {"a" * 64, "b" * 64}
    repair(location, damages)
    assert verify_store(location, frames=True).damages == ()


def test_a_store_or_object_that_is_not_there_is_not_called_whole(store: Path, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="there is no store"):
        verify_store(Location.parse(tmp_path / "absent"))
    with pytest.raises(StoreError, match="no object cup"):
        verify_store(Location.parse(store), ["cup"])


def test_an_object_that_cannot_be_read_does_not_hide_the_damage_of_another(store: Path) -> None:
    location = Location.parse(store)
    (store / "objects" / "cup").mkdir()
    foreign = location.child("objects", "foreign", "repo")
    session = open_or_create(foreign, "foreign").writable_session("work")
    zarr.open_group(session.store, mode="a").attrs["layout"] = 99
    session.commit("written by another version")
    written = open_or_create(foreign, "foreign").lookup_branch("work")
    (store / "objects" / "vase" / "repo" / "repo").unlink()
    outcome = verify_store(location)
    assert [(damage.object_id, damage.version) for damage in outcome.damages] == [
        ("cup", ""), ("foreign", ""), ("vase", ""),
    ]  # fmt: skip
    assert outcome.objects == 4 and outcome.versions == 2 and outcome.bytes > 0
    cup, other, vase = repair(location, outcome.damages)
    assert "left cup alone" in cup and "no object cup" in cup
    assert "left foreign alone" in other and "newer version of Glint" in other
    assert "restored the index of vase" in vase
    assert open_or_create(foreign, "foreign").lookup_branch("work") == written
    assert {damage.object_id for damage in verify_store(location).damages} == {"cup", "foreign"}
    with pytest.raises(StoreError, match="no object cup"):
        verify_store(location, ["cup"])
    with run_lock(location, "cup", "its first run"):
        assert {damage.object_id for damage in verify_store(location).damages} == {"foreign"}


def test_an_index_without_a_copy_is_reported(store: Path) -> None:
    folder = store / "objects" / "vase" / "repo"
    (folder / "repo").write_bytes(b"")
    for path in (folder / "overwritten").iterdir():
        path.write_bytes(b"")
    (text,) = repair(Location.parse(store), (Damage("vase", "", "", ""),))
    assert "no whole copy: restore a backup" in text
    with pytest.raises(StoreError):
        ObjectRepository.open(Location.parse(store), "vase", create=False)


def test_only_a_backup_brings_an_old_version_back() -> None:
    old, newest = (Damage("vase", version, "a file is damaged", "repair it") for version in ("v1", "v2"))
    assert _with_remedy(old, [old], ["v1", "v2"]).remedy == "v2 is whole; only a backup brings v1 back"
    assert _with_remedy(old, [old, newest], ["v1", "v2"]) == old
    assert _with_remedy(newest, [old, newest], ["v1", "v2"]) == newest


def _save_edits(store: Path) -> None:
    edits = Edits.open(Location.parse(store), "wine-glass")
    for number in range(2):
        noise = np.random.default_rng(number).random((100, 150)) < 0.5
        edits.save("front", Changes(mask=noise), "Ann", number)


def test_edits_are_verified_too(store: Path) -> None:
    before = set((store / "objects/wine-glass/repo/chunks").iterdir())
    _save_edits(store)
    assert not verify_store(Location.parse(store)).damages
    chunks = set((store / "objects/wine-glass/repo/chunks").iterdir()) - before
    first, second = sorted(chunks, key=lambda path: path.stat().st_mtime_ns)
    _flip(first)
    _flip(second)
    old, new = verify_store(Location.parse(store)).damages
    assert (old.version, new.version, old.is_edit) == ("edit 1", "edit 2", True)
    assert "of wine-glass/front/edits in edit 1 is damaged" in old.message
    assert old.remedy == "the newest edits do not need it; only a backup brings edit 1 back"
    assert "--discard" in new.remedy


@pytest.mark.parametrize("lost", [1, 2])
def test_edits_whose_snapshot_is_lost_go_back_to_those_before(store: Path, lost: int) -> None:
    """Else nobody could edit the object, or run it, any more."""
    _save_edits(store)
    location = Location.parse(store)
    index = ObjectRepository.open(location, "wine-glass").index
    snapshots = store / "objects/wine-glass/repo/snapshots"
    for number in range(3 - lost, 3):
        (snapshots / index.lookup_tag(f"e{number}")).write_bytes(b"")
    with pytest.raises(DamagedError):
        Edits.open(location, "wine-glass").save("back", Changes(verdict="good"), "Ann", 2)
    damages = verify_store(location).damages
    assert [damage.version for damage in damages] == [f"edit {number}" for number in range(3 - lost, 3)]
    assert "glint verify wine-glass --repair" in damages[-1].remedy
    (done,) = repair(location, damages)
    assert done.endswith("since edit 2 is damaged")
    edits = Edits.open(location, "wine-glass")
    assert [item.number for item in edits.history()] == [1, 2, 3]
    current = edits.current("front")
    if lost == 1:
        np.testing.assert_array_equal(current.mask, np.random.default_rng(0).random((100, 150)) < 0.5)
    else:
        assert current.edited == ()
    assert edits.save("back", Changes(verdict="good"), "Ann", 3) is not None
    assert repair(location, verify_store(location).damages) == [], "all that is newest is whole"


def test_a_lost_edit_costs_no_results(store: Path) -> None:
    _save_edits(store)
    location = Location.parse(store)
    index = ObjectRepository.open(location, "wine-glass").index
    index.reset_branch("work", index.lookup_tag("e1"))
    work, tags = index.lookup_branch("work"), index.list_tags()
    index.delete_tag("e1")
    (done,) = repair(location, (Damage("wine-glass", "", "", ""),))
    assert "left the edits of wine-glass alone" in done
    index = ObjectRepository.open(location, "wine-glass").index
    assert index.lookup_branch("work") == work and index.list_tags() == tags - {"e1"}


def test_all_captures_whose_edits_go_back_are_named(store: Path) -> None:
    _save_edits(store)
    location = Location.parse(store)
    edits = Edits.open(location, "wine-glass")
    edits.save("back", Changes(verdict="good"), "Ann", 2)
    edits.save("front", Changes(verdict="good"), "Ann", 3)
    index = ObjectRepository.open(location, "wine-glass").index
    for number in (3, 4):
        (store / "objects/wine-glass/repo/snapshots" / index.lookup_tag(f"e{number}")).write_bytes(b"")
    (done,) = repair(location, verify_store(location).damages)
    assert done.endswith("back to edit 2, since edit 4 is damaged; those of back too")
