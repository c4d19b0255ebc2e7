"""`glint edits` and what other commands say of edits; one whole run with an edited mask."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer.testing

from glint.flows.cli.main import app
from glint.storage.edits.edits import Edits
from glint.storage.edits.models import Changes, mask_png
from glint.storage.errors import InputError
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository

RUNNER = typer.testing.CliRunner()


def glint(*words: str) -> str:
    """Run a command in this process; return what it prints."""
    done = RUNNER.invoke(app, words, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def rows(*words: str) -> list[dict[str, object]]:
    return [json.loads(line) for line in glint(*words, "--json").splitlines()]


@pytest.fixture
def store(tmp_path: Path) -> str:
    """A store with two edits of one capture."""
    edits = Edits.open(Location.parse(tmp_path / "store"), "duck")
    edits.save("front", Changes(pixel_size=0.5, note="scale from the ruler"), "Ann", 0)
    edits.save("front", Changes(verdict="good"), "Bob", 1)
    return str(tmp_path / "store")


def test_edits_are_listed(store: str) -> None:
    first, second, note = rows("edits", "duck", "--store", store)
    assert (first["kind"], first["capture"], first["field"]) == ("edited", "duck/front", "pixel_size")
    assert (first["author"], first["edit"]) == ("Ann", 1)
    assert (second["field"], second["author"], second["edit"]) == ("verdict", "Bob", 2)
    assert (note["kind"], note["author"], note["text"]) == ("note", "Ann", "scale from the ruler")
    assert "scale from the ruler" in glint("edits", "duck/front", "--store", store)
    misspelt = glint("edits", "duck/frnt", "--store", store)
    assert "nothing is edited" in misspelt and "duck has no results of a capture 'frnt' (it has front)" in misspelt
    assert "has no results" not in glint("edits", "duck/front", "--store", store)


def test_what_is_saved_and_what_is_written_are_both_printed(store: str, tmp_path: Path) -> None:
    words = "edits", "duck/front", "--store", store, "--undo", "2", "--author", "Ann", "--out"
    saved, written = rows(*words, str(tmp_path / "first"))
    assert (saved["kind"], saved["undoes"]) == ("edit", 2)
    assert written == {"kind": "file", "path": str(tmp_path / "first" / "edits.yaml")}
    assert glint("edits", "duck/front", "--store", store, "--out", str(tmp_path / "second")).split() == [
        str(tmp_path / "second" / "edits.yaml")
    ]


def test_the_history_lists_edits_with_author_time_and_sentence(store: str) -> None:
    first, second = rows("history", "duck", "--store", store)
    assert (first["kind"], first["object"]) == ("edit", "duck")
    assert (first["edit"], first["captures"], first["author"]) == (1, ["duck/front"], "Ann")
    assert first["message"] == "pixel_size: 0.5 mm; note: scale from the ruler"
    assert str(first["published"]) <= str(second["published"])
    assert "verdict: good" in glint("history", "duck", "--store", store)


def test_files_are_written_and_taken(store: str, tmp_path: Path) -> None:
    mask = np.zeros((20, 30), bool)
    mask[5:15, 5:20] = True
    (tmp_path / "mask.png").write_bytes(mask_png(mask))
    (tmp_path / "marks.json").write_text('[{"frame": 1, "x": 7, "y": 8, "kind": "false"}]')
    arguments = "--mask", str(tmp_path / "mask.png"), "--markup", str(tmp_path / "marks.json"), "--author", "Cid"
    printed = glint("edits", "duck/front", *arguments, "--store", store)
    assert "duck/front: edit 3: mask: 150 pixels; marks: 0 true, 1 false" in printed
    assert "nothing changes" in glint("edits", "duck/front", *arguments, "--store", store)
    written = glint("edits", "duck", "--out", str(tmp_path / "out"), "--store", store).split()
    assert [Path(path).name for path in written] == ["edits.yaml", "mask.png", "markup.json"]
    other = str(tmp_path / "other")
    taken = glint("edits", "duck", "--take", str(tmp_path / "out/edits.yaml"), "--author", "Dora", "--store", other)
    assert "duck/front: edit 1: pixel_size: 0.5 mm; mask: 150 pixels" in taken
    current = Edits.open(Location.parse(other), "duck").current("front")
    assert set(current.edited) == {"pixel_size", "verdict", "mask", "marks"}
    assert "edit 4: undo of edit 3" in glint("edits", "duck", "--undo", "3", "--store", store)
    assert "edit 5: all edits taken back" in glint("edits", "duck/front", "--discard", "--store", store)
    assert Edits.open(Location.parse(store), "duck").current("front").edited == ()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("duck", "--discard"), "duck names no capture"),
        (("duck", "--mask", "nowhere.png"), "'nowhere.png' does not exist"),
        (("duck", "--undo", "9"), "duck has edits 1 to 2, not 9"),
        (("duck/back", "--undo", "1"), "edit 1 is of duck/front, not of duck/back"),
        (("goose",), "no object goose"),
        (("duck/front", "--undo", "1", "--author", "a\nb"), "the author's name"),
        (("../up",), "cannot be a name in the store"),
        (("duck/../up",), "capture '../up' cannot be a name in the store"),
    ],
)
def test_mistakes_are_reported_and_nothing_is_saved(store: str, words: tuple[str, ...], message: str) -> None:
    done = RUNNER.invoke(app, ["edits", *words, "--store", store])
    assert done.exit_code != 0
    assert message in str(done.exception) + done.output
    assert Edits.open(Location.parse(store), "duck").revision == 2


def test_a_capture_that_nothing_names_is_pointed_out(store: str, tmp_path: Path) -> None:
    (tmp_path / "mask.png").write_bytes(mask_png(np.ones((20, 30), bool)))
    words = "--mask", str(tmp_path / "mask.png"), "--store", store
    assert "no results of a capture 'frnt' (it has front)" in glint("edits", "duck/frnt", *words)
    assert "no results" not in glint("edits", "duck/front", *words)


@pytest.mark.parametrize(
    ("option", "content", "message"),
    [
        ("--markup", '[{"frame": 100, "x": 7, "y": 8, "kind": "false"}]', "x 7, y 8 is after the last frame, 99"),
        ("--markup", '[{"frame": 1, "x": 31, "y": 8, "kind": "false"}]', "lies outside the frame of 30 x 20 pixels"),
        ("--take", "captures: [{id: front, region: {x: 9, y: 9, width: 30, height: 5}}]", "region"),
        ("--take", "captures: [{id: front, markup: marks.json}]", "frame 5000, x 1, y 2 is after the last frame"),
        ("--mask", "", "the painted mask is 20 x 20"),
    ],
)
def test_what_lies_beyond_the_frames_of_the_last_run_is_refused(
    store: str, tmp_path: Path, option: str, content: str, message: str
) -> None:
    repository = ObjectRepository.open(Location.parse(store), "duck")
    repository.save("front", "survey", "key", {}, {"frame_size": [30, 20]})
    repository.save("front", "frames", "key", {}, {"counts": {"frames": 100}})
    (tmp_path / "marks.json").write_text('[{"frame": 5000, "x": 1, "y": 2, "kind": "true"}]')
    file = tmp_path / "file"
    file.write_bytes(content.encode() or mask_png(np.ones((20, 20), bool)))
    done = RUNNER.invoke(app, ["edits", "duck/front", option, str(file), "--store", store])
    assert isinstance(done.exception, InputError)
    assert "duck/front: " in done.exception.message and message in done.exception.message
    assert "run duck/front first" in done.exception.remedy
    assert Edits.open(Location.parse(store), "duck").revision == 2


@pytest.mark.slow
@pytest.mark.server
def test_a_run_takes_the_edits_and_says_so(simulated: Path, tmp_path: Path) -> None:
    """The run with an edit, its version, report and history; after undo the first version's results come back."""
    from tests.flows.cli.test_main import glint as glint_process

    store, home = tmp_path / "store", tmp_path / "home"

    def run() -> list[dict[str, Any]]:
        words = "run", str(simulated), "--store", str(store), "--workers", "1", "--json"
        printed = glint_process(*words, folder=tmp_path, home=home).stdout
        return [json.loads(line) for line in printed.splitlines()]

    try:
        assert run()[-1]["captures"][0]["version"] == "v1"
        repository = ObjectRepository.open(Location.parse(store), "hemisphere")
        survey, mask = repository.load("front", "survey").record, repository.load("front", "mask").read("mask")
        (width, height), region = survey["frame_size"], survey["region"]
        frame = np.zeros((height, width), bool)
        frame[region["y"] :, region["x"] :][: region["height"], : region["width"]] = mask
        frame[: region["y"] + region["height"] // 4] = False
        edits = Edits.open(Location.parse(store), "hemisphere")
        edits.save("front", Changes(mask=frame), "Ann <b>", 0, "cut off the top")
        lines = run()
        assert any("edited by a person: mask by Ann <b>" in str(line.get("text")) for line in lines)
        assert (lines[-1]["captures"][0]["version"], lines[-1]["captures"][0]["result"]) == ("v2", "done")
        given = repository.load("front", "mask", "v2")
        assert given.record["estimated"] is False
        assert given.read("mask").sum() == frame.sum()
        assert repository.version("v2").metadata["captures"]["front"]["edits"]["revision"] == 1
        glint("export", "hemisphere", "--out", str(tmp_path / "out"), "--store", str(store))
        report = json.loads((tmp_path / "out/front/report.json").read_text())
        assert report["edits"]["changes"]["mask"]["author"] == "Ann <b>"
        page = (tmp_path / "out/front/report.html").read_text()
        assert "Edited by a person: mask" in page and "Ann &lt;b&gt;" in page
        edits.undo(1, "Bob")
        assert run()[-1]["captures"][0]["version"] == "v3"
        assert repository.version("v3").stages == repository.version("v1").stages
        names = [
            row.get("version") or f"edit {row['edit']}" for row in rows("history", "hemisphere", "--store", str(store))
        ]
        assert names == ["v1", "edit 1", "v2", "edit 2", "v3"]
    finally:
        from glint.flows.runtime.prefect_server import stop_server

        stop_server(home)


def test_an_object_that_the_store_does_not_have_yet_is_pointed_out(store: str, tmp_path: Path) -> None:
    file = tmp_path / "edits.yaml"
    file.write_text("captures: [{id: front, verdict: good}]")
    assert "has no object 'dukc' yet" in glint("edits", "dukc", "--take", str(file), "--store", store)
    assert "has no object" not in glint("edits", "duck", "--take", str(file), "--store", store)
    assert "has no object" not in glint("edits", "dukc", "--take", str(file), "--store", str(tmp_path / "new"))
