"""Requests to the API of a Prefect server with the password that the environment holds."""

import json
import os
import urllib.request
from base64 import b64encode
from typing import Any


def ask(url: str, body: object = None, authentication: str | None = None, seconds: float = 60.0) -> Any:
    """The answer to a request: POST if there is a body, else GET."""
    known = authentication or os.environ.get("PREFECT_API_AUTH_STRING", "")
    headers = {"Content-Type": "application/json", "Authorization": f"Basic {b64encode(known.encode()).decode()}"}
    data = None if body is None else json.dumps(body).encode()
    with urllib.request.urlopen(urllib.request.Request(url, data, headers), timeout=seconds) as answer:
        return json.load(answer)
