"""The Prefect server of a run: the one at PREFECT_API_URL, else Glint's own, which all runs of this user share.

Glint's own server is a detached process with its database in Glint's home. It outlives the run, so that its dashboard
can be read afterwards. A cold start takes seconds: `start_server` returns at once, and `Server.wait` waits when the
server is needed. A run calls `start_server` before anything imports prefect, which reads its settings at import.
"""

import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

from glint.flows.errors import ServerError
from glint.flows.runtime.environment import prepare_environment
from glint.flows.runtime.given_server import check_given
from glint.flows.runtime.server_access import certificate_file, link
from glint.flows.runtime.server_database import damage, set_damaged_aside, take_notice
from glint.flows.runtime.server_process import (
    State,
    answers,
    is_alive,
    keep,
    listens,
    locked,
    read_state,
    server_folder,
    spawn,
    stop,
)

START_SECONDS = 120.0
"""Time that Glint's own server may take to start: it migrates its database first."""
START_POLL_SECONDS = 0.05
"""Interval at which a starting server is asked."""


@dataclass(frozen=True, slots=True)
class Server:
    """A Prefect server that answers, or is starting.

    For Glint's own server: process: (pid, start time); log: its output; authentication: user:password. None for the
    server at PREFECT_API_URL, whose password is in the environment.
    """

    api_url: str
    ui_url: str
    started: bool
    process: tuple[int, float] | None = None
    log: Path | None = None
    authentication: str | None = field(default=None, repr=False)

    def link(self, page: str = "") -> str:
        """Return the address of a page for the user to open: on Glint's own server it opens without a password."""
        if self.authentication is None:
            return f"{self.ui_url}/{page}".removesuffix("/")
        return link(self.ui_url, self.authentication, page)

    def wait(self, seconds: float = START_SECONDS) -> None:
        """Return when the server answers.

        Raises:
            ServerError: it does not, or its process has ended.
        """
        if self.process is None:
            check_given(self.api_url)
            return
        deadline = time.monotonic() + seconds
        while not (listens(self.process[0], self.api_url) and answers(self.api_url)):
            if not is_alive(*self._process_now()):
                raise ServerError(f"the Prefect server ended while it started ({_last_line(self.log)})", self._remedy())
            if time.monotonic() > deadline:
                raise ServerError(f"the Prefect server at {self.api_url} gave no answer", self._remedy())
            time.sleep(START_POLL_SECONDS)

    @contextmanager
    def connected(self) -> Iterator[None]:
        """Wait, then have the flows that are called inside report to this server, whenever prefect was imported.

        Glint's own server is restarted at its address if it dies in the meantime.
        """
        self.wait()
        from prefect.settings import PREFECT_FLOWS_HEARTBEAT_FREQUENCY, temporary_settings

        settings = self._settings()
        if self.process is not None:
            # The thread of heartbeats costs every flow run up to a second at its end. Local runs are found to be
            # orphaned by the tag of their process (`orphaned_runs`), only scheduled ones by their heartbeats.
            settings[PREFECT_FLOWS_HEARTBEAT_FREQUENCY] = None
        with temporary_settings(settings), self._kept():
            yield

    def notice(self) -> str:
        """Return what the user has to know of the server and has not been shown yet, empty if there is nothing."""
        return "" if self.log is None else take_notice(self.log.parent)

    @contextmanager
    def reached(self) -> Iterator[None]:
        """Have clients that are made inside ask this server, which answers already."""
        from prefect.settings import temporary_settings

        with temporary_settings(self._settings()):
            yield

    def _settings(self) -> dict[Any, Any]:
        """Return the settings of Prefect with which clients reach this server."""
        from prefect.settings import (
            PREFECT_API_AUTH_STRING,
            PREFECT_API_SSL_CERT_FILE,
            PREFECT_API_URL,
            PREFECT_CLIENT_CSRF_SUPPORT_ENABLED,
            PREFECT_SERVER_CSRF_PROTECTION_ENABLED,
        )

        settings: dict[Any, Any] = {PREFECT_API_URL: self.api_url}
        if self.authentication is not None:
            settings[PREFECT_API_AUTH_STRING] = self.authentication
        if self.log is not None:
            settings[PREFECT_API_SSL_CERT_FILE] = str(certificate_file(self.log.parent))
            # A client asks for a token that this server does not want, once in each flow run.
            settings[PREFECT_CLIENT_CSRF_SUPPORT_ENABLED] = PREFECT_SERVER_CSRF_PROTECTION_ENABLED.value()
        return settings

    @contextmanager
    def _kept(self) -> Iterator[None]:
        if self.log is None:
            yield
            return
        ended = threading.Event()
        keeper = threading.Thread(target=keep, args=(self.log.parent, ended), name="glint-server", daemon=True)
        keeper.start()
        try:
            yield
        finally:
            ended.set()
            keeper.join()

    def _process_now(self) -> tuple[int, float]:
        """Return the server's process, which may have been restarted."""
        assert self.process is not None and self.log is not None
        state = read_state(self.log.parent)
        return self.process if state is None else state.process

    def _remedy(self) -> str:
        return f"see {self.log}; `glint dashboard --stop` and run again, or set PREFECT_API_URL to a server of yours"


def ensure_server(home: Path | None = None) -> Server:
    """Return a Prefect server that answers: `start_server`, then `wait`."""
    server = start_server(home)
    server.wait()
    return server


def start_server(home: Path | None = None) -> Server:
    """Return the server of this process and start it if there is none, without waiting for it.

    Sets PREFECT_API_URL and the other settings of Prefect in the environment. Two runs that start at the same time
    share one server.

    Raises:
        ServerError: Glint's home cannot be written.
    """
    folder = server_folder(home)
    given = _given_address(folder)
    if given:
        prepare_environment()
        return Server(given, _ui_url(given), started=False)
    with locked(folder):
        state = read_state(folder)
        if state is not None and (state.prefect != version("prefect") or not state.authentication):
            stop(state)
            state = None
        if state is not None and is_alive(*state.process) and (cause := damage(folder, answers(state.api_url))):
            stop(state)
            set_damaged_aside(folder, cause)
            state = None
        started = state is None or not is_alive(*state.process)
        if state is None or started:
            state = spawn(folder)
    return _own_server(folder, state, started)


def running_server(home: Path | None = None) -> Server | None:
    """Return the server of this process if one is up: the one at PREFECT_API_URL, else Glint's own; start none.

    Raises:
        ServerError: the one at PREFECT_API_URL does not answer.
    """
    folder = server_folder(home)
    given = _given_address(folder)
    if given:
        prepare_environment()
        check_given(given)
        return Server(given, _ui_url(given), started=False)
    state = read_state(folder)
    if state is None or not is_alive(*state.process) or not answers(state.api_url) or damage(folder, is_up=True):
        return None
    return _own_server(folder, state, started=False)


def server_damage() -> str:
    """Return what is wrong with the database of Glint's own server, empty if it is whole or not in use."""
    folder = server_folder()
    return "" if _given_address(folder) else damage(folder)


def stop_server(home: Path | None = None) -> bool:
    """Stop Glint's own server; return False if none was running."""
    folder = server_folder(home)
    with locked(folder):
        state = read_state(folder)
        (folder / "server.json").unlink(missing_ok=True)
        return state is not None and stop(state)


def _given_address(folder: Path) -> str | None:
    """Return PREFECT_API_URL, None if it is the address of Glint's own server, whose password is in its state file."""
    given = os.environ.get("PREFECT_API_URL")
    state = read_state(folder)
    if given and state is not None and given.rstrip("/") == state.api_url and is_alive(*state.process):
        return None
    return given or None


def _own_server(folder: Path, state: State, started: bool) -> Server:
    """Return Glint's own server, and hand its address and password to clients by the environment."""
    prepare_environment(state.api_url, folder / "prefect", state.authentication)
    log = folder / "server.log"
    return Server(state.api_url, _ui_url(state.api_url), started, state.process, log, state.authentication)


def _ui_url(api_url: str) -> str:
    return api_url.removesuffix("/").removesuffix("/api")


def _last_line(log: Path | None) -> str:
    lines = log.read_text(errors="replace").strip().splitlines() if log is not None else []
    return " ".join(line.strip() for line in lines[-2:]) or "its log is empty"
