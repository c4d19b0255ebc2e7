"""Folders that replace an earlier export: whole, or not at all."""

from pathlib import Path

import pytest

from glint.storage.export.replaced_folder import replaced_folder

FACTS = {"object": "glass", "format": "page"}


def write(out: Path, text: str) -> None:
    with replaced_folder(out, FACTS) as content:
        (content / "text").write_text(text)


def test_an_earlier_export_is_replaced(tmp_path: Path) -> None:
    write(tmp_path / "out", "first")
    write(tmp_path / "out", "second")
    assert (tmp_path / "out" / "text").read_text() == "second"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_an_export_that_cannot_take_its_place_leaves_the_earlier_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    write(out, "first")
    rename = Path.rename

    def refuse_new(path: Path, target: Path) -> Path:
        if path.name == "content":
            raise OSError("no rights")
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", refuse_new)
    with pytest.raises(OSError, match="no rights"):
        write(out, "second")
    assert (out / "text").read_text() == "first"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
