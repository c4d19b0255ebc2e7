"""The rows of the catalogue view, from what a store holds and what goes on in it."""

import os
import shutil
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from glint.flows.cli.review import review
from glint.flows.review import listing as listing_module
from glint.flows.review.listing import RANK, Listing
from glint.flows.review.object_rows import Row, failed_row, object_rows
from glint.flows.review.run_states import RunStates
from glint.flows.review.runs import Run, Runs, note
from glint.storage.catalogue.loading import load, write
from glint.storage.errors import InputError
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from tests.flows.review.conftest import let_in, serve
from tests.polling import until
from tests.storage.stores import local_store, save_capture


def listing(store: Path, catalogue: Path | None) -> Listing:
    """A listing that has read its store once."""
    location = Location.parse(store)
    made = Listing(location, None if catalogue is None else str(catalogue), Runs(location.uri))
    made.read_changed(made.refresh_names())
    return made


def states(made: Listing, search: str = "", sort: str = "attention") -> dict[str, str]:
    return {row.name: row.state for row in made.view(search, (), sort, 0, 100).rows}


@pytest.mark.long
def test_a_published_capture_has_its_figures(stored: tuple[Path, Path]) -> None:
    store, catalogue = stored
    (row,) = listing(store, catalogue).view("", (), "attention", 0, 10).rows
    assert (row.name, row.version) == ("hemisphere/front", "v1")
    assert row.state in ("done", "warnings", "doubtful") and row.verdict
    assert row.confident is not None and 0 < row.confident <= 1


def test_a_page_with_all_rows_is_told_that_the_store_has_been_read(tmp_path: Path) -> None:
    made = Listing(Location.parse(tmp_path), None, Runs(str(tmp_path)))
    stored, before = made.refresh_names(), made.view("", (), "name", 0, 10)
    made.read_changed(stored)
    after = made.view("", (), "name", 0, 10)
    assert (before.complete, after.complete) == (False, True)
    assert after.revision > before.revision
    made.read_changed(made.refresh_names())
    assert made.revision == after.revision


def test_another_server_has_other_revisions(tmp_path: Path) -> None:
    """A page that outlives its server asks the next one for what is new since its own revision."""
    revisions = list[int]()
    for capture in ("front", "back"):
        repository = ObjectRepository.open(local_store(tmp_path / capture), "duck")
        save_capture(repository, capture, "k1")
        repository.publish([capture], {})
        revisions.append(listing(tmp_path / capture, None).revision)
    assert revisions[0] != revisions[1]


@pytest.mark.long
def test_an_object_is_read_again_when_it_has_changed_alone(stored: tuple[Path, Path]) -> None:
    made = listing(stored[0], None)
    before = made.revision
    made.read_changed(made.refresh_names())
    assert made.revision == before
    time.sleep(0.01)
    os.utime(stored[0] / "objects/hemisphere/repo/snapshots")
    made.read_changed(made.refresh_names())
    assert made.revision > before


def test_what_the_catalogue_lists_is_new_and_what_is_damaged_failed(tmp_path: Path, simulated: Path) -> None:
    assert states(listing(tmp_path / "absent", simulated)) == {"hemisphere/front": "new"}
    (tmp_path / "store/objects/hemisphere/repo").mkdir(parents=True)
    (tmp_path / "store/objects/hemisphere/repo/config.yaml").write_text("{")
    made = listing(tmp_path / "store", simulated)
    (row,) = made.view("", (), "attention", 0, 10).rows
    assert row.state == "failed" and row.error and row.remedy


def test_rows_are_sorted_by_time_wherever_the_server_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "Pacific/Auckland")
    time.tzset()
    try:
        before = datetime.now(UTC).isoformat(timespec="seconds")
        failed = failed_row("duck", "front", InputError("it is gone", "look for it"))
        assert before <= failed.date <= datetime.now(UTC).isoformat(timespec="seconds")
    finally:
        monkeypatch.undo()
        time.tzset()


def test_a_catalogue_with_an_error_is_told_and_the_store_read_nevertheless(tmp_path: Path, simulated: Path) -> None:
    catalogue, folder = tmp_path / "catalogue.yaml", tmp_path / "store/objects/cup/repo"
    write(load(simulated), catalogue)
    whole = catalogue.read_text()
    made = listing(tmp_path / "store", catalogue)
    before = made.revision
    catalogue.write_text(whole.replace("captures:", "captured:"))
    folder.mkdir(parents=True)
    made.start()
    try:
        # A row that is not stored is read until Prefect has been asked for runs that failed.
        until(lambda: states(made) == {"hemisphere/front": "new", "cup/-": "failed"})
        view = made.view("", (), "name", 0, 10)
        assert "captured" in view.problem and view.revision > before
        catalogue.write_text(whole)
        until(lambda: not made.view("", (), "name", 0, 10).problem)
    finally:
        made.stop()


def test_captures_that_leave_the_catalogue_and_objects_that_leave_the_store_are_listed_no_longer(
    tmp_path: Path, simulated: Path
) -> None:
    catalogue, folder = tmp_path / "catalogue.yaml", tmp_path / "store/objects/cup/repo"
    write(load(simulated), catalogue)
    folder.mkdir(parents=True)
    made = listing(tmp_path / "store", catalogue)
    assert states(made) == {"hemisphere/front": "new", "cup/-": "failed"}
    revision = made.revision
    catalogue.write_text(catalogue.read_text().replace("front", "back"))
    shutil.rmtree(folder.parent)
    made.read_changed(made.refresh_names())
    assert states(made) == {"hemisphere/back": "new"} and made.revision > revision
    assert not made._retries


def test_an_unexpected_error_is_logged_and_the_list_goes_on(
    tmp_path: Path, simulated: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    catalogue = tmp_path / "catalogue.yaml"
    made = Listing(Location.parse(tmp_path / "store"), str(catalogue), Runs(str(tmp_path / "store")))
    made.start()
    try:
        with monkeypatch.context() as patched:
            patched.setattr(listing_module, "load_catalogue", {}.__getitem__)
            until(lambda: "could not be refreshed" in caplog.text)
        write(load(simulated), catalogue)
        until(lambda: states(made) == {"hemisphere/front": "new"})
    finally:
        made.stop()


def test_an_object_that_could_not_be_read_is_read_again_later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> list[Row]:
        raise OSError(24, "Too many open files")

    save_capture(ObjectRepository.open(local_store(tmp_path), "glass"), "front", "k1")
    with monkeypatch.context() as broken:
        broken.setattr(listing_module, "object_rows", fails)
        made = listing(tmp_path, None)
    assert set(states(made).values()) == {"failed"}
    made.read_changed(made.refresh_names())
    assert set(states(made).values()) == {"failed"}, "not at once"
    now = time.monotonic()
    monkeypatch.setattr(listing_module.time, "monotonic", lambda: now + listing_module.RETRY_SECONDS)
    made.read_changed(made.refresh_names())
    assert states(made) == {"glass/front": "waiting"}


@pytest.mark.slow
def test_the_page_shows_what_is_wrong_with_the_catalogue_until_it_is_right(
    tmp_path: Path, simulated: Path, chromium: Any
) -> None:
    catalogue = tmp_path / "catalogue.yaml"
    write(load(simulated), catalogue)
    whole = catalogue.read_text()
    served = serve(tmp_path / "store", catalogue)
    for tab in let_in(served, chromium):
        assert not tab.page.is_visible("[role=alert]")
        catalogue.write_text(whole.replace("captures:", "<b>captured:"))
        tab.page.wait_for_selector("[role=alert] >> text=<b>captured")
        assert tab.page.is_visible(".row .name")
        catalogue.write_text(whole)
        tab.page.wait_for_selector("[role=alert]", state="hidden")
        # The thumbnail of a capture without results is absent, which the browser says.
        tab.complaints.clear()
    served.stop()


def filled(*rows: Row) -> Listing:
    made = Listing(Location.parse("/absent"), None, Runs("/absent"))
    for row in rows:
        made._rows.setdefault(row.object, {})[row.capture] = row
    return made


def test_what_needs_a_person_comes_first_then_what_costs_most() -> None:
    rows = [Row(f"object-{state}", "front", state) for state in reversed(RANK)]
    assert [*states(filled(*rows)).values()] == list(RANK)
    cheap, costly = Row("a", "front", "warnings", cost_deg=1.0), Row("b", "front", "warnings", cost_deg=3.0)
    assert [*states(filled(cheap, costly))] == ["b/front", "a/front"]
    young, old = (
        Row("a", "front", "done", date="2026-02-01T00:00:00+00:00"),
        Row("b", "front", "done", date="2026-01-01"),
    )
    assert [*states(filled(old, young), sort="date")] == ["a/front", "b/front"]
    sure, unsure = Row("a", "front", "done", confident=0.9), Row("b", "front", "done", confident=0.2)
    assert [*states(filled(sure, unsure, Row("c", "front", "new")), sort="confident")] == [
        "b/front",
        "a/front",
        "c/front",
    ]


def test_search_filter_and_pages() -> None:
    made = filled(
        *(Row(f"glass-{number:03}", "front", "done", warnings=("the Camera shook",)) for number in range(250))
    )
    assert len(states(made, search="camera GLASS-1")) == 100
    assert made.view("", ("failed",), "name", 0, 10).total == 0
    view = made.view("", (), "name", 200, 100)
    assert [row.name for row in view.rows][:1] == ["glass-200/front"] and view.total == 250 and len(view.rows) == 50


def test_a_run_of_the_page_shows_at_once_and_a_failure_until_the_next_version() -> None:
    runs = Runs("/absent")
    known = RunStates("/absent", runs)
    row = Row("glass", "front", "done", date="2026-01-02T00:00:00+00:00")
    assert known.applied(row) is row
    run = runs._runs["glass/front"] = Run("glass/front")
    note(run, {"kind": "progress", "capture": "glass/front", "stage": "depth", "seconds_left": 9.5, "share": 0.25})
    note(run, {"kind": "progress", "capture": "glass/front", "stage": "surface"})
    shown = known.applied(row)
    assert (shown.state, shown.stage, shown.progress, shown.seconds_left) == ("running", "surface", 0.25, 9.5)
    runs._runs.clear()
    since = (datetime.now(UTC) - timedelta(seconds=30)).isoformat(sep=" ")
    known._running = {"glass/front": {"stage": "labels", "progress": 0.75, "since": since}}
    shown = known.applied(row)
    assert shown.progress == 0.75 and shown.seconds_left == pytest.approx(10.0, abs=0.5), "the run's own estimate"
    known._running = {"glass/front": {"stage": "survey", "progress": None, "since": since}}
    assert known.applied(row).seconds_left is None
    known._running = {}
    failure = {"stage": "survey", "error": "no sphere", "ended": "2026-01-03 00:00:00+00:00"}
    known._failed = {"glass/front": failure}
    assert known.applied(row).state == "failed"
    assert known.names() == ["glass/front"]
    known._failed = {"glass/front": failure | {"ended": "2026-01-01 00:00:00+00:00"}}
    assert known.applied(row).state == "done"


def test_the_newest_run_counts_whether_the_page_has_started_it_or_not() -> None:
    runs = Runs("/absent")
    known = RunStates("/absent", runs)
    run = runs._runs["glass/front"] = Run("glass/front")
    run.started -= 100.0
    event = {"capture": "glass/front", "error": "no sphere", "remedy": "give one", "version": ""}
    note(run, {"kind": "summary", "captures": [event]})

    def date(seconds: float) -> str:
        return (datetime.now(UTC) + timedelta(seconds=seconds)).isoformat(sep=" ", timespec="seconds")

    earlier, later = (Row("glass", "front", "done", date=date(seconds)) for seconds in (-200.0, 60.0))
    failed = known.applied(earlier)
    assert (failed.state, failed.error, failed.remedy) == ("failed", "no sphere", "give one")
    assert known.applied(later) is later, "a version was published elsewhere since"
    note(run, {"kind": "summary", "captures": [event | {"error": ""}]})
    states = []
    for begin in (-200.0, -50.0, 60.0):
        known._running = {"glass/front": {"stage": "labels", "progress": None, "since": date(begin)}}
        states.append(known.applied(earlier).state)
    assert states == ["running", "done", "running"], "the server reports the page's own run until it is asked again"
    known._running = {}
    for end, state in ((-50.0, "done"), (60.0, "failed")):
        known._failed = {"glass/front": {"stage": "survey", "error": "no lights", "ended": date(end)}}
        assert known.applied(earlier).state == state


def test_what_a_row_says_is_said_in_the_words_of_the_page() -> None:
    text = "no sphere: give `spheres` in the catalogue"
    shown = Row("glass", "front", "failed", reason=text, warnings=(text,), error=text, remedy=text).to_json()
    texts = [shown["reason"], *shown["warnings"], shown["error"], shown["remedy"]]
    assert texts == ["no sphere: draw its circle with Spheres"] * 4


def test_a_capture_that_failed_before_it_stored_anything_is_shown(tmp_path: Path) -> None:
    made = filled(Row("bowl", "front", "done"))
    made._states._failed = {"glass/front": {"stage": "survey", "error": "no sphere", "ended": ""}}
    assert states(made) == {"glass/front": "failed", "bowl/front": "done"}


@pytest.mark.long
def test_rows_of_captures_without_a_version_wait(stored: tuple[Path, Path], tmp_path: Path) -> None:
    from glint.storage.versions.repository import ObjectRepository

    location = Location.parse(tmp_path)
    ObjectRepository.open(location, "glass").save("front", "survey", "key", {}, {"seconds": 1.0})
    (row,) = object_rows(location, "glass")
    assert (row.state, row.stage, row.version, row.verdict) == ("waiting", "survey", "", "")


@pytest.mark.parametrize(
    ("host", "password", "message"),
    [
        ("0.0.0.0", None, "without a password"),
        ("0.0.0.0", "short", "5 characters"),
        ("127.0.0.1", "correct horse \udcff", "nobody can type"),
        ("everywhere", None, "not an addr"),
    ],
)
def test_other_machines_need_a_password(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, host: str, password: str | None, message: str
) -> None:
    monkeypatch.delenv("GLINT_REVIEW_PASSWORD", raising=False)
    if password:
        monkeypatch.setenv("GLINT_REVIEW_PASSWORD", password)
    with pytest.raises(InputError, match=message):
        review(None, str(tmp_path), None, host, None)
