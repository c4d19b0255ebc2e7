"""With `--json` the same things have the same names in all commands."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from glint.flows.cli.main import app
from glint.storage.versions.repository import ObjectRepository
from tests.flows.cli.test_mistakes import catalogue
from tests.storage.stores import local_store, save_capture
from tests.tasks.tilted_versions import depth, publish, tilted

__all__ = ["catalogue"]


def lines(*words: str) -> list[dict[str, Any]]:
    """Run a command with `--json` in this process; return the lines that it prints on standard output."""
    return [json.loads(line) for line in CliRunner().invoke(app, [*words, "--json"]).stdout.splitlines()]


def test_a_check_names_capture_and_error(catalogue: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(catalogue.parent)
    *_, line = lines("check", "catalogue.yaml")
    assert (line["kind"], line["capture"], line["observable"]) == ("check", "duck/front", None)
    assert "front.mp4" in line["error"] and line["verdict"]["word"] == "correct the catalogue"


def test_a_difference_names_captures_as_other_commands_do(tmp_path: Path) -> None:
    repository = ObjectRepository.open(local_store(tmp_path / "store"), "duck")
    publish(repository, tilted(0.0), depth())
    publish(repository, tilted(7.0), depth(), strength=2.0)
    (line,) = lines("diff", "duck", "v1", "v2", "--store", str(tmp_path / "store"))
    assert (line["kind"], line["object"], line["before"], line["after"]) == ("diff", "duck", "v1", "v2")
    assert [row["capture"] for row in line["captures"]] == ["duck/front"]
    (change,) = line["changes"]
    assert change == {"capture": "duck/front", "stage": "labels", "changed": "strength", "before": 1.0, "after": 2.0}


def test_versions_without_a_common_capture_are_named_in_a_folder_that_does_not_exist_yet(tmp_path: Path) -> None:
    repository = ObjectRepository.open(local_store(tmp_path / "store"), "duck")
    for capture in ("front", "back"):
        save_capture(repository, capture, "k1")
        repository.publish([capture], {}, remove={"front", "back"} - {capture})
    words = "--store", str(tmp_path / "store"), "--out", str(tmp_path / "maps")
    (line,) = lines("diff", "duck", "v1", "v2", *words)
    assert (line["removed"], line["added"], line["captures"]) == (["duck/front"], ["duck/back"], [])
    assert json.loads((tmp_path / "maps" / "diff.json").read_text()) == line


def test_versions_and_exports_name_their_object(tmp_path: Path) -> None:
    repository = ObjectRepository.open(local_store(tmp_path / "store"), "duck")
    save_capture(repository, "front", "k1")
    repository.publish(["front"], {})
    words = "duck", "--store", str(tmp_path / "store")
    (version,) = lines("history", *words)
    (export,) = lines("export", *words, "--out", str(tmp_path / "out"))
    for line, kind in ((version, "version"), (export, "export")):
        assert (line["kind"], line["object"], line["version"]) == (kind, "duck", "v1")
