"""`glint rollback`: what it publishes, in words and as JSON."""

import json
from pathlib import Path

from typer.testing import CliRunner

from glint.flows.cli.main import app
from glint.storage.versions.repository import ObjectRepository
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
