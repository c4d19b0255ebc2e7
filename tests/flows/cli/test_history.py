"""`glint history` and `glint rollback`: captures and versions, in words and as JSON."""

import json
from pathlib import Path

from typer.testing import CliRunner

from glint.flows.cli.main import app
from glint.flows.cli.tables import history_rows, status_rows
from glint.flows.pipeline.catalogue import _summary
from glint.flows.results import CaptureResult, ObjectResult, RunResult
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import WHOLE_OBJECT, StoredFile
from tests.storage.stores import local_store, save_capture


def test_a_rollback_is_reported_as_json_and_in_words(tmp_path: Path) -> None:
    repository = ObjectRepository.open(local_store(tmp_path / "store"), "duck")
    for key in ("k1", "k2"):
        save_capture(repository, "front", key)
        repository.publish(["front"], {})
    words = ["--store", str(tmp_path / "store")]
    printed = CliRunner().invoke(app, ["rollback", "duck", "v1", "--json", *words]).output
    expected = {"kind": "rollback", "object": "duck", "version": "v3", "content": "v1", "created": True}
    assert json.loads(printed) == expected
    for version in ("v3", "v1"):
        again = CliRunner().invoke(app, ["rollback", "duck", version, *words])
        assert again.exit_code == 0
        assert again.output == "duck: nothing changes: v3 is the newest version and has this content already\n"
    assert repository.version_names() == ["v1", "v2", "v3"]


def test_the_model_of_an_object_is_no_capture(tmp_path: Path) -> None:
    repository = ObjectRepository.open(local_store(tmp_path / "store"), "duck")
    save_capture(repository, "front", "k1")
    repository.save(WHOLE_OBJECT, "model", "m", {}, {}, {"model.ply": StoredFile(b"model", "model/ply")})
    repository.publish(["front", WHOLE_OBJECT], {})
    store = str(tmp_path / "store")
    assert [row["captures"] for row in history_rows(store, "duck")] == ["front"]
    assert [row["captures"] for row in status_rows(store)[0]] == [1]
    results = tuple(CaptureResult("duck", name, 1.0) for name in ("front", "model"))
    assert _summary(RunResult("run", (ObjectResult("duck", results),), 1.0)) == "1 captures: 1 done, 0 up to date"
