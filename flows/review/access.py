"""Decide who may use the review page: holders of the link's token, from the page's own address only.

The link carries the token in its fragment, which browsers do not send. The page exchanges it for a cookie that scripts
cannot read and that pages of other sites cannot use (HttpOnly, SameSite=Strict). Requests under another name (Host), of
another page (Origin, Sec-Fetch-Site) or without the cookie are refused before anything else looks at them.
"""

import asyncio
import hmac
import secrets
from dataclasses import dataclass, field
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect, Request, cookie_parser
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

MAX_BODY_BYTES = 64 << 20
"""Bytes of a request; longer ones are refused: a mask of 100 million pixels is a PNG of some megabytes."""
MAX_TOKEN_BYTES = 1000
"""Bytes of a request that carries a token or password; longer ones are refused unread."""
COOKIE_SECONDS = 30 * 24 * 3600
"""Time for which a browser that was let in stays let in, in seconds: a project's next look at its captures."""
REFUSAL_SECONDS = 0.5
"""Seconds before a wrong password is answered; many at once are answered one after another."""

ENTRY_PATH = "/open"
"""Path of the page that exchanges a link's token, or the password that a person types, for the cookie."""
SESSION_PATH = "/api/session"
PUBLIC = (ENTRY_PATH, SESSION_PATH)
PUBLIC_FOLDER = "/static/"
"""The program of the page, which holds no data."""

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self' blob:;"
    " font-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Nothing inline, nothing from elsewhere; blob: are pictures and meshes that the page itself has made."""
HEADERS = {
    "Content-Security-Policy": POLICY,
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}


@dataclass(frozen=True)
class Access:
    """The addresses under which the page is reached (http://127.0.0.1:4300 ..), its token and its cookie."""

    origins: tuple[str, ...]
    token: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)
    session: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)

    @property
    def hosts(self) -> frozenset[str]:
        """The values of Host that are answered, with their ports."""
        return frozenset(urlsplit(origin).netloc for origin in self.origins)

    @property
    def cookie(self) -> str:
        """Name of the cookie; ports of one machine share cookies, so it has the port in it."""
        return f"glint-review-{urlsplit(self.origins[0]).port or 0}"

    def link(self) -> str:
        """Return the address that opens the page without a password."""
        return f"{self.origins[0]}{ENTRY_PATH}#{self.token}"

    def is_from_own_page(self, headers: Headers) -> bool:
        """Return whether a request can come from the page itself, from a typed address or from a program.

        A page of another site, or of another port, may lead to this page by a link, and no more.
        """
        origin, site = headers.get("origin"), headers.get("sec-fetch-site")
        if origin is not None and origin not in self.origins:
            return False
        return site in (None, "same-origin", "none") or headers.get("sec-fetch-mode") == "navigate"

    def has_session(self, headers: Headers) -> bool:
        """Return whether a request carries the cookie, among others of any form that programs of this machine set."""
        session = cookie_parser(headers.get("cookie", "")).get(self.cookie, "")
        return hmac.compare_digest(session.encode(), self.session.encode())


class Guard:
    """The application behind the checks of `Access`; every answer has the headers in HEADERS."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app, self._access = app, access
        self._refusing = asyncio.Lock()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            await send({"type": "websocket.close", "code": 1008})
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers[name] = value
            await send(message)

        headers = Headers(scope=scope)
        answer = self._refusal(scope, headers)
        if answer is None and scope["path"] == SESSION_PATH:
            answer = await self._opened(Request(scope, receive))
        if answer is not None:
            await answer(scope, receive, send_guarded)
            return
        await self._app(scope, _limited(receive), send_guarded)

    def _refusal(self, scope: Scope, headers: Headers) -> Response | None:
        """Return the answer to a request that is refused, None for any other."""
        path = scope["path"]
        if headers.get("host") not in self._access.hosts:
            return refusal(400, "this is not an address of this page", "open the link that glint review printed")
        if not self._access.is_from_own_page(headers):
            return refusal(403, "requests of other pages are refused", "open the link that glint review printed")
        length = headers.get("content-length", "0")
        if not length.isdecimal() or int(length) > MAX_BODY_BYTES:
            return refusal(413, f"the request is longer than {MAX_BODY_BYTES:,} bytes", "send less")
        if path in PUBLIC or path.startswith(PUBLIC_FOLDER) or self._access.has_session(headers):
            return None
        if path.startswith("/api/"):
            return refusal(401, "this browser was not let in", "open the link that glint review printed")
        return RedirectResponse(ENTRY_PATH, status_code=303)

    async def _opened(self, request: Request) -> Response:
        """Return the cookie for the token."""
        if request.method != "POST":
            return refusal(405, "only POST is answered here", "open the link that glint review printed")
        body = b""
        try:
            async for part in request.stream():
                body += part
                if len(body) > MAX_TOKEN_BYTES:
                    return refusal(413, "the token is too long", "open the link that glint review printed")
        except ClientDisconnect:
            return refusal(400, "the request was cut short", "open the link that glint review printed")
        if not hmac.compare_digest(body, self._access.token.encode()):
            # Only refusals wait for each other: whoever has the password is let in while others are guessing.
            async with self._refusing:
                await asyncio.sleep(REFUSAL_SECONDS)
            return refusal(403, "this is not the token or password of this page", "open the link of the last start")
        answer = JSONResponse({"opened": True})
        secure = self._access.origins[0].startswith("https:")
        answer.set_cookie(
            self._access.cookie,
            self._access.session,
            max_age=COOKIE_SECONDS,
            httponly=True,
            samesite="strict",
            secure=secure,
        )
        return answer


def refusal(status: int, error: str, remedy: str) -> JSONResponse:
    """Return an error in the form that all errors of the page's interface have."""
    return JSONResponse({"error": error, "remedy": remedy}, status_code=status)


def _limited(receive: Receive) -> Receive:
    """Return `receive` that ends a request whose body turns out to be longer than MAX_BODY_BYTES."""
    total = 0

    async def limited() -> Message:
        nonlocal total
        message = await receive()
        total += len(message.get("body", b""))
        if total > MAX_BODY_BYTES:
            raise ClientDisconnect
        return message

    return limited
