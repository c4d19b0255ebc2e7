import json
import os
import socket
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.metadata import version
from pathlib import Path

import pytest
from prefect import flow, runtime, task

from glint.flows.errors import ServerError
from glint.flows.runtime import prefect_server as module
from glint.flows.runtime import server_process
from glint.flows.runtime.given_server import check_given
from glint.flows.runtime.prefect_server import Server, ensure_server, start_server, stop_server
from glint.flows.runtime.server_process import FIRST_PORT, is_alive, process_start_time
from tests.polling import until
from tests.prefect_api import ask


@task
def double(value: int) -> int:
    return 2 * value


@flow
def doubled(value: int) -> tuple[int, str]:
    return double(value), str(runtime.flow_run.id)


def state_file(home: Path) -> Path:
    return home / "server" / socket.gethostname() / "server.json"


@pytest.fixture
def free_environment(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No server is named, and what a test sets is taken back."""
    before = os.environ.copy()
    monkeypatch.delenv("PREFECT_API_URL", raising=False)
    yield
    os.environ.clear()
    os.environ.update(before)


@pytest.fixture
def sleeper(monkeypatch: pytest.MonkeyPatch) -> None:
    """Instead of a server, a process that never answers."""
    monkeypatch.setattr(server_process, "_command", lambda port: [sys.executable, "-c", "import time; time.sleep(60)"])


@pytest.mark.server
def test_runs_report_to_the_server(server: Server) -> None:
    value, run = doubled(4)
    assert value == 8
    assert ask(f"{server.api_url}/flow_runs/{run}")["state"]["type"] == "COMPLETED"
    with urllib.request.urlopen(server.ui_url) as page:
        assert b"<html" in page.read()


@pytest.mark.server
def test_the_server_listens_on_loopback_alone_and_tells_nobody(server: Server) -> None:
    assert server.process is not None
    assert server.api_url.startswith("http://127.0.0.1:")
    environment = Path(f"/proc/{server.process[0]}/environ").read_text().split("\0")
    assert "PREFECT_SERVER_ANALYTICS_ENABLED=false" in environment
    settings = ask(f"{server.api_url}/admin/settings")
    assert settings["server"]["services"]["db_vacuum"]["enabled"] is True
    assert settings["server"]["ui"]["api_url"] == server.api_url


@pytest.mark.server
def test_other_processes_share_the_server(server: Server, glint_home: Path) -> None:
    code = "from glint.flows.runtime.prefect_server import ensure_server as e; s = e(); print(s.api_url, s.started)"
    environment = {name: value for name, value in os.environ.items() if name != "PREFECT_API_URL"}
    told = subprocess.run(
        [sys.executable, "-c", code],
        env=environment | {"GLINT_HOME": str(glint_home)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert told.stdout.split() == [server.api_url, "False"]


@pytest.mark.usefixtures("free_environment", "sleeper")
def test_two_starts_at_once_make_one_server(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path\n"
        "from glint.flows.runtime import prefect_server as server, server_process\n"
        "server_process._command = lambda port: [sys.executable, '-c', 'import time; time.sleep(60)']\n"
        "found = server.start_server(Path(sys.argv[1])); print(found.process[0], found.started)"
    )
    racers = [
        subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, text=True)
        for _ in range(4)
    ]
    told = [racer.communicate()[0].split() for racer in racers]
    assert len({pid for pid, _ in told}) == 1
    assert sorted(started for _, started in told) == ["False", "False", "False", "True"]
    assert stop_server(tmp_path)


@pytest.mark.usefixtures("free_environment", "sleeper")
def test_starting_does_not_wait(tmp_path: Path) -> None:
    begun = start_server(tmp_path)
    assert begun.started
    assert os.environ["PREFECT_API_URL"] == begun.api_url
    with pytest.raises(ServerError, match=r"gave no answer.*glint dashboard --stop"):
        begun.wait(seconds=0.2)
    assert stop_server(tmp_path)
    assert not stop_server(tmp_path)


@pytest.mark.usefixtures("free_environment")
def test_a_server_that_ends_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_process, "_command", lambda port: [sys.executable, "-c", "print('no room left')"])
    with pytest.raises(ServerError, match=r"no room left.*server\.log"):
        start_server(tmp_path).wait()


@pytest.mark.usefixtures("free_environment", "sleeper")
def test_a_dead_server_is_replaced(tmp_path: Path) -> None:
    first = start_server(tmp_path)
    process = first.process
    assert process is not None
    os.kill(process[0], 9)
    until(lambda: not is_alive(*process))
    os.environ.pop("PREFECT_API_URL")
    second = start_server(tmp_path)
    assert second.started
    assert second.process != process
    stop_server(tmp_path)


@pytest.mark.usefixtures("free_environment", "sleeper")
def test_a_number_that_another_process_has_now_is_not_believed(tmp_path: Path) -> None:
    start_server(tmp_path)
    stop_server(tmp_path)
    state = {"api_url": "http://127.0.0.1:1/api", "process": [os.getpid(), 1.0], "prefect": version("prefect")}
    state_file(tmp_path).write_text(json.dumps(state))
    os.environ.pop("PREFECT_API_URL")
    assert start_server(tmp_path).started
    assert stop_server(tmp_path)


@pytest.mark.usefixtures("free_environment", "sleeper")
@pytest.mark.parametrize("text", ["", "{", "[]", '{"api_url": "x"}', '{"process": 3, "api_url": "x", "prefect": "y"}'])
def test_a_damaged_state_is_as_none(tmp_path: Path, text: str) -> None:
    state_file(tmp_path).parent.mkdir(parents=True)
    state_file(tmp_path).write_text(text)
    assert start_server(tmp_path).started
    assert stop_server(tmp_path)


@pytest.mark.usefixtures("free_environment", "sleeper")
def test_a_server_of_another_version_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for part in (module, server_process):
        monkeypatch.setattr(part, "version", lambda name: "3.0.0")
    old = start_server(tmp_path)
    monkeypatch.undo()
    monkeypatch.setattr(server_process, "_command", lambda port: [sys.executable, "-c", "import time; time.sleep(60)"])
    os.environ.pop("PREFECT_API_URL", None)
    new = start_server(tmp_path)
    assert new.started
    assert old.process is not None
    assert not is_alive(*old.process)
    stop_server(tmp_path)


@pytest.mark.usefixtures("free_environment")
def test_a_taken_port_is_passed_over() -> None:
    with socket.socket() as taken:
        try:
            taken.bind(("127.0.0.1", FIRST_PORT))
            taken.listen()
        except OSError:
            pass  # taken by somebody else: as good
        first, claim = server_process.free_port()
        second, other = server_process.free_port()
        with claim, other:
            assert FIRST_PORT < first < second


@pytest.mark.usefixtures("free_environment")
def test_a_given_server_that_does_not_answer_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PREFECT_API_URL", "http://127.0.0.1:9/api")
    with pytest.raises(ServerError, match=r"PREFECT_API_URL=http://127\.0\.0\.1:9/api does not answer.*unset"):
        ensure_server(tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.server
@pytest.mark.usefixtures("free_environment")
def test_a_given_address_without_its_path_is_refused(monkeypatch: pytest.MonkeyPatch, server: Server) -> None:
    address = server.api_url.removesuffix("/api")
    monkeypatch.setenv("PREFECT_API_URL", address)
    with pytest.raises(ServerError) as caught:
        check_given(address)
    assert "404 Not Found" in caught.value.message and "http://HOST:PORT/api" in caught.value.remedy
    assert len(caught.value.message) < 200, "the answer's body is left out"


@pytest.mark.usefixtures("free_environment")
@pytest.mark.parametrize("url", ["nonsense", "http://", "localhost:4200/api"])
def test_an_address_that_is_none_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, url: str) -> None:
    monkeypatch.setenv("PREFECT_API_URL", url)
    with pytest.raises(ServerError, match="PREFECT_API_URL"):
        ensure_server(tmp_path)


@pytest.mark.server
def test_a_given_server_is_used(server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PREFECT_API_URL", server.api_url)
    found = ensure_server(tmp_path)
    assert (found.api_url, found.ui_url, found.started) == (server.api_url, server.ui_url, False)
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("free_environment")
def test_a_home_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ServerError, match="GLINT_HOME"):
        start_server(tmp_path / "file")


def test_a_stranger_at_the_port_is_not_taken_for_our_server(tmp_path: Path) -> None:
    class Healthy(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Healthy) as stranger:
        threading.Thread(target=stranger.serve_forever, daemon=True).start()
        process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
        url = f"http://127.0.0.1:{stranger.server_port}/api"
        ours = Server(url, url, True, (process.pid, process_start_time(process.pid)), tmp_path / "server.log")
        with pytest.raises(ServerError, match="gave no answer"):
            ours.wait(1.0)
        process.kill()
        process.wait()
        (tmp_path / "server.log").write_text(
            "Port 1 is already in use. Please specify a different port with\nthe flag.\n"
        )
        with pytest.raises(ServerError, match="already in use"):
            ours.wait(1.0)
        stranger.shutdown()


def test_a_server_that_nobody_buries_has_ended_all_the_same(tmp_path: Path) -> None:
    code = (
        "import subprocess, sys, time\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)'])\n"
        "print(child.pid, flush=True)\n"
        "time.sleep(60)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    state = {
        "api_url": "http://127.0.0.1:1/api",
        "process": [child, process_start_time(child)],
        "prefect": version("prefect"),
    }
    state_file(tmp_path).parent.mkdir(parents=True)
    state_file(tmp_path).write_text(json.dumps(state))
    assert stop_server(tmp_path)
    assert not stop_server(tmp_path)
    parent.kill()
    parent.wait()
