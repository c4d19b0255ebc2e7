"""A Prefect server that is away for a while: what it interrupted is begun again, and goes on from what is stored."""

import time
from collections.abc import Callable

import httpx
from prefect.client.orchestration import get_client

from glint.flows.errors import ServerError

ATTEMPTS = 5
AWAY_SECONDS = 120.0
"""How long a server may take to come back."""


def patiently[**P, R](run: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> R:
    """Call a flow; if the server goes away meanwhile, wait for it and call the flow again.

    Raises:
        ServerError: it does not come back, or goes away every time.
    """
    for _ in range(ATTEMPTS):
        try:
            return run(*args, **kwargs)
        except httpx.TransportError:
            wait_for_server()
    raise ServerError(f"the Prefect server went away {ATTEMPTS} times", "see that it has memory and disk, run again")


def wait_for_server() -> None:
    """Return when the server of this process answers.

    Raises:
        ServerError: it does not within two minutes.
    """
    deadline = time.monotonic() + AWAY_SECONDS
    with get_client(sync_client=True) as client:
        while (error := client.api_healthcheck()) is not None:
            if time.monotonic() > deadline:
                raise ServerError(
                    f"the Prefect server at {client.api_url} has gone away ({type(error).__name__})",
                    "start it again, and run again: finished stages are kept",
                )
            time.sleep(0.2)
