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
    assert set(batch.submissions) == {"a"}
    assert load(batch.catalogue).object("a").capture("front").frames == f"{inbox.location.path}/tray/a.mp4"
    assert list(scan.problems) == ["bad"] and "schema" in scan.problems["bad"]
    finish(inbox, scan)
    assert inbox.scan(AT_ONCE).batches == () and list(inbox.scan(AT_ONCE).problems) == ["bad"]


def test_two_sub_folders_never_share_an_object(inbox: Inbox) -> None:
    put(inbox, "Wine Glass/a.mp4", "wine-glass/b.mp4")
    scan = inbox.scan(AT_ONCE)
    assert objects(scan) == {"wine-glass"}
    assert scan.problems == {"wine-glass": "contains the object wine-glass, as Wine Glass does: rename one of them"}


def test_a_later_sub_folder_never_takes_an_object_of_a_finished_one(inbox: Inbox) -> None:
    put(inbox, "wine-glass/b.mp4")
    finish(inbox, inbox.scan(AT_ONCE))
    put(inbox, "Wine Glass/a.mp4", "cup/a.mp4")
    scan = inbox.scan(AT_ONCE)
    assert objects(scan) == {"cup"}
    assert scan.problems == {"Wine Glass": "contains the object wine-glass, as wine-glass does: rename one of them"}


def test_the_common_catalogue_keeps_what_is_finished(inbox: Inbox) -> None:
    put(inbox, "duck/video.mp4", "gone/video.mp4")
    finish(inbox, inbox.scan(AT_ONCE))
    (Path(inbox.location.path) / "gone" / "video.mp4").unlink()
    put(inbox, "fish/video.mp4")
    (batch,) = inbox.scan(AT_ONCE).batches
    assert set(batch.submissions) == {"fish"}
    assert {item.id for item in load(batch.catalogue).objects} == {"duck", "fish"}


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


@pytest.mark.parametrize(
    "frames",
    ["/etc/hostname", "../other/a.mp4", "link.mp4", "folder", "shots/*.png", "s3://other/a.mp4", "../*/a.mp4"],
)
def test_a_catalogue_names_files_of_its_own_folder_alone(inbox: Inbox, tmp_path: Path, frames: str) -> None:
    text = f"schema: 1\nname: x\nobjects:\n- {{id: a, captures: [{{id: front, frames: '{frames}'}}]}}\n"
    put(inbox, "tray/catalogue.yaml", data=text.encode())
    put(inbox, "other/a.mp4", "other/b.png", "other/c.png", "tray/shots/a.png")
    other, tray = Path(inbox.location.path) / "other", Path(inbox.location.path) / "tray"
    (tray / "link.mp4").symlink_to(other / "a.mp4")
    (tray / "folder").symlink_to(other)
    (tray / "shots" / "b.png").symlink_to(other / "b.png")
    scan = inbox.scan(AT_ONCE)
    assert objects(scan) == {"other"} and set(scan.problems) == {"tray"}
    assert "a/front: frames" in scan.problems["tray"] and "--inbox-may-read" in scan.problems["tray"]


@pytest.mark.parametrize("key", ["mask", "lights", "markup", "truth"])
def test_every_file_of_a_capture_is_its_own(inbox: Inbox, key: str) -> None:
    text = f"schema: 1\nname: x\nobjects:\n- {{id: a, captures: [{{id: front, frames: a.mp4, {key}: /etc}}]}}\n"
    put(inbox, "tray/a.mp4")
    put(inbox, "tray/catalogue.yaml", data=text.encode())
    assert f"a/front: {key} /etc leads out of" in inbox.scan(AT_ONCE).problems["tray"]


def test_links_of_a_sub_folder_without_a_catalogue_are_followed_inside_alone(inbox: Inbox, tmp_path: Path) -> None:
    put(inbox, "duck/notes.txt", "fish/real.mp4", "cat/a.mp4", "dog/a.txt")
    place = Path(inbox.location.path)
    (tmp_path / "secret.mp4").write_bytes(b"x")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "a.mp4").write_bytes(b"x")
    (place / "duck" / "video.mp4").symlink_to(tmp_path / "secret.mp4")
    (place / "fish" / "video.mp4").symlink_to(place / "fish" / "real.mp4")
    (place / "linked").symlink_to(tmp_path / "elsewhere")
    (place / "dog" / "catalogue.yaml").symlink_to("/etc/passwd")
    scan = inbox.scan(AT_ONCE)
    assert objects(scan) == {"fish", "cat"} and not {"duck", "dog"} & objects(scan)
    assert {"duck", "dog"} <= set(scan.problems) and "root:" not in scan.problems["dog"]


def test_a_folder_can_be_allowed(tmp_path: Path) -> None:
    (tmp_path / "masks").mkdir()
    (tmp_path / "masks" / "a.png").write_bytes(b"x")
    capture = f"{{id: front, frames: a.mp4, mask: {tmp_path}/masks/a.png}}"
    text = f"schema: 1\nname: x\nobjects:\n- {{id: a, captures: [{capture}]}}\n"
    inbox = Inbox(str(tmp_path / "inbox"), str(tmp_path / "store"), allowed=[str(tmp_path / "masks")])
    put(inbox, "tray/a.mp4")
    put(inbox, "tray/catalogue.yaml", data=text.encode())
    assert objects(inbox.scan(AT_ONCE)) == {"a"}
    assert set(Inbox(inbox.location.path, str(tmp_path / "store")).scan(AT_ONCE).problems) == {"tray"}


def test_what_was_checked_is_what_runs(inbox: Inbox) -> None:
    text = "schema: 1\nname: x\nparameters: {labels: {method: sheets}}\n"
    text += "objects:\n- {id: a, captures: [{id: f, frames: %s}]}\n"
    put(inbox, "tray/a.mp4")
    put(inbox, "tray/catalogue.yaml", data=(text % "a.mp4").encode())
    (batch,) = inbox.scan(AT_ONCE).batches
    put(inbox, "tray/catalogue.yaml", data=(text % "/etc/hostname").encode())
    catalogue = load(batch.catalogue)
    assert catalogue.object("a").capture("f").frames == f"{inbox.location.path}/tray/a.mp4"
    assert catalogue.parameters == {"labels": {"method": "sheets"}}


def test_a_sub_folder_of_any_name_leaves_the_others_alone(inbox: Inbox) -> None:
    own = "schema: 1\nname: own\nobjects:\n  - id: {}\n    captures:\n      - id: front\n        frames: video.mp4\n"
    long = "n" * 252
    for name, object_id in (("catalogue", "bowl"), (long, "cup"), ("set", "jug")):
        put(inbox, f"{name}/video.mp4")
        put(inbox, f"{name}/catalogue.yaml", data=own.format(object_id).encode())
    put(inbox, "duck/video.mp4")
    scan = inbox.scan(AT_ONCE)
    assert objects(scan) == {"bowl", "jug", "duck"} and set(scan.problems) == {long}
    for batch in scan.batches:
        assert {item.id for item in load(batch.catalogue).objects} == set(batch.submissions)
