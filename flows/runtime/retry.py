"""Retry a call when the Prefect server is temporarily unreachable; finished stages are not computed again."""

import time
from collections.abc import Callable

import httpx
from prefect.client.orchestration import get_client

from glint.flows.errors import ServerError

MAX_ATTEMPTS = 5
RECONNECT_TIMEOUT_SECONDS = 120.0


def retry_on_disconnect[**P, R](call: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> R:
    """Call a flow or function; if the server becomes unreachable meanwhile, wait for it and call again.

    Raises:
        ServerError: it does not answer in time, or became unreachable at every attempt.
    """
    for _ in range(MAX_ATTEMPTS):
        try:
            return call(*args, **kwargs)
        except httpx.TransportError:
            wait_for_server()
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
