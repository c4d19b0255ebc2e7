"""Scans of an inbox: new, changed, unfinished and unusable sub-folders."""

import json
import os
import shutil
from datetime import UTC, datetime, timedelta
from pathlib import Path
from time import sleep

import obstore
import pytest
from obstore.exceptions import GenericError
from obstore.store import LocalStore

from glint.storage.catalogue.loading import load
from glint.storage.errors import InputError
from glint.storage.inbox import Inbox, InboxScan
from glint.storage.locations.input_files import expand
from glint.storage.locations.location import Location
from glint.storage.submissions import _local_files, list_submissions
from glint.storage.versions.repository import ObjectRepository

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


def test_names_in_other_letters_are_objects_of_their_own(inbox: Inbox) -> None:
    put(inbox, "Große Vase/Ansicht schräg.mp4", "花瓶/video.mp4", "皿/video.mp4")
    scan = inbox.scan(AT_ONCE)
    assert scan.problems == {} and len(objects(scan)) == 3
    (captures,) = (item.captures for item in load(scan.batches[0].catalogue).objects if item.id == "grosse-vase")
    assert captures[0].id == "ansicht-schrag"


def test_an_object_keeps_the_ids_that_it_has_in_the_store(inbox: Inbox) -> None:
    put(inbox, "Große Vase/Ansicht schräg.mp4", "Ölkännchen/video.mp4")
    store = Location.parse(str(Path(inbox.location.path).parent / "store"))
    stored = ObjectRepository.open(store, "gro-e-vase")
    stored.save("ansicht-schr-g", "survey", "key", {}, {})
    assert objects(inbox.scan(AT_ONCE)) == {"gro-e-vase", "olkannchen"}
    entry = {"frames": f"{inbox.location.path}/Große Vase/Ansicht schräg.mp4"}
    stored.publish(["ansicht-schr-g"], {"captures": {"ansicht-schr-g": {"entry": entry}}})
    assert objects(inbox.scan(AT_ONCE)) == {"gro-e-vase", "olkannchen"}
    ObjectRepository.open(store, "lk-nnchen").save("another", "survey", "key", {}, {})
    assert objects(inbox.scan(AT_ONCE)) == {"gro-e-vase", "olkannchen"}, "another object has that id"


def test_a_recently_changed_sub_folder_waits(inbox: Inbox) -> None:
    put(inbox, "duck/video.mp4")
    now = datetime.now(UTC)
    early = inbox.scan(timedelta(minutes=10), now)
    assert (early.batches, early.waiting) == ((), ("duck",))
    assert objects(inbox.scan(timedelta(minutes=10), now + timedelta(minutes=11))) == {"duck"}


def test_a_copy_that_preserves_times_waits_and_a_wrong_clock_does_not(inbox: Inbox) -> None:
    put(inbox, "duck/video.mp4", "fish/video.mp4")
    now = datetime.now(UTC)
    for name, days in (("duck", -7), ("fish", 3650)):
        time = (now + timedelta(days=days)).timestamp()
        os.utime(Path(inbox.location.path) / name / "video.mp4", (time, time))
    assert inbox.scan(timedelta(minutes=10), now).waiting == ("duck", "fish")
    assert objects(inbox.scan(timedelta(minutes=10), now + timedelta(minutes=11))) == {"duck", "fish"}


def test_a_sub_folder_from_which_a_file_was_moved_waits(inbox: Inbox) -> None:
    """A folder's own change counts: a file that is left in it need not have changed."""
    put(inbox, "duck/a/video.mp4", "duck/a/video.part")
    before = max(path.stat().st_ctime for path in (Path(inbox.location.path) / "duck").rglob("*"))
    sleep(0.05)
    (Path(inbox.location.path) / "duck" / "a" / "video.part").unlink()
    (submission,) = inbox.submissions()[0]
    assert submission.changed.timestamp() > before


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
    shutil.rmtree(Path(inbox.location.path) / "duck")
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


def test_names_that_are_no_text_leave_the_others_alone(inbox: Inbox) -> None:
    odd = [os.fsdecode(name) for name in (b"gr\xfcn/video.mp4", b"vase/gr\xfcn.mp4")]
    put(inbox, "duck/video.mp4", "b\x07owl/\x1b[31mvideo.mp4", *odd)
    scan = inbox.scan(AT_ONCE)
    assert objects(scan) == {"duck", "b-owl"}
    assert set(scan.problems) == {name.partition("/")[0] for name in odd}
    assert all("rename the folder or the files in it" in problem for problem in scan.problems.values())


def test_brackets_in_the_names_of_folders_of_images_are_no_pattern(inbox: Inbox) -> None:
    put(inbox, "vase [2]/img_1.png", "vase [2]/img_2.png", "s*[x]?/a1.png", "s*[x]?/a2.png")
    scan = inbox.scan(AT_ONCE)
    assert objects(scan) == {"vase-2", "s-x"} and not scan.problems
    (batch,) = scan.batches
    for object_id, name in (("vase-2", "vase [2]/img_1.png"), ("s-x", "s*[x]?/a1.png")):
        files = expand(Location.parse(load(batch.catalogue).object(object_id).captures[0].frames), [".png"])
        assert files is not None and len(files) == 2 and files[0].uri == f"{inbox.location.path}/{name}"


def test_links_that_lead_in_circles_or_nowhere_leave_the_others_alone(inbox: Inbox) -> None:
    put(inbox, "duck/video.mp4", "vase/video.mp4")
    vase = Path(inbox.location.path) / "vase"
    for name, target in (("loop", ".."), ("itself", "itself"), ("nowhere.mp4", "gone.mp4")):
        (vase / name).symlink_to(target)
    os.mkfifo(vase / "pipe.mp4")
    scan = inbox.scan(AT_ONCE)
    assert objects(scan) == {"duck", "vase"} and not scan.problems


def test_a_sub_folder_that_cannot_be_listed_is_a_problem_and_stays_finished(
    inbox: Inbox, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(inbox, "duck/video.mp4", "vase/video.mp4")
    finish(inbox, inbox.scan(AT_ONCE))
    put(inbox, "fish/video.mp4")
    real = os.scandir

    def refused(path: str) -> object:
        if str(path).endswith("/vase"):
            raise PermissionError(13, "Permission denied", path)
        return real(path)

    with monkeypatch.context() as patched:
        patched.setattr(os, "scandir", refused)
        scan = inbox.scan(AT_ONCE)
        finish(inbox, scan)
    assert objects(scan) == {"fish"} and set(scan.problems) == {"vase"}
    assert "vase cannot be read (Permission denied): check its permissions" in scan.problems["vase"]
    assert inbox.scan(AT_ONCE).unchanged == 3


def test_the_sub_folders_of_a_prefix_are_listed_each_by_itself(
    inbox: Inbox, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    put(inbox, "duck/video.mp4", "a\\b/video.mp4", ".hidden/video.mp4", "notes.txt")
    monkeypatch.setattr(Location, "obstore", lambda self: LocalStore(tmp_path / self.path))
    (submission,), problems = list_submissions(Location.parse("s3://bucket/inbox"))
    assert submission.name == "duck" and datetime.now(UTC) - submission.changed < timedelta(minutes=1)
    assert set(problems) == {"a\\b"} and "use a plain name" in problems["a\\b"]


def test_a_prefix_is_listed_once_however_many_sub_folders_it_has(
    inbox: Inbox, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    put(inbox, "duck/a/video.mp4", "vase/catalogue.yaml", "vase/video.mp4", ".hidden/video.mp4", "notes.txt")
    (each, _), place = list_submissions(inbox.location), Location.parse("s3://bucket/inbox")
    listings = list[Location]()

    def opened(location: Location) -> LocalStore:
        listings.append(location)
        return LocalStore(tmp_path / location.path)

    monkeypatch.setattr(Location, "obstore", opened)
    together, problems = list_submissions(place)
    assert listings == [place] and not problems
    assert [(item.name, item.digest) for item in together] == [(item.name, item.digest) for item in each]
    assert [item.has_catalogue for item in together] == [False, True]


def test_a_key_that_cannot_be_listed_leaves_the_other_sub_folders_alone(
    inbox: Inbox, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    put(inbox, "duck/video.mp4", "vase/video.mp4")

    def opened(location: Location) -> LocalStore:
        return LocalStore(tmp_path / location.path)

    def listed(store: LocalStore) -> object:
        if Path(str(store.prefix)).name != "duck":
            raise GenericError("Path contains empty path segment")
        return list_of(store)

    list_of = obstore.list
    monkeypatch.setattr(Location, "obstore", opened)
    monkeypatch.setattr(obstore, "list", listed)
    (submission,), problems = list_submissions(Location.parse("s3://bucket/inbox"))
    assert submission.name == "duck" and set(problems) == {"vase"}


def test_the_tag_of_a_file_is_that_of_obstore(inbox: Inbox, tmp_path: Path) -> None:
    put(inbox, "duck/a/video.mp4")
    place = Path(inbox.location.path) / "duck"
    os.utime(place / "a" / "video.mp4", ns=(0, 1_700_000_000_123_456_789))
    metas = [meta for page in obstore.list(LocalStore(place)) for meta in page]
    assert _local_files(place)[0] == [(meta["path"], meta["size"], meta["e_tag"]) for meta in metas]


def test_finishing_does_not_list_what_lies_in_the_sub_folders(inbox: Inbox, monkeypatch: pytest.MonkeyPatch) -> None:
    put(inbox, "duck/video.mp4")
    scan = inbox.scan(AT_ONCE)
    monkeypatch.setattr(os, "walk", None)
    finish(inbox, scan)
    monkeypatch.undo()
    assert inbox.scan(AT_ONCE).unchanged == 1
