"""Who may use the review page: whoever has its token, from its own address; nothing leaves the store."""

import asyncio
import http.client
import json
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from types import MappingProxyType
from urllib.parse import urlsplit

import pytest
from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect, Request
from starlette.types import Message, Receive, Scope, Send

from glint.flows.review import access as access_module
from glint.flows.review.access import MAX_TOKEN_BYTES, REFUSAL_SECONDS, Access, Guard
from tests.flows.review.conftest import ServedPage

ORIGIN = "http://127.0.0.1:4300"
FOREIGN = "http://pages.example"
ROW = "/api/captures/hemisphere/front"


@dataclass(frozen=True)
class Answer:
    """An answer to a request, and its content."""

    response: http.client.HTTPResponse
    content: bytes

    @property
    def status(self) -> int:
        return self.response.status

    def header(self, name: str) -> str | None:
        return self.response.getheader(name)


def ask(
    served: ServedPage,
    path: str,
    method: str = "GET",
    body: bytes | None = None,
    *,
    headers: Mapping[str, str] = MappingProxyType({}),
) -> Answer:
    """The answer to a request, sent as it is."""
    connection = http.client.HTTPConnection(urlsplit(served.origin).netloc, timeout=60)
    connection.request(method, path, body, headers)
    response = connection.getresponse()
    return Answer(response, response.read())


def test_without_the_cookie_nothing_is_read_or_started(served: ServedPage) -> None:
    for path in ("/api/captures", ROW, f"{ROW}/inputs", f"{ROW}/frame?number=0", "/api/openapi.json", f"{ROW}/edits"):
        assert ask(served, path).status == 401
        assert ask(served, path, headers={"Cookie": f"{served.access.cookie}=wrong"}).status == 401
        assert ask(served, path, headers=served.session).status == 200
    assert ask(served, f"{ROW}/run", "POST").status == 401
    assert ask(served, "/").status == 303
    assert ask(served, "/static/main.js").status == 200


@pytest.mark.parametrize("foreign", ['theme={"mode":"dark"}', "cart[0]=5", "q=a b", 'x="unclosed', "flag", "k=v\\w"])
def test_cookies_of_other_programs_keep_nobody_out(foreign: str) -> None:
    access = Access((ORIGIN,))
    assert access.has_session(Headers({"Cookie": f"{foreign}; {access.cookie}={access.session}; {foreign}"}))
    assert not access.has_session(Headers({"Cookie": foreign}))


def test_the_token_is_exchanged_for_a_cookie_that_scripts_and_other_sites_cannot_use(served: ServedPage) -> None:
    for wrong in (b"", b"wrong", b"x" * 2000, served.access.session.encode()):
        answer = ask(served, "/api/session", "POST", wrong)
        assert answer.status in (403, 413) and answer.header("Set-Cookie") is None
    cookie = ask(served, "/api/session", "POST", served.access.token.encode()).header("Set-Cookie")
    assert cookie is not None and served.access.session in cookie and served.access.token not in cookie
    assert {"HttpOnly", "SameSite=strict", "Path=/"} <= {part.strip() for part in cookie.split(";")}


def test_a_token_that_is_cut_short_is_no_error_of_the_server() -> None:
    access, sent = Access((ORIGIN,)), list[Message]()
    part = {"type": "http.request", "body": b"abc", "more_body": True}
    messages: Iterator[Message] = iter([part, {"type": "http.disconnect"}])

    async def receive() -> Message:
        return next(messages)

    async def send(message: Message) -> None:
        sent.append(message)

    async def app(*_: object) -> None:
        pytest.fail("it was let in")

    host = (b"host", urlsplit(ORIGIN).netloc.encode())
    scope = {"type": "http", "method": "POST", "path": "/api/session", "headers": [host]}
    asyncio.run(Guard(app, access)(scope, receive, send))
    assert [message["status"] for message in sent if "status" in message] == [400]


def test_what_states_no_length_is_read_no_further_than_the_longest_that_is_allowed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(access_module, "MAX_BODY_BYTES", 20 * MAX_TOKEN_BYTES)
    access, statuses, read = Access((ORIGIN,)), list[int](), list[int]()

    async def receive() -> Message:
        read.append(MAX_TOKEN_BYTES)
        return {"type": "http.request", "body": b"x" * MAX_TOKEN_BYTES, "more_body": len(read) < 100}

    async def send(message: Message) -> None:
        statuses.extend([message["status"]] if "status" in message else [])

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        with pytest.raises(ClientDisconnect):
            await Request(scope, receive).body()

    headers = [(b"host", urlsplit(ORIGIN).netloc.encode()), (b"cookie", f"{access.cookie}={access.session}".encode())]
    scope = {"type": "http", "method": "POST", "headers": headers}
    asyncio.run(Guard(app, access)(scope | {"path": "/api/session"}, receive, send))
    assert (statuses, len(read)) == ([413], 2)
    read.clear()
    asyncio.run(Guard(app, access)(scope | {"path": "/api/captures"}, receive, send))
    assert len(read) == 21


def test_wrong_passwords_wait_for_each_other_and_right_ones_for_none(served: ServedPage) -> None:
    with ThreadPoolExecutor(7) as pool:
        started = time.monotonic()
        wrong = [pool.submit(ask, served, "/api/session", "POST", b"wrong") for _ in range(6)]
        right = pool.submit(ask, served, "/api/session", "POST", served.access.token.encode()).result()
        assert right.status == 200 and not all(answer.done() for answer in wrong)
        assert {answer.result().status for answer in wrong} == {403}
    assert time.monotonic() - started >= 6 * REFUSAL_SECONDS


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": FOREIGN},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1"},
        {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"},
        {"Sec-Fetch-Site": "same-site", "Sec-Fetch-Mode": "cors"},
    ],
)
def test_requests_of_other_pages_are_refused_even_with_the_cookie(served: ServedPage, headers: dict[str, str]) -> None:
    for path, method in (("/api/captures", "GET"), (f"{ROW}/run", "POST"), ("/api/session", "POST"), ("/", "GET")):
        assert ask(served, path, method, headers=served.session | headers).status == 403


def test_other_host_names_are_refused_even_with_the_cookie(served: ServedPage) -> None:
    for wrong in ("pages.example", "127.0.0.1", "127.0.0.1:1", f"{urlsplit(served.origin).netloc}.example"):
        assert ask(served, "/api/captures", headers=served.session | {"Host": wrong}).status == 400
    assert ask(served, "/api/captures", headers=served.session | {"Origin": served.origin}).status == 200


@pytest.mark.parametrize(
    "path",
    [
        "/static/../app.py",
        "/static/%2e%2e/app.py",
        "/static/..%2fapp.py",
        "/static//etc/passwd",
        "/api/captures/..%2f..%2fetc/front/inputs",
        "/api/captures/../front/inputs",
        "/api/captures/%2e%2e/front/inputs",
        "/api/captures/hemisphere/..%2f_object/inputs",
        "/api/captures/_object/front/inputs",
        "/api/captures/hemisphere/FRONT/inputs",
        "/api/captures/hemisphere/front%00/inputs",
        "/api/captures/absent/front/inputs",
        "/api/captures/hemisphere/front/level/..%2f..%2fmask",
    ],
)
def test_no_path_leaves_the_store(served: ServedPage, path: str) -> None:
    answer = ask(served, path, headers=served.session)
    assert answer.status in (404, 422)
    assert b"root:" not in answer.content and b"import" not in answer.content


def test_every_answer_forbids_what_the_page_does_not_need(served: ServedPage) -> None:
    for path in ("/", "/open", "/static/main.js", "/api/captures", f"{ROW}/frame?number=0", "/absent"):
        answer = ask(served, path, headers=served.session)
        policy = answer.header("Content-Security-Policy") or ""
        assert "default-src 'none'" in policy and "script-src 'self'" in policy and "frame-ancestors 'none'" in policy
        assert "unsafe" not in policy and "*" not in policy and "http" not in policy
        assert answer.header("Cache-Control") == "no-store"
        assert answer.header("X-Content-Type-Options") == "nosniff"
        assert answer.header("Access-Control-Allow-Origin") is None


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("sphere-fit", {"x": 1e300, "y": 0, "radius": 3}),
        ("sphere-fit", {"x": 1, "y": 1, "radius": 0}),
        ("sphere-fit", {"x": 1, "y": 1, "radius": 5, "path": "/etc/passwd"}),
        ("edits", {"changes": {"mask": "bm8gUE5H"}, "author": "Ada", "base_revision": 0}),
        ("edits", {"changes": {"frames": "/etc/passwd"}, "author": "Ada", "base_revision": 0}),
        ("edits", {"changes": {"pixel_size": -1}, "author": "Ada", "base_revision": 0}),
        ("edits", {"changes": {"pixel_size": 1}, "author": "", "base_revision": 0}),
        ("edits", {"changes": {"pixel_size": 1}, "author": "Ada", "base_revision": 99}),
        ("edits/undo", {"revision": 99, "author": "Ada"}),
    ],
)
def test_what_is_sent_is_checked(served: ServedPage, path: str, body: object) -> None:
    headers = served.session | {"Content-Type": "application/json"}
    answer = ask(served, f"{ROW}/{path}", "POST", json.dumps(body).encode(), headers=headers)
    assert answer.status in (404, 422)
    assert set(json.loads(answer.content)) == {"error", "remedy"}


def test_long_requests_are_refused_unread(served: ServedPage) -> None:
    headers = served.session | {"Content-Length": str(1 << 40)}
    answer = ask(served, f"{ROW}/edits", "POST", None, headers=headers)
    assert answer.status == 413
