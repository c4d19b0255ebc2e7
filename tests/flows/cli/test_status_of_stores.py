"""`glint status` on stores that are damaged in part, or can only be read."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from glint.flows.cli.main import app
from glint.flows.cli.tables import status_rows
from glint.flows.errors import ServerError
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from tests.storage.stores import local_store, save_capture


@pytest.fixture
def store(tmp_path: Path) -> Location:
    """A store of two objects."""
    location = local_store(tmp_path / "store")
    for object_id in ("duck", "vase"):
        repository = ObjectRepository.open(location, object_id)
        save_capture(repository, "front", "k1")
        repository.publish(["front"], {})
    return location


@pytest.fixture
def read_only(store: Location, tmp_path: Path) -> Iterator[Path]:
    """The store, mounted so that nothing can be written."""
    place = tmp_path / "mounted"
    place.mkdir()
    words = ["mount", "--bind", "-o", "ro", store.path, str(place)]
    if os.geteuid() or subprocess.run(words, check=False).returncode:
        pytest.skip("mounting a store read-only needs root")
    subprocess.run(["mount", "-o", "remount,ro,bind", str(place)], check=True)
    yield place
    # Detached at once, since threads of the store may still hold files of it open.
    subprocess.run(["umount", "--lazy", place], check=True)


@pytest.mark.parametrize("damage", ["truncated", "garbage", "removed", "foreign"])
def test_a_damaged_object_does_not_hide_the_others(store: Location, damage: str) -> None:
    repo = Path(store.path) / "objects" / "duck" / "repo"
    files = [path for path in repo.rglob("*") if path.is_file()]
    for path in files:
        if damage == "truncated":
            os.truncate(path, path.stat().st_size // 3)
        elif damage == "garbage":
            path.write_bytes(os.urandom(path.stat().st_size))
        elif damage == "foreign":
            path.write_bytes(b"no repository")
    if damage == "removed":
        shutil.rmtree(repo)
    rows, damaged = status_rows(store.path)
    assert [(row["object"], row["version"], row["state"]) for row in rows] == [
        ("duck", "", "unreadable"),
        ("vase", "v1", "idle"),
    ]
    assert [row["object"] for row in damaged] == ["duck"] and damaged[0]["error"] and damaged[0]["remedy"]
    assert "internal error" not in damaged[0]["remedy"]


def test_a_store_that_can_only_be_read(read_only: Path) -> None:
    (read_only.parent / "store" / "objects" / "duck" / "run.lock").write_text("")
    rows, damaged = status_rows(str(read_only))
    assert [(row["object"], row["version"], row["state"]) for row in rows] == [
        ("duck", "v1", "idle"),
        ("vase", "v1", "idle"),
    ]
    assert damaged == []


@pytest.mark.parametrize("words", [(), ("--json",)])
def test_a_store_is_listed_without_the_server_that_is_named(
    store: Location, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    monkeypatch.setenv("PREFECT_API_URL", "http://127.0.0.1:9/api")
    done = CliRunner().invoke(app, ["status", "--store", store.uri, *words])
    assert "duck" in done.output and "vase" in done.output
    assert isinstance(done.exception, ServerError) and "does not answer" in done.exception.message
