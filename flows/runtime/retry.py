"""Retry a call when the Prefect server is temporarily unreachable, or has lost its database under the call.

Finished stages are not computed again.
"""

import os
import threading
import time
from collections.abc import Callable

import httpx
from prefect.client.orchestration import get_client
from prefect.exceptions import ObjectNotFound, PrefectHTTPStatusError

from glint.flows.errors import ServerError
from glint.flows.runtime.server_database import damage, set_damaged_aside
from glint.flows.runtime.server_process import answers, is_alive, locked, read_state, server_folder, spawn, stop

MAX_ATTEMPTS = 5
RECONNECT_TIMEOUT_SECONDS = 120.0

_replacing = threading.Lock()
_is_replaced = threading.Event()
"""Set once this process has replaced a damaged database: calls that began before it fail, however late they end."""


def retry_on_disconnect[**P, R](call: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> R:
    """Call a flow or function; if the server becomes unreachable meanwhile, wait for it and call again.

    If the database of Glint's own server is damaged, the server goes on with a new one.

    Raises:
        ServerError: it does not answer in time, or became unreachable at every attempt, or lost its database.
    """
    for _ in range(MAX_ATTEMPTS):
        try:
            return call(*args, **kwargs)
        except httpx.TransportError:
            wait_for_server()
        except (PrefectHTTPStatusError, ObjectNotFound):
            # A new database does not know the runs that began in the old one, so these cannot go on.
            if not _replace_damaged_database():
                raise
            raise ServerError(
                "the dashboard's database was damaged during the run; the dashboard begins anew, results are untouched",
                "run again: what is finished is kept",
            ) from None
    raise ServerError(
        f"the Prefect server went away {MAX_ATTEMPTS} times", "see that it has memory and disk, run again"
    )


def wait_for_server() -> None:
    """Return when the server of this process answers.

    Raises:
        ServerError: it does not within RECONNECT_TIMEOUT_SECONDS.
    """
    deadline = time.monotonic() + RECONNECT_TIMEOUT_SECONDS
    with get_client(sync_client=True) as client:
        while (error := client.api_healthcheck()) is not None:
            if time.monotonic() > deadline:
                raise ServerError(
                    f"the Prefect server at {client.api_url} has gone away ({type(error).__name__})",
                    "start it again, and run again: finished stages are kept",
                )
            time.sleep(0.2)


def _replace_damaged_database() -> bool:
    """Start Glint's own server with a new database if its own is damaged; return whether it was, or has been before.

    The server keeps its address and password. Several threads may call this at once.
    """
    folder = server_folder()
    state = read_state(folder)
    if state is None or os.environ.get("PREFECT_API_URL", state.api_url).rstrip("/") != state.api_url:
        return False
    with _replacing, locked(folder):
        state = read_state(folder) or state
        cause = damage(folder, is_up=is_alive(*state.process) and answers(state.api_url))
        if not cause:
            return _is_replaced.is_set()
        stop(state)
        set_damaged_aside(folder, cause)
        spawn(folder, state)
        _is_replaced.set()
    return True
