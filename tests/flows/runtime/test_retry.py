"""A server that dies while flows run: it comes back at its address, and what it interrupted is begun again."""

import json
from pathlib import Path

import httpx
import psutil
import pytest
from prefect import flow

from glint.flows.errors import ServerError
from glint.flows.runtime.prefect_server import start_server, stop_server
from glint.flows.runtime.retry import MAX_ATTEMPTS, retry_on_disconnect, wait_for_server
from glint.flows.runtime.server_database import damage

pytestmark = [pytest.mark.server, pytest.mark.slow]


@flow(name="short", persist_result=False)
def short(number: int) -> int:
    return number + 1


def test_flows_outlive_the_server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("PREFECT_API_URL", "PREFECT_API_AUTH_STRING", "PREFECT_HOME"):
        monkeypatch.setenv(name, "")  # so that what the server sets is undone
        monkeypatch.delenv(name)
    server = start_server(tmp_path)
    try:
        with server.connected():
            assert retry_on_disconnect(short, 1) == 2
            assert server.process is not None
            psutil.Process(server.process[0]).kill()
            assert retry_on_disconnect(short, 2) == 3
        (state,) = (tmp_path / "server").glob("*/server.json")
        found = json.loads(state.read_text())
        assert found["api_url"] == server.api_url and found["process"][0] != server.process[0]
    finally:
        stop_server(tmp_path)


def test_a_database_damaged_under_a_flow_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("PREFECT_API_URL", "PREFECT_API_AUTH_STRING", "PREFECT_HOME"):
        monkeypatch.setenv(name, "")  # so that what the server sets is undone
        monkeypatch.delenv(name)
    monkeypatch.setenv("GLINT_HOME", str(tmp_path))
    server = start_server(tmp_path)
    try:
        with server.connected():
            assert retry_on_disconnect(short, 1) == 2
            (database,) = (tmp_path / "server").glob("*/prefect/prefect.db")
            for path, head in ((database, 8192), (database.with_name("prefect.db-wal"), 0)):
                with path.open("r+b") as file:
                    file.seek(head)
                    file.write(b"\xa5" * (path.stat().st_size - head))
            with pytest.raises(ServerError, match="database was damaged during the run"):
                retry_on_disconnect(short, 2)
            wait_for_server()
            assert retry_on_disconnect(short, 3) == 4
            assert "results are untouched" in server.notice()
            assert damage(database.parents[1], is_up=True) == ""
        assert len(list(database.parent.glob("prefect.db.damaged-*"))) >= 1
    finally:
        stop_server(tmp_path)


def test_a_server_that_never_stays_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    tries = []
    monkeypatch.setattr("glint.flows.runtime.retry.wait_for_server", lambda: None)

    def unlucky() -> None:
        tries.append(1)
        raise httpx.ConnectError("refused")

    with pytest.raises(ServerError, match="went away"):
        retry_on_disconnect(unlucky)
    assert len(tries) == MAX_ATTEMPTS
