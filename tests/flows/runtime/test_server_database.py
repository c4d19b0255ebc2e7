"""A damaged database of the Prefect server: it is moved aside, and the server goes on."""

import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from glint.flows.cli.status import status
from glint.flows.runtime.prefect_server import ensure_server, running_server, stop_server
from glint.flows.runtime.server_database import damage, set_damaged_aside, take_notice
from glint.flows.runtime.server_process import server_folder
from tests.polling import until


def truncate(path: Path) -> None:
    os.truncate(path, path.stat().st_size * 2 // 3 + 100)


def overwrite_head(path: Path) -> None:
    path.write_bytes(b"x" * 5000 + path.read_bytes()[5000:])


def overwrite_pages(path: Path) -> None:
    data = path.read_bytes()
    path.write_bytes(data[:8192] + b"\xa5" * (len(data) - 8192))


def replace(path: Path) -> None:
    path.write_bytes(b"no database at all, but longer than a head of a hundred bytes " * 10)


DAMAGES = [truncate, overwrite_head, overwrite_pages, replace]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A server's folder with a database of some pages."""
    (tmp_path / "prefect").mkdir()
    with closing(sqlite3.connect(tmp_path / "prefect" / "prefect.db")) as connection:
        connection.execute("CREATE TABLE flow_run (id TEXT PRIMARY KEY, name TEXT)")
        connection.executemany("INSERT INTO flow_run VALUES (?, ?)", [(str(n), "x" * 500) for n in range(500)])
        connection.commit()
    return tmp_path


@pytest.mark.parametrize("spoil", DAMAGES)
def test_damage_is_noticed_and_moved_aside(folder: Path, spoil: Callable[[Path], None]) -> None:
    path = folder / "prefect" / "prefect.db"
    spoil(path)
    assert damage(folder)
    set_damaged_aside(folder)
    assert not path.exists() and len(list(path.parent.glob("prefect.db.damaged-*"))) == 1
    notice = take_notice(folder)
    assert "results are untouched" in notice and "prefect.db.damaged-" in notice
    assert take_notice(folder) == "" and damage(folder) == ""


def test_a_whole_one_stays(folder: Path) -> None:
    assert damage(folder) == "" and damage(folder, is_up=True) == ""
    set_damaged_aside(folder)
    assert (folder / "prefect" / "prefect.db").exists() and take_notice(folder) == ""


def test_one_in_use_is_whole(folder: Path) -> None:
    with closing(sqlite3.connect(folder / "prefect" / "prefect.db", isolation_level=None)) as connection:
        connection.execute("BEGIN EXCLUSIVE")
        assert damage(folder) == ""


def test_lost_tables_of_a_running_server(folder: Path) -> None:
    with closing(sqlite3.connect(folder / "prefect" / "prefect.db")) as connection:
        connection.execute("DROP TABLE flow_run")
    assert damage(folder) == "" and "no such table" in damage(folder, is_up=True)
    (folder / "prefect" / "prefect.db").unlink()
    assert damage(folder) == "" and "removed" in damage(folder, is_up=True)


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    for name in [name for name in os.environ if name.startswith("PREFECT")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("GLINT_HOME", str(tmp_path / "home"))
    yield tmp_path / "home"
    stop_server(tmp_path / "home")


@pytest.mark.server
@pytest.mark.parametrize("runs", [pytest.param(True, marks=pytest.mark.slow), False])
def test_the_server_goes_on_with_a_new_one(
    home: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, runs: bool
) -> None:
    path = server_folder(home) / "prefect" / "prefect.db"
    first = None
    if runs:
        first = ensure_server(home)
        monkeypatch.delenv("PREFECT_API_URL")
    else:
        path.parent.mkdir(parents=True)
    for suffix in ("-wal", "-shm"):
        path.with_name(path.name + suffix).unlink(missing_ok=True)
    replace(path)
    # While the server writes, its database is locked, and a locked one counts as whole.
    until(lambda: running_server(home) is None)
    (tmp_path / "store").mkdir()
    status(str(tmp_path / "store"))
    assert "database is damaged" in capsys.readouterr().out
    second = ensure_server(home)
    assert (first is None or second.process != first.process) and "results are untouched" in second.notice()
    monkeypatch.delenv("PREFECT_API_URL")
    assert running_server(home) is not None and damage(server_folder(home), is_up=True) == ""
