"""Scans of an inbox: new, changed, unfinished and unusable sub-folders."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from glint.storage.catalogue.loading import load
from glint.storage.errors import InputError
from glint.storage.inbox import Inbox, InboxScan

AT_ONCE = timedelta(0)


@pytest.fixture
def inbox(tmp_path: Path) -> Inbox:
    (tmp_path / "inbox").mkdir()
    return Inbox(str(tmp_path / "inbox"), str(tmp_path / "store"))


def put(inbox: Inbox, *names: str, data: bytes = b"x") -> None:
    for name in names:
        path = Path(inbox.location.path) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


def objects(scan: InboxScan) -> set[str]:
    return {name for batch in scan.batches for name in batch.submissions}


def finish(inbox: Inbox, scan: InboxScan, *failed: str) -> None:
    inbox.finish([item for batch in scan.batches for name, item in batch.submissions.items() if name not in failed])


def test_only_new_or_changed_sub_folders_are_run(inbox: Inbox) -> None:
    put(inbox, "Duck/video.mp4", "glass/a/1.png", "glass/a/2.png", "notes.txt", ".hidden/video.mp4", "empty/notes.txt")
    first = inbox.scan(AT_ONCE)
    assert objects(first) == {"duck", "glass"}
    assert (first.problems, first.waiting, first.empty, first.unchanged) == ({}, (), ("empty",), 0)
    catalogue = load(first.batches[0].catalogue)
    assert catalogue.object("duck").captures[0].frames == f"{inbox.location.path}/Duck/video.mp4"
    finish(inbox, first, "glass")
    assert objects(inbox.scan(AT_ONCE)) == {"glass"}
    finish(inbox, inbox.scan(AT_ONCE))
    assert inbox.scan(AT_ONCE).batches == ()
    assert inbox.scan(AT_ONCE).unchanged == 2
    put(inbox, "Duck/video.mp4", data=b"longer")
    put(inbox, "fish/video.mp4")
    assert objects(inbox.scan(AT_ONCE)) == {"duck", "fish"}
    put(inbox, "glass/a/mask.png")
    assert objects(inbox.scan(AT_ONCE)) == {"duck", "fish", "glass"}


def test_a_recently_changed_sub_folder_waits(inbox: Inbox) -> None:
    put(inbox, "duck/video.mp4")
    now = datetime.now(UTC)
    early = inbox.scan(timedelta(minutes=10), now)
    assert (early.batches, early.waiting) == ((), ("duck",))
    assert objects(inbox.scan(timedelta(minutes=10), now + timedelta(minutes=11))) == {"duck"}


def test_a_sub_folder_with_a_catalogue_is_run_by_it(inbox: Inbox) -> None:
    text = "schema: 1\nname: two\nobjects:\n- {id: a, captures: [{id: front, frames: a.mp4}]}\n"
    put(inbox, "tray/a.mp4", "tray/b.mp4")
    put(inbox, "tray/catalogue.yaml", data=text.encode())
    put(inbox, "bad/catalogue.yaml", data=b"schema: 2\n")
    scan = inbox.scan(AT_ONCE)
    (batch,) = scan.batches
    assert batch.catalogue == f"{inbox.location.path}/tray/catalogue.yaml" and set(batch.submissions) == {"a"}
    assert list(scan.problems) == ["bad"] and "schema" in scan.problems["bad"]
    finish(inbox, scan)
    assert inbox.scan(AT_ONCE).batches == () and list(inbox.scan(AT_ONCE).problems) == ["bad"]


def test_two_sub_folders_never_share_an_object(inbox: Inbox) -> None:
    put(inbox, "Wine Glass/a.mp4", "wine-glass/b.mp4")
    scan = inbox.scan(AT_ONCE)
    assert objects(scan) == {"wine-glass"}
    assert scan.problems == {"wine-glass": "contains the object wine-glass, as Wine Glass does: rename one of them"}


def test_records_of_removed_sub_folders_are_dropped(inbox: Inbox) -> None:
    put(inbox, "duck/video.mp4", "fish/video.mp4")
    finish(inbox, inbox.scan(AT_ONCE))
    (Path(inbox.location.path) / "duck" / "video.mp4").unlink()
    inbox.finish([])
    (memory,) = (Path(inbox.location.path).parent / "store" / "inbox").glob("*/finished.json")
    assert set(json.loads(memory.read_text())["finished"]) == {"fish"}
    memory.write_text("{")
    assert objects(inbox.scan(AT_ONCE)) == {"fish"}


def test_a_missing_inbox_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not a folder"):
        Inbox(str(tmp_path / "unmounted"), str(tmp_path / "store")).scan(AT_ONCE)
    assert not (tmp_path / "unmounted").exists()
