"""Folders that replace an earlier export: whole, or not at all."""

import json
from pathlib import Path

import pytest

from glint.storage.errors import StoreError
from glint.storage.export.replaced_folder import merge_into, replaced_folder, temporary_folder_for

FACTS = {"object": "glass", "format": "page"}


def write(out: Path, text: str) -> None:
    with replaced_folder(out, FACTS) as content:
        (content / "text").write_text(text)


def test_an_earlier_export_is_replaced(tmp_path: Path) -> None:
    write(tmp_path / "out", "first")
    write(tmp_path / "out", "second")
    assert (tmp_path / "out" / "text").read_text() == "second"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("error", [OSError("no rights"), KeyboardInterrupt("no rights")])
def test_an_export_that_cannot_take_its_place_leaves_the_earlier_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    out = tmp_path / "out"
    write(out, "first")
    rename = Path.rename

    def refuse_new(path: Path, target: Path) -> Path:
        if path.name == "content":
            raise error
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", refuse_new)
    with pytest.raises(type(error), match="no rights"):
        write(out, "second")
    assert (out / "text").read_text() == "first"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def merge(out: Path, text: str, captures: tuple[str, ...]) -> None:
    with temporary_folder_for(out) as content:
        for capture in captures:
            (content / capture).mkdir()
            (content / capture / "report.json").write_text(json.dumps({"object": "glass", "text": text}))
        (content / "model.json").write_text(text)
        merge_into(content, out, "glass", "report.json")


def contents(out: Path) -> dict[str, str]:
    return {str(path.relative_to(out)): path.read_text() for path in out.rglob("*") if path.is_file()}


def test_files_of_another_export_are_replaced_and_others_stay(tmp_path: Path) -> None:
    merge(tmp_path / "out", "first", ("back", "front"))
    (tmp_path / "out" / "mine").write_text("mine")
    merge(tmp_path / "out", "second", ("front", "side"))
    report = json.dumps({"object": "glass", "text": "second"})
    expected = {"mine": "mine", "model.json": "second", "front/report.json": report, "side/report.json": report}
    assert contents(tmp_path / "out") == expected
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("error", [OSError("no rights"), KeyboardInterrupt("no rights")])
@pytest.mark.parametrize("failure", range(7))
def test_a_merge_that_ends_early_leaves_all_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException, failure: int
) -> None:
    out = tmp_path / "out"
    merge(out, "first", ("back", "front", "older"))
    before, rename, calls = contents(out), Path.rename, list[Path]()

    def end_early(path: Path, target: Path) -> Path:
        calls.append(path)
        if len(calls) == failure + 1 and isinstance(error, OSError):
            raise error
        renamed = rename(path, target)
        if len(calls) == failure + 1:
            raise error
        return renamed

    monkeypatch.setattr(Path, "rename", end_early)
    with pytest.raises(type(error), match="no rights"):
        merge(out, "second", ("back", "front"))
    assert contents(out) == before
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_folder_in_place_of_a_file_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "out" / "model.json").mkdir(parents=True)
    (tmp_path / "out" / "model.json" / "mine").write_text("mine")
    with pytest.raises(StoreError, match=r"model.json is not an export of glass"):
        merge(tmp_path / "out", "first", ())
    assert contents(tmp_path / "out") == {"model.json/mine": "mine"}
