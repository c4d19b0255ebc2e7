"""What is new in an inbox."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from glint.flows.deployments.inbox import Inbox, News
from glint.storage.catalogue.loading import load
from glint.storage.errors import InputError

NOW = timedelta(0)


@pytest.fixture
def inbox(tmp_path: Path) -> Inbox:
    (tmp_path / "inbox").mkdir()
    return Inbox(str(tmp_path / "inbox"), str(tmp_path / "store"))


def put(inbox: Inbox, *names: str, data: bytes = b"x") -> None:
    for name in names:
        path = Path(inbox.place.path) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


def objects(news: News) -> set[str]:
    return {name for batch in news.batches for name in batch.arrivals}


def finish(inbox: Inbox, news: News, *but: str) -> None:
    inbox.finish([each for batch in news.batches for name, each in batch.arrivals.items() if name not in but])


def test_only_what_is_new_or_changed_is_run(inbox: Inbox) -> None:
    put(inbox, "Duck/film.mp4", "glass/a/1.png", "glass/a/2.png", "notes.txt", ".hidden/film.mp4", "empty/notes.txt")
    first = inbox.news(NOW)
    assert objects(first) == {"duck", "glass"}
    assert (first.problems, first.waiting, first.empty, first.unchanged) == ({}, (), ("empty",), 0)
    catalogue = load(first.batches[0].catalogue)
    assert catalogue.object("duck").captures[0].frames == f"{inbox.place.path}/Duck/film.mp4"
    finish(inbox, first, "glass")
    assert objects(inbox.news(NOW)) == {"glass"}
    finish(inbox, inbox.news(NOW))
    assert inbox.news(NOW).batches == ()
    assert inbox.news(NOW).unchanged == 2
    put(inbox, "Duck/film.mp4", data=b"longer")
    put(inbox, "fish/film.mp4")
    assert objects(inbox.news(NOW)) == {"duck", "fish"}
    put(inbox, "glass/a/mask.png")
    assert objects(inbox.news(NOW)) == {"duck", "fish", "glass"}


def test_what_is_still_being_copied_waits(inbox: Inbox) -> None:
    put(inbox, "duck/film.mp4")
    now = datetime.now(UTC)
    early = inbox.news(timedelta(minutes=10), now)
    assert (early.batches, early.waiting) == ((), ("duck",))
    assert objects(inbox.news(timedelta(minutes=10), now + timedelta(minutes=11))) == {"duck"}


def test_a_sub_folder_with_a_catalogue_is_run_by_it(inbox: Inbox) -> None:
    text = "schema: 1\nname: two\nobjects:\n- {id: a, captures: [{id: front, frames: a.mp4}]}\n"
    put(inbox, "tray/a.mp4", "tray/b.mp4")
    put(inbox, "tray/catalogue.yaml", data=text.encode())
    put(inbox, "bad/catalogue.yaml", data=b"schema: 2\n")
    news = inbox.news(NOW)
    (batch,) = news.batches
    assert batch.catalogue == f"{inbox.place.path}/tray/catalogue.yaml" and set(batch.arrivals) == {"a"}
    assert list(news.problems) == ["bad"] and "schema" in news.problems["bad"]
    finish(inbox, news)
    assert inbox.news(NOW).batches == () and list(inbox.news(NOW).problems) == ["bad"]


def test_two_sub_folders_never_share_an_object(inbox: Inbox) -> None:
    put(inbox, "Wine Glass/a.mp4", "wine-glass/b.mp4")
    news = inbox.news(NOW)
    assert objects(news) == {"wine-glass"}
    assert news.problems == {"wine-glass": "has the object wine-glass, as Wine Glass has: rename one of the two"}


def test_what_is_gone_is_forgotten(inbox: Inbox) -> None:
    put(inbox, "duck/film.mp4", "fish/film.mp4")
    finish(inbox, inbox.news(NOW))
    (Path(inbox.place.path) / "duck" / "film.mp4").unlink()
    inbox.finish([])
    (memory,) = (Path(inbox.place.path).parent / "store" / "inbox").glob("*/finished.json")
    assert set(json.loads(memory.read_text())["finished"]) == {"fish"}
    memory.write_text("{")
    assert objects(inbox.news(NOW)) == {"fish"}


def test_an_inbox_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is no folder"):
        Inbox(str(tmp_path / "unmounted"), str(tmp_path / "store")).news(NOW)
    assert not (tmp_path / "unmounted").exists()
