"""Prefect's server behind a guard: `uvicorn --factory glint.flows.runtime.server_app:create`.

Prefect itself answers requests of every origin and with every Host header, and has a second set of pages, which ask
other hosts. The guard refuses what does not come from the server's own pages or from a program that knows its address,
forbids pages to load anything from elsewhere, and opens the pages for the token of a link (`server_access.link`).
"""

import os
import time
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from glint.flows.runtime.server_access import OPENING_PATH, Tokens, header_value
from glint.tasks.engine.imports import collection_paused

ORIGINS = "GLINT_SERVER_ORIGINS"
"""Variable with the addresses under which browsers and clients reach the server, separated by commas."""

MAX_TOKEN_BYTES = 1000
"""Bytes of a request that carries a token; longer ones are refused unread."""

_OPENING_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Glint</title><script src="/glint/open.js" defer></script></head>
<body><p id="message">Opening the dashboard ..</p></body></html>
"""

# Prefect's pages take the password from localStorage["prefect-password"].
_OPENING_SCRIPT = """
async function open() {
  const page = "/" + location.pathname.slice("/glint/".length).replace(/^[\\/\\\\]+/, "");
  const token = location.hash.slice(1);
  history.replaceState(null, "", location.pathname);
  const answer = await fetch("/glint/session", {method: "POST", body: token});
  if (answer.ok) localStorage.setItem("prefect-password", await answer.text());
  const known = localStorage.getItem("prefect-password");
  const check = await fetch("/api/admin/version", {headers: {Authorization: `Basic ${known}`}});
  if (check.ok) location.replace(page);
  else document.getElementById("message").textContent =
    "This link was opened before, or is too old: glint dashboard prints a new one.";
}
open();
"""


def create() -> ASGIApp:
    """Return Prefect's server behind the guard, configured by the environment.

    Raises:
        ValueError: GLINT_SERVER_ORIGINS is absent or names no address, or there is no password.
    """
    origins = [origin.strip().rstrip("/") for origin in os.environ.get(ORIGINS, "").split(",") if origin.strip()]
    if not origins or not all(urlsplit(origin).hostname for origin in origins):
        raise ValueError(f"{ORIGINS}={os.environ.get(ORIGINS, '')!r}: give addresses such as http://127.0.0.1:4200")
    authentication = os.environ.get("PREFECT_SERVER_API_AUTH_STRING")
    if not authentication:
        raise ValueError("PREFECT_SERVER_API_AUTH_STRING is not set: the server would obey everybody")
    with collection_paused():
        import prefect
        from prefect.server.api.server import create_app

        # Prefect mounts its second pages wherever their files are, whatever its settings say.
        prefect.__ui_v2_static_path__ = prefect.__ui_v2_static_path__ / "absent"
        app = create_app(final=True)
    home = os.environ.get("PREFECT_HOME")
    return guarded(app, origins, authentication, Path(home) / "used-links.json" if home else None)


def guarded(app: ASGIApp, origins: list[str], authentication: str, record: Path | None = None) -> ASGIApp:
    """Return an application that passes on to `app` what the server's own pages and its clients ask.

    record: file of the links that were used, see `Tokens`.
    """
    opening = Starlette(
        routes=[
            Route(OPENING_PATH + "session", _session(Tokens(authentication, record), authentication), methods=["POST"]),
            Route(OPENING_PATH + "open.js", lambda _: Response(_OPENING_SCRIPT, media_type="text/javascript")),
            Route(OPENING_PATH + "{page:path}", lambda _: HTMLResponse(_OPENING_PAGE)),
        ]
    )
    hosts = [urlsplit(origin).hostname or "" for origin in origins]
    return TrustedHostMiddleware(_Guard(app, opening, origins), allowed_hosts=hosts, www_redirect=False)


class _Guard:
    """Refuses pages of other origins, and forbids the server's own pages to load anything from elsewhere."""

    def __init__(self, app: ASGIApp, opening: ASGIApp, origins: list[str]) -> None:
        self._app, self._opening, self._origins = app, opening, frozenset(origins)
        channels = " ".join(f"{origin} {origin.replace('http', 'ws', 1)}" for origin in origins)
        # The timeline of a run draws by WebGL, whose library compiles its shaders' code.
        self._policy = (
            "default-src 'self'; script-src 'self' 'unsafe-eval'; style-src 'self' 'unsafe-inline';"
            " img-src 'self' data: blob:; font-src 'self' data:;"
            f" worker-src 'self' blob:; connect-src 'self' {channels}; object-src 'none'; base-uri 'self';"
            " form-action 'self'; frame-ancestors 'none'"
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        origin = Headers(scope=scope).get("origin")
        if origin is not None and origin not in self._origins:
            await _refusal(scope)(scope, receive, send)
            return

        async def send_with_policy(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers["Content-Security-Policy"] = self._policy
                headers["Referrer-Policy"] = "no-referrer"
                headers["X-Content-Type-Options"] = "nosniff"
            await send(message)

        chosen = self._opening if scope["path"].startswith(OPENING_PATH) else self._app
        await chosen(scope, receive, send_with_policy)


def _refusal(scope: Scope) -> ASGIApp:
    if scope["type"] == "websocket":
        return WebSocketClose(code=1008, reason="another origin")
    return PlainTextResponse("requests of other origins are refused", status_code=403)


def _session(tokens: Tokens, authentication: str) -> Any:
    """Return the handler that exchanges the token of a link for the password of Prefect's pages."""

    async def session(request: Request) -> Response:
        length = request.headers.get("content-length", str(MAX_TOKEN_BYTES + 1))
        if not length.isdecimal():
            return PlainTextResponse("its length is no number", status_code=400)
        if int(length) > MAX_TOKEN_BYTES:
            return PlainTextResponse("too long", status_code=413)
        token = (await request.body()).decode(errors="replace")
        if not tokens.use(token, time.time()):
            return PlainTextResponse("used before, or too old", status_code=403)
        return PlainTextResponse(header_value(authentication), headers={"Cache-Control": "no-store"})

    return session
