"""The process of our own Prefect server: its state in Glint's home, its start, and its end."""

import fcntl
import json
import os
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from urllib.parse import urlsplit

import psutil

from glint.flows.errors import ServerError
from glint.flows.runtime.environment import glint_home
from glint.flows.runtime.ports import claim_port, free_port
from glint.flows.runtime.processes import born, is_alive

KEEPER_SECONDS = 0.5

_SETTINGS = {
    "DO_NOT_TRACK": "1",
    "PREFECT_CLI_PROMPT": "false",
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "PREFECT_SERVER_UI_SHOW_PROMOTIONAL_CONTENT": "false",
    "PREFECT_SERVER_SERVICES_DB_VACUUM_ENABLED": "true",
    "PREFECT_SERVER_SERVICES_DB_VACUUM_RETENTION_PERIOD": str(30 * 24 * 3600),
    # With a transaction for every event, SQLite turns away the next flow run, and its client sleeps for two seconds.
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_READ_BATCH_SIZE": "100",
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_BATCH_SIZE": "100",
    # Whole seconds: the recorder truncates, and with 0 it never rests.
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_FLUSH_INTERVAL": "1",
    "PREFECT_SERVER_SERVICES_EVENT_PERSISTER_READ_BATCH_SIZE": "100",
    "PREFECT_SERVER_SERVICES_EVENT_PERSISTER_BATCH_SIZE": "1000",
}
"""Our own server's settings; what the user has set in the environment goes before them."""


@dataclass(frozen=True, slots=True)
class State:
    """What Glint's home says about our own server; `prefect` is the version it runs."""

    api_url: str
    process: tuple[int, float]
    prefect: str


def server_folder(home: Path | None = None) -> Path:
    """Where the state, the log and the database of this machine's server are."""
    # A home can be shared by machines; a loopback server and its database cannot.
    return (home or glint_home()) / "server" / socket.gethostname()


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Let nobody else start or stop the server meanwhile.

    Raises:
        ServerError: the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        lock = (folder / "lock").open("w")
    except OSError as error:
        raise ServerError(
            f"{folder} cannot be written ({error.strerror})", "set GLINT_HOME to a folder of yours"
        ) from None
    with lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def read_state(folder: Path) -> State | None:
    """What is written of the server, None if nothing readable is."""
    try:
        fields = json.loads((folder / "server.json").read_text())
        pid, created = fields["process"]
        return State(fields["api_url"], (int(pid), float(created)), fields["prefect"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def keep(folder: Path, ended: threading.Event) -> None:
    """Start the server again, at its address, whenever it has died; one that was stopped stays so."""
    while not ended.wait(KEEPER_SECONDS):
        with locked(folder):
            state = read_state(folder)
            if state is not None and not is_alive(*state.process):
                spawn(folder, urlsplit(state.api_url).port)


def spawn(folder: Path, port: int | None = None) -> State:
    """Start a server, at a port that is free unless one is given, and write its state."""
    port, claim = (port, claim_port(port) or socket.socket(socket.AF_UNIX)) if port else free_port()
    api_url = f"http://127.0.0.1:{port}/api"
    settings = _SETTINGS | {name: value for name, value in os.environ.items() if not _of_client(name)}
    settings |= {"PREFECT_HOME": str(folder / "prefect"), "PREFECT_SERVER_UI_API_URL": api_url}
    with claim, (folder / "server.log").open("w") as log:
        child = subprocess.Popen(
            _command(port),
            env=settings,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            cwd=folder,
            start_new_session=True,
            pass_fds=[claim.fileno()],
        )
    state = State(api_url, (child.pid, born(child.pid)), version("prefect"))
    (folder / "server.json").write_text(json.dumps(asdict(state)))
    return state


def _command(port: int) -> list[str]:
    return [sys.executable, "-m", "prefect", "server", "start", "--host", "127.0.0.1", "--port", str(port)]


def _of_client(name: str) -> bool:
    return name.startswith("PREFECT_") and not name.startswith("PREFECT_SERVER_")


def stop(state: State) -> bool:
    """End a server; False if it was not running."""
    if not is_alive(*state.process):
        return False
    process = psutil.Process(state.process[0])
    process.terminate()
    if not _has_ended(state):
        process.kill()
        _has_ended(state)
    return True


def _has_ended(state: State, seconds: float = 10.0) -> bool:
    """Whether the server ends within so long; one whose parent never asks for its end has ended all the same."""
    deadline = time.monotonic() + seconds
    while is_alive(*state.process):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.05)
    return True


def answers(api_url: str) -> bool:
    """Whether a server is healthy."""
    try:
        with urllib.request.urlopen(f"{api_url}/health", timeout=2) as answer:
            return bool(answer.status == 200)
    except (OSError, urllib.error.URLError):
        return False


def listens(pid: int, api_url: str) -> bool:
    """Whether this very process has the port: another server may have taken it since it was found free."""
    port = int(api_url.removesuffix("/api").rpartition(":")[2])
    try:
        connections = psutil.Process(pid).net_connections("inet")
    except psutil.Error:
        return False
    return any(each.status == psutil.CONN_LISTEN and each.laddr.port == port for each in connections)
