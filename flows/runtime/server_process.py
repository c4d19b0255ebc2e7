"""The process of Glint's own Prefect server: its state file, its start and end, and its loopback port."""

import fcntl
import json
import logging
import os
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from urllib.parse import urlsplit

import psutil

from glint.flows.errors import ServerError
from glint.flows.runtime.environment import glint_home
from glint.flows.runtime.server_access import new_authentication, private_folder, write_private
from glint.flows.runtime.server_app import ORIGINS
from glint.flows.runtime.server_database import set_damaged_aside

FIRST_PORT = 4200
N_PORTS = 100
"""Ports from FIRST_PORT on that are tried before any free port is taken."""
KEEPER_SECONDS = 0.5
"""Interval at which a run checks that the server is alive."""
END_SECONDS = 10.0
"""Longest wait for a server that was told to end, before it is killed."""
START_TOLERANCE_SECONDS = 2.0
"""Difference of start times up to which a process is the same: the system reports whole seconds, read twice."""

_SETTINGS = {
    "DO_NOT_TRACK": "1",
    "PREFECT_CLI_PROMPT": "false",
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "PREFECT_SERVER_UI_SHOW_PROMOTIONAL_CONTENT": "false",
    "PREFECT_SERVER_UI_V2_ENABLED": "false",
    "PREFECT_SERVER_SERVICES_DB_VACUUM_ENABLED": "true",
    "PREFECT_SERVER_SERVICES_DB_VACUUM_RETENTION_PERIOD": str(30 * 24 * 3600),
    # With one transaction per event, SQLite rejects the next flow run, and its client backs off for two seconds.
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_READ_BATCH_SIZE": "100",
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_BATCH_SIZE": "100",
    # Whole seconds: the recorder truncates, and 0 makes it poll without pause.
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_FLUSH_INTERVAL": "1",
    "PREFECT_SERVER_SERVICES_EVENT_PERSISTER_READ_BATCH_SIZE": "100",
    "PREFECT_SERVER_SERVICES_EVENT_PERSISTER_BATCH_SIZE": "1000",
}
"""Settings of Glint's own server; those in the user's environment take precedence."""


@dataclass(frozen=True, slots=True)
class State:
    """The state file of Glint's own server.

    process: (pid, start time); prefect: version; authentication: user:password, empty for a server without one.
    """

    api_url: str
    process: tuple[int, float]
    prefect: str
    authentication: str = field(repr=False)


def server_folder(home: Path | None = None) -> Path:
    """Return the folder of the state file, log and database of this machine's server."""
    # A home can be shared by machines; a loopback server and its database cannot.
    return (home or glint_home()) / "server" / socket.gethostname()


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock the server against being started or stopped by another process.

    Raises:
        ServerError: the folder cannot be written, or belongs to another user.
    """
    private_folder(folder, home=folder.parents[1])
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def read_state(folder: Path) -> State | None:
    """Return the state file's content, None if there is none that is readable."""
    try:
        fields = json.loads((folder / "server.json").read_text())
        pid, created = fields["process"]
        return State(
            fields["api_url"], (int(pid), float(created)), fields["prefect"], str(fields.get("authentication", ""))
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None


def keep(folder: Path, ended: threading.Event) -> None:
    """Restart the server at its address whenever it has died, until `ended` is set; a stopped one stays stopped."""
    while not ended.wait(KEEPER_SECONDS):
        try:
            if (state := read_state(folder)) is None or is_alive(*state.process):
                continue
            with locked(folder):  # another run may have restarted it meanwhile
                if (state := read_state(folder)) is not None and not is_alive(*state.process):
                    spawn(folder, state)
        except Exception:  # a later attempt may succeed
            logging.getLogger(__name__).warning("the server could not be restarted", exc_info=True)


def spawn(folder: Path, previous: State | None = None) -> State:
    """Start a server and write its state file: at the address and with the password of a previous one, or new ones."""
    set_damaged_aside(folder)
    if previous is None:
        port, claim = free_port()
        authentication = new_authentication()
    else:
        port, authentication = urlsplit(previous.api_url).port or 0, previous.authentication
        claim = claim_port(port) or socket.socket(socket.AF_UNIX)
    origin = f"http://127.0.0.1:{port}"
    api_url = f"{origin}/api"
    settings = _SETTINGS | {name: value for name, value in os.environ.items() if not _of_client(name)}
    settings |= {
        ORIGINS: origin,
        "PREFECT_HOME": str(folder / "prefect"),
        "PREFECT_SERVER_API_AUTH_STRING": authentication,
        "PREFECT_SERVER_CORS_ALLOWED_ORIGINS": origin,
        "PREFECT_SERVER_UI_API_URL": api_url,
        "PREFECT_SERVER_UI_STATIC_DIRECTORY": str(folder / "pages"),
    }
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
    state = State(api_url, (child.pid, process_start_time(child.pid)), version("prefect"), authentication)
    write_private(folder / "server.json", json.dumps(asdict(state)))
    return state


def _command(port: int) -> list[str]:
    application = ["--factory", "glint.flows.runtime.server_app:create", "--no-proxy-headers", "--no-server-header"]
    application += ["--log-level", "warning"]
    return [sys.executable, "-m", "uvicorn", *application, "--host", "127.0.0.1", "--port", str(port)]


def _of_client(name: str) -> bool:
    return name.startswith("PREFECT_") and not name.startswith("PREFECT_SERVER_")


def stop(state: State) -> bool:
    """Stop a server; return False if it was not running."""
    if not is_alive(*state.process):
        return False
    process = psutil.Process(state.process[0])
    process.terminate()
    if not _has_ended(state):
        process.kill()
        _has_ended(state)
    return True


def _has_ended(state: State) -> bool:
    """Return whether the server ends within END_SECONDS; a zombie counts as ended."""
    deadline = time.monotonic() + END_SECONDS
    while is_alive(*state.process):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.05)
    return True


def answers(api_url: str) -> bool:
    """Return whether a server is healthy."""
    try:
        with urllib.request.urlopen(f"{api_url}/health", timeout=2) as answer:
            return bool(answer.status == 200)
    except OSError:
        return False


def listens(pid: int, api_url: str) -> bool:
    """Return whether this process listens at the port, which another server may have taken in the meantime."""
    port = int(api_url.removesuffix("/api").rpartition(":")[2])
    try:
        connections = psutil.Process(pid).net_connections("inet")
    except psutil.Error:
        return False
    return any(item.status == psutil.CONN_LISTEN and item.laddr.port == port for item in connections)


def free_port() -> tuple[int, socket.socket]:
    """Return the first free loopback port from FIRST_PORT on, or else any free port, and a claim to it.

    A server takes many seconds until it listens; the claim, which it inherits, keeps other servers off the port.

    Raises:
        ServerError: no port is free.
    """
    for port in [*range(FIRST_PORT, FIRST_PORT + N_PORTS), 0]:
        with socket.socket() as candidate:
            candidate.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                candidate.bind(("127.0.0.1", port))
            except OSError:
                continue
            number = int(candidate.getsockname()[1])
        claim = claim_port(number)
        if claim is not None:
            return number, claim
    raise ServerError("no loopback port is free", "set PREFECT_API_URL to a server of yours")


def claim_port(port: int) -> socket.socket | None:
    """Return a socket that keeps other servers of Glint off this port while it is open; None if one has the port."""
    claim = socket.socket(socket.AF_UNIX)
    try:
        if sys.platform == "linux":
            claim.bind(f"\0glint-port-{port}")
    except OSError:
        claim.close()
        return None
    return claim


def process_start_time(pid: int) -> float:
    """Return the seconds from the machine's start to the process's, which a change of the clock does not affect.

    Raises:
        psutil.NoSuchProcess: it has ended.
    """
    return float(psutil.Process(pid).create_time() - psutil.boot_time())


def is_alive(pid: int, start_time: float) -> bool:
    """Return whether the process `pid` that started at `start_time` still runs; its number may have been reused."""
    try:
        is_same = abs(process_start_time(pid) - start_time) < START_TOLERANCE_SECONDS
        return is_same and psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False
