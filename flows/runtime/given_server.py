"""The Prefect server at PREFECT_API_URL, which somebody else has started: does it answer, and with this password?"""

import os
from http import HTTPStatus
from typing import Any

from glint.flows.errors import ServerError


def check_given(api_url: str) -> None:
    """Return if the server at PREFECT_API_URL answers, with the password of the environment.

    Raises:
        ServerError: it does not, or wants another password.
    """
    from prefect.client.orchestration import get_client
    from prefect.settings import PREFECT_API_URL, temporary_settings

    error: Exception | None
    try:
        with temporary_settings({PREFECT_API_URL: api_url}), get_client(sync_client=True) as client:
            error = client.api_healthcheck()
            if error is None:
                _check_password(client)
    except ValueError as unusable:
        error = unusable
    if error is not None:
        # What httpx adds after the dash is the answer's body and a page that explains status codes.
        reason = str(error).splitlines()[0].partition(" - ")[0] if str(error) else type(error).__name__
        raise ServerError(
            f"the Prefect server at PREFECT_API_URL={api_url} does not answer ({reason})",
            "start it, correct the address (http://HOST:PORT/api), or unset PREFECT_API_URL to use Glint's own",
        )


def _check_password(client: Any) -> None:
    """Ask a server what it answers to those who have its password alone: anybody may see its health."""
    from prefect.exceptions import PrefectHTTPStatusError

    try:
        client.api_version()
    except PrefectHTTPStatusError as error:
        if error.response.status_code not in (HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN):
            raise
        is_wrong = "the password in PREFECT_API_AUTH_STRING is wrong"
        reason = is_wrong if os.environ.get("PREFECT_API_AUTH_STRING") else "PREFECT_API_AUTH_STRING is not set"
        raise ServerError(
            f"the Prefect server at PREFECT_API_URL={client.api_url} wants another password ({reason})",
            "set PREFECT_API_AUTH_STRING to the server's user:password, or unset PREFECT_API_URL to use Glint's own",
        ) from None
