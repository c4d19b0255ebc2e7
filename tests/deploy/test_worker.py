"""`glint worker` and `glint prefect`: Prefect's own command with address and password of the server that runs now."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from glint.flows.deployments import worker
from glint.flows.runtime.prefect_server import Server
from glint.flows.runtime.server_process import process_start_time
from tests.polling import until


@pytest.fixture
def clean_environment() -> Iterator[None]:
    before = os.environ.copy()
    yield
    os.environ.clear()
    os.environ.update(before)


def write_state(folder: Path, port: int, authentication: str) -> None:
    state = {"api_url": f"http://127.0.0.1:{port}/api", "prefect": "3", "authentication": authentication}
    text = json.dumps(state | {"process": [os.getpid(), process_start_time(os.getpid())]})
    (folder / "draft").write_text(text)
    (folder / "draft").replace(folder / "server.json")


@pytest.mark.usefixtures("clean_environment")
def test_a_worker_follows_a_server_with_another_password(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started = list[tuple[str | None, str | None]]()

    def start(arguments: object) -> subprocess.Popen[bytes]:
        assert arguments == ["worker", "start", "--pool", "lab"]
        started.append((os.environ.get("PREFECT_API_URL"), os.environ.get("PREFECT_API_AUTH_STRING")))
        code = "import time; time.sleep(600)" if len(started) == 1 else "raise SystemExit(7)"
        return subprocess.Popen([sys.executable, "-c", code])

    def replace_server() -> None:
        until(lambda: started)
        write_state(tmp_path, 4202, "glint:second")

    monkeypatch.setattr(worker, "_start", start)
    monkeypatch.setattr(worker, "WORK_POLL_SECONDS", 0.1)
    monkeypatch.setenv("PREFECT_API_URL", "http://127.0.0.1:4201/api")
    monkeypatch.setenv("PREFECT_API_AUTH_STRING", "glint:first")
    write_state(tmp_path, 4201, "glint:first")
    threading.Thread(target=replace_server).start()
    server = Server("http://127.0.0.1:4201/api", "http://127.0.0.1:4201", False, log=tmp_path / "server.log")
    assert worker.run_worker(server, "lab") == 7
    assert started == [
        ("http://127.0.0.1:4201/api", "glint:first"),
        ("http://127.0.0.1:4202/api", "glint:second"),
    ]


@pytest.mark.server
def test_a_work_pool_is_known_once_it_is_made(server: Server) -> None:
    with server.connected():
        assert not worker.has_pool("misspelt")
        assert worker.run_prefect(["work-pool", "create", "misspelt", "--type", "process"]) == 0
        assert worker.has_pool("misspelt")


@pytest.mark.server
@pytest.mark.slow
def test_what_deploy_prints_works_as_printed(server: Server, glint_home: Path, tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    environment |= {"GLINT_HOME": str(glint_home), "GLINT_STORE": str(tmp_path / "store")}
    (tmp_path / "inbox").mkdir()

    def output_of(*words: str) -> str:
        command = [sys.executable, "-m", "glint", *words]
        done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=200)
        assert done.returncode == 0, done.stderr + done.stdout
        return done.stdout

    printed = output_of("deploy", "--inbox", "inbox", "--pool", "printed")
    assert "next: glint worker --pool printed" in printed and "glint inbox --now" in printed
    assert server.authentication is not None
    assert server.authentication not in printed and server.authentication.partition(":")[2] not in printed
    listing = output_of("inbox", "--now")
    assert (
        "no worker serves the inbox: glint worker --pool printed" in listing
        and f"{server.ui_url}/glint/runs/flow-run/" in listing
    )
    assert "Scheduled" in output_of("inbox", "--json")
    assert "inbox/nightly" in output_of("prefect", "deployment", "ls")
