"""The Prefect server of a run: the one at PREFECT_API_URL, else one of our own that all runs of this user share.

Our own server is a detached process with its database in Glint's home. It outlives the run, so that its dashboard can
be read afterwards. A cold start takes seconds: `start_server` returns at once, and `Server.wait` comes when the
server is needed. Whoever starts a run calls `start_server` before anything imports prefect, which reads its settings
at import.
"""

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
from typing import Any
from urllib.parse import urlsplit

import psutil

from flows.errors import ServerError
from flows.processes import born, is_alive
from flows.settings import glint_home, prepare_environment

FIRST_PORT = 4200
START_SECONDS = 120.0
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
class Server:
    """A Prefect server that answers, or is about to.

    `process` is (pid, time of creation) of our own server, None for one at PREFECT_API_URL; `log` is its output.
    """

    api_url: str
    ui_url: str
    started: bool
    process: tuple[int, float] | None = None
    log: Path | None = None

    def wait(self, seconds: float = START_SECONDS) -> None:
        """Return when the server answers.

        Raises:
            ServerError: it does not, or its process has ended.
        """
        if self.process is None:
            _check_given(self.api_url)
            return
        deadline = time.monotonic() + seconds
        while not (_listens(self.process[0], self.api_url) and _answers(self.api_url)):
            if not is_alive(*self._process_now()):
                raise ServerError(f"the Prefect server ended while it started ({_last_line(self.log)})", self._remedy())
            if time.monotonic() > deadline:
                raise ServerError(f"the Prefect server at {self.api_url} gave no answer", self._remedy())
            time.sleep(0.05)

    @contextmanager
    def connected(self) -> Iterator[None]:
        """Wait, then let the flows that are called inside report to this server, whenever prefect was imported.

        Our own server is started again at its address if it dies meanwhile.
        """
        self.wait()
        from prefect.settings import PREFECT_API_URL, PREFECT_FLOWS_HEARTBEAT_FREQUENCY, temporary_settings

        settings: dict[Any, Any] = {PREFECT_API_URL: self.api_url}
        if self.process is not None:
            # Ending the thread of heartbeats costs every flow run up to a second; `flows.zombies` does without them.
            settings[PREFECT_FLOWS_HEARTBEAT_FREQUENCY] = None
        with temporary_settings(settings), self._kept():
            yield

    @contextmanager
    def reached(self) -> Iterator[None]:
        """Let what is called inside ask this server, which answers already."""
        from prefect.settings import PREFECT_API_URL, temporary_settings

        with temporary_settings({PREFECT_API_URL: self.api_url}):
            yield

    @contextmanager
    def _kept(self) -> Iterator[None]:
        if self.log is None:
            yield
            return
        ended = threading.Event()
        keeper = threading.Thread(target=_keep, args=(self.log.parent, ended), name="glint-server", daemon=True)
        keeper.start()
        try:
            yield
        finally:
            ended.set()
            keeper.join()

    def _process_now(self) -> tuple[int, float]:
        """The server's process, which may have been started again."""
        assert self.process is not None and self.log is not None
        state = _read_state(self.log.parent)
        return self.process if state is None else state.process

    def _remedy(self) -> str:
        return f"see {self.log}; `glint dashboard --stop` and run again, or set PREFECT_API_URL to a server of yours"


def ensure_server(home: Path | None = None) -> Server:
    """A Prefect server that answers now: `start_server`, then `wait`."""
    server = start_server(home)
    server.wait()
    return server


def start_server(home: Path | None = None) -> Server:
    """Name the server of this process and start it if there is none, without waiting for it.

    Sets PREFECT_API_URL and the other settings of Prefect in the environment. Two runs that start at the same time
    share one server.

    Raises:
        ServerError: Glint's home cannot be written.
    """
    given = os.environ.get("PREFECT_API_URL")
    if given:
        prepare_environment()
        return Server(given, _ui_url(given), started=False)
    folder = _folder(home)
    with _locked(folder):
        state = _read_state(folder)
        if state is not None and state.prefect != version("prefect"):
            _stop(state)
            state = None
        started = state is None or not is_alive(*state.process)
        if state is None or started:
            state = _spawn(folder)
    prepare_environment(state.api_url, folder / "prefect")
    return Server(state.api_url, _ui_url(state.api_url), started, state.process, folder / "server.log")


def running_server(home: Path | None = None) -> Server | None:
    """The server of this process if one is up: the one at PREFECT_API_URL, else our own; none is started.

    Raises:
        ServerError: the one at PREFECT_API_URL does not answer.
    """
    given = os.environ.get("PREFECT_API_URL")
    if given:
        prepare_environment()
        _check_given(given)
        return Server(given, _ui_url(given), started=False)
    folder = (home or glint_home()) / "server" / socket.gethostname()
    state = _read_state(folder)
    if state is None or not is_alive(*state.process) or not _answers(state.api_url):
        return None
    prepare_environment(state.api_url, folder / "prefect")
    return Server(state.api_url, _ui_url(state.api_url), False, state.process, folder / "server.log")


def stop_server(home: Path | None = None) -> bool:
    """End our own server; False if none was running."""
    folder = _folder(home)
    with _locked(folder):
        state = _read_state(folder)
        (folder / "server.json").unlink(missing_ok=True)
        return state is not None and _stop(state)


@dataclass(frozen=True, slots=True)
class _State:
    """What Glint's home says about our own server; `prefect` is the version it runs."""

    api_url: str
    process: tuple[int, float]
    prefect: str


def _folder(home: Path | None) -> Path:
    # A home can be shared by machines; a loopback server and its database cannot.
    return (home or glint_home()) / "server" / socket.gethostname()


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
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


def _read_state(folder: Path) -> _State | None:
    try:
        fields = json.loads((folder / "server.json").read_text())
        pid, created = fields["process"]
        return _State(fields["api_url"], (int(pid), float(created)), fields["prefect"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _keep(folder: Path, ended: threading.Event) -> None:
    """Start the server again, at its address, whenever it has died; one that was stopped stays so."""
    while not ended.wait(KEEPER_SECONDS):
        with _locked(folder):
            state = _read_state(folder)
            if state is not None and not is_alive(*state.process):
                _spawn(folder, urlsplit(state.api_url).port)


def _spawn(folder: Path, port: int | None = None) -> _State:
    port, claim = (port, _claim(port) or socket.socket(socket.AF_UNIX)) if port else _free_port()
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
    state = _State(api_url, (child.pid, born(child.pid)), version("prefect"))
    (folder / "server.json").write_text(json.dumps(asdict(state)))
    return state


def _command(port: int) -> list[str]:
    return [sys.executable, "-m", "prefect", "server", "start", "--host", "127.0.0.1", "--port", str(port)]


def _of_client(name: str) -> bool:
    return name.startswith("PREFECT_") and not name.startswith("PREFECT_SERVER_")


def _free_port() -> tuple[int, socket.socket]:
    """The first free loopback port from 4200, any free one if the next hundred are taken; and a claim to it.

    A server takes many seconds until it listens: the claim, which it inherits, keeps others that start meanwhile off.
    """
    for port in [*range(FIRST_PORT, FIRST_PORT + 100), 0]:
        with socket.socket() as candidate:
            candidate.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                candidate.bind(("127.0.0.1", port))
            except OSError:
                continue
            found = int(candidate.getsockname()[1])
        claim = _claim(found)
        if claim is not None:
            return found, claim
    raise ServerError("no loopback port is free", "set PREFECT_API_URL to a server of yours")


def _claim(port: int) -> socket.socket | None:
    """What keeps other servers of Glint off this port as long as it is open; None if one of them has it."""
    claim = socket.socket(socket.AF_UNIX)
    try:
        if sys.platform == "linux":
            claim.bind(f"\0glint-port-{port}")
    except OSError:
        claim.close()
        return None
    return claim


def _stop(state: _State) -> bool:
    if not is_alive(*state.process):
        return False
    process = psutil.Process(state.process[0])
    process.terminate()
    if not _has_ended(state):
        process.kill()
        _has_ended(state)
    return True


def _has_ended(state: _State, seconds: float = 10.0) -> bool:
    """Whether the server ends within so long; one whose parent never asks for its end has ended all the same."""
    deadline = time.monotonic() + seconds
    while is_alive(*state.process):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.05)
    return True


def _answers(api_url: str) -> bool:
    try:
        with urllib.request.urlopen(f"{api_url}/health", timeout=2) as answer:
            return bool(answer.status == 200)
    except (OSError, urllib.error.URLError):
        return False


def _listens(pid: int, api_url: str) -> bool:
    """Whether this very process has the port: another server may have taken it since it was found free."""
    port = int(api_url.removesuffix("/api").rpartition(":")[2])
    try:
        connections = psutil.Process(pid).net_connections("inet")
    except psutil.Error:
        return False
    return any(each.status == psutil.CONN_LISTEN and each.laddr.port == port for each in connections)


def _check_given(api_url: str) -> None:
    from prefect.client.orchestration import get_client
    from prefect.settings import PREFECT_API_URL, temporary_settings

    error: Exception | None
    try:
        with temporary_settings({PREFECT_API_URL: api_url}), get_client(sync_client=True) as client:
            error = client.api_healthcheck()
    except ValueError as unusable:
        error = unusable
    if error is not None:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ServerError(
            f"the Prefect server at PREFECT_API_URL={api_url} does not answer ({reason})",
            "start that server, correct the address, or unset PREFECT_API_URL to use Glint's own",
        )


def _ui_url(api_url: str) -> str:
    return api_url.removesuffix("/").removesuffix("/api")


def _last_line(log: Path | None) -> str:
    lines = log.read_text(errors="replace").strip().splitlines() if log is not None else []
    return " ".join(line.strip() for line in lines[-2:]) or "it said nothing"
