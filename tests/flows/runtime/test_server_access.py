"""Who can use Glint's own Prefect server: its clients, and browsers that follow its links; nobody else."""

import json
import os
import ssl
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from prefect import flow, runtime, task
from prefect.artifacts import create_markdown_artifact
from starlette.applications import Starlette
from starlette.testclient import TestClient
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from glint.flows.errors import ServerError
from glint.flows.runtime import server_access
from glint.flows.runtime.dask_cluster import Cluster
from glint.flows.runtime.prefect_server import Server, ensure_server
from glint.flows.runtime.server_access import Tokens, certificate_file, header_value, link, private_folder
from glint.flows.runtime.server_app import guarded
from tests import browser
from tests.polling import until

FOREIGN = "http://pages.example"

needs_chromium = pytest.mark.skipif(browser.program() is None, reason="no chromium (Debian's package chromium)")


def status(url: str, body: object = None, **headers: str) -> int:
    """The status of the answer to a request."""
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(url, data, {"Content-Type": "application/json", **headers})
    try:
        with urllib.request.urlopen(request) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as refused:
        return refused.code


def password(server: Server) -> dict[str, str]:
    """The header that clients of a server send."""
    assert server.authentication is not None
    return {"Authorization": f"Basic {header_value(server.authentication)}"}


@pytest.mark.server
def test_without_the_password_nothing_is_read_or_started(server: Server) -> None:
    assert status(f"{server.api_url}/health") == 200
    for path in ("admin/version", "admin/settings", "flows/filter", "block_documents/filter", "work_pools/filter"):
        body = dict[str, object]() if path.endswith("filter") else None
        assert status(f"{server.api_url}/{path}", body) == 401
        assert status(f"{server.api_url}/{path}", body, Authorization="Basic Z2xpbnQ6d3Jvbmc=") == 401
        assert status(f"{server.api_url}/{path}", body, **password(server)) == 200
    assert status(f"{server.api_url}/flows/", {"name": "intruder"}) == 401


def test_clients_read_one_certificate(tmp_path: Path) -> None:
    path = certificate_file(tmp_path)
    context = ssl.create_default_context(cafile=path)
    assert context.cert_store_stats()["x509"] == 1
    written = path.stat().st_mtime_ns
    assert certificate_file(tmp_path) == path and path.stat().st_mtime_ns == written
    assert path.stat().st_mode & 0o077 == 0


@pytest.mark.server
def test_other_origins_and_host_names_are_refused_even_with_the_password(server: Server) -> None:
    origin = server.ui_url
    for wrong in (FOREIGN, "null", "http://127.0.0.1:1", origin + ".example", "http://localhost:4200"):
        assert status(f"{server.api_url}/flows/filter", {}, Origin=wrong, **password(server)) == 403
    assert status(f"{server.api_url}/flows/filter", {}, Origin=origin, **password(server)) == 200
    for wrong in ("pages.example", "pages.example:4200", "127.0.0.1.example", ""):
        assert status(f"{server.api_url}/flows/filter", {}, Host=wrong, **password(server)) == 400


@pytest.mark.server
@pytest.mark.parametrize(("origin", "headers"), [(Origin(FOREIGN), {}), (None, {"Host": "pages.example"})])
def test_channels_of_other_origins_are_refused(server: Server, origin: Origin | None, headers: dict[str, str]) -> None:
    for path in ("events/in", "events/out", "logs/out"):
        address = f"{server.api_url}/{path}".replace("http", "ws", 1)
        with (
            pytest.raises((InvalidStatus, OSError)),
            connect(address, proxy=None, origin=origin, additional_headers=headers),
        ):
            pass


@pytest.mark.server
def test_no_page_may_be_framed_or_load_anything_from_elsewhere(server: Server) -> None:
    with urllib.request.urlopen(server.ui_url) as answer:
        policy = answer.headers["Content-Security-Policy"]
    assert "default-src 'self'" in policy and "frame-ancestors 'none'" in policy and "*" not in policy


@pytest.mark.server
def test_there_is_one_set_of_pages(server: Server) -> None:
    with urllib.request.urlopen(f"{server.ui_url}/ui-settings") as answer:
        settings = json.load(answer)
    assert settings["available_uis"] == ["v1"] and settings["v2_base_url"] is None


@pytest.mark.server
def test_a_wrong_password_for_a_given_server_is_reported(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from prefect.settings import PREFECT_API_AUTH_STRING, temporary_settings

    monkeypatch.setenv("PREFECT_API_URL", server.api_url)
    message = r"PREFECT_API_URL=.*another password.*PREFECT_API_AUTH_STRING"
    with temporary_settings({PREFECT_API_AUTH_STRING: "glint:wrong"}), pytest.raises(ServerError, match=message):
        ensure_server(tmp_path)


def test_a_token_is_good_once_and_not_for_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    token = link("http://127.0.0.1:4200", "glint:secret", "runs").partition("#")[2]
    assert "secret" not in token
    tokens = Tokens("glint:secret")
    assert tokens.use(token, now=0.0)
    assert not tokens.use(token, now=1.0)
    assert not Tokens("glint:other").use(token, now=0.0)
    for wrong in ("", "a.b.c", token[:-1], "\N{SNOWMAN}"):
        assert not Tokens("glint:secret").use(wrong, now=0.0)
    record = tmp_path / "used.json"
    assert Tokens("glint:secret", record).use(token, now=0.0)
    assert record.stat().st_mode & 0o777 == 0o600
    assert not Tokens("glint:secret", record).use(token, now=1.0)  # as after a new start of the server
    record.write_text("[")
    assert Tokens("glint:secret", record).use(token, now=0.0)
    monkeypatch.setattr(server_access, "LINK_SECONDS", -1)
    assert not Tokens("glint:secret").use(token, now=0.0)


def test_a_folder_of_another_user_is_refused(tmp_path: Path) -> None:
    if os.getuid() != 0:
        pytest.skip("only root can give a folder to another user")
    (tmp_path / "home").mkdir()
    os.chown(tmp_path / "home", 65534, 65534)
    with pytest.raises(ServerError, match=r"belongs to user 65534.*GLINT_HOME"):
        private_folder(tmp_path / "home", tmp_path)


def test_an_open_folder_is_closed(tmp_path: Path) -> None:
    folder = tmp_path / "home" / "server" / "machine"
    folder.mkdir(parents=True, mode=0o755)
    private_folder(folder, tmp_path / "home")
    assert folder.stat().st_mode & 0o777 == 0o700


@task
def nothing() -> None:
    """Do nothing."""


@flow(name="seen-in-a-browser")
def drawn() -> tuple[str, str]:
    """The ids of the flow run, and of an artifact of it with a picture from elsewhere."""
    nothing()
    text = "text ![picture](https://pictures.example/picture.png)"
    return str(runtime.flow_run.id), str(create_markdown_artifact(text, key="page-with-a-picture"))


@pytest.fixture(scope="module")
def chromium() -> Iterator[browser.Browser]:
    with browser.Browser() as running:
        yield running


def left_the_machine(page: browser.Page) -> list[str]:
    """Requests of a page to other hosts, less those that its policy stopped."""
    stopped = {
        event["params"]["requestId"]
        for event in page.events
        if event.get("method") == "Network.loadingFailed" and event["params"].get("blockedReason") == "csp"
    }
    return [
        event["params"]["request"]["url"]
        for event in page.events
        if event.get("method") == "Network.requestWillBeSent"
        and event["params"]["requestId"] not in stopped
        and not event["params"]["request"]["url"].startswith(("http://127.0.0.1:", "data:", "blob:"))
    ]


@needs_chromium
@pytest.mark.server
@pytest.mark.long
def test_a_link_opens_once_and_no_page_asks_a_third_party(server: Server, chromium: browser.Browser) -> None:
    run, artifact = drawn()
    address = server.link(f"runs/flow-run/{run}")
    page = chromium.page()
    page.open(address)
    page.wait("location.pathname.startsWith('/runs/flow-run/') && document.body.innerText.includes('Completed')")
    page.wait("document.querySelector('canvas') !== null")
    for path in ("dashboard", f"artifacts/artifact/{artifact}", "deployments", "blocks/catalog", "settings"):
        page.open(f"{server.ui_url}/{path}")
        page.wait("document.body.innerText.length > 50")
        page.evaluate("new Promise(done => setTimeout(done, 1500))")
    assert any("pictures.example" in url for url in page.requested())
    assert left_the_machine(page) == []
    assert not [event for event in page.events if event.get("method") == "Runtime.exceptionThrown"]
    with browser.Browser() as other:
        second = other.page()
        second.open(address)
        second.wait("document.body.innerText.includes('opened before')")
        assert second.evaluate("localStorage.length") == 0
        second.open(server.link("/pages.example/"))
        second.wait("localStorage.length > 0 && location.pathname !== '/glint//pages.example/'")
        assert second.evaluate("location.origin") == server.ui_url


@needs_chromium
@pytest.mark.server
@pytest.mark.long
def test_pages_of_dask_ask_no_third_party(cluster: Cluster, chromium: browser.Browser) -> None:
    page = chromium.page()
    until(lambda: status(cluster.dashboard_url) == 200)
    page.open(cluster.dashboard_url)
    page.wait("document.querySelectorAll('.bk-Figure, [data-root-id]').length > 0")
    page.evaluate("new Promise(done => setTimeout(done, 1500))")
    assert left_the_machine(page) == []


class PageOfAnotherOrigin(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>other</title><body>other</body>")

    def log_message(self, *_: object) -> None:
        """Keep the output of the tests clean."""


ATTEMPTS = """
(async () => {
  const api = "API", said = {};
  const attempt = async (name, work) => {
    try { said[name] = String(await work()); } catch (error) { said[name] = "refused"; }
  };
  const text = async (path, options) => (await fetch(api + path, options)).text();
  await attempt("read", () => text("/health"));
  await attempt("read flows", () => text("/flows/filter",
    {method: "POST", body: "{}", headers: {"Content-Type": "application/json"}}));
  await attempt("simple post", () => text("/flows/", {method: "POST", body: '{"name": "INTRUDER"}'}));
  await attempt("blind post", async () => (await fetch(api + "/flows/",
    {method: "POST", mode: "no-cors", body: '{"name": "INTRUDER"}'})).text());
  await attempt("session", () => text("/../glint/session", {method: "POST", body: "x"}));
  await attempt("socket", () => new Promise((done, fail) => {
    const socket = new WebSocket(api.replace("http", "ws") + "/events/out", "prefect");
    socket.onopen = () => done("open");
    socket.onerror = fail;
  }));
  await attempt("frame", () => new Promise((done, fail) => {
    const frame = document.createElement("iframe");
    frame.src = api.replace("/api", "/");
    frame.onload = () => { try { done(frame.contentDocument.title || fail()); } catch (error) { fail(); } };
    document.body.append(frame);
  }));
  return said;
})()
"""


@needs_chromium
@pytest.mark.server
@pytest.mark.long
@pytest.mark.parametrize("is_signed_in", [pytest.param(False, marks=pytest.mark.slow), True])
def test_a_page_of_another_origin_can_neither_read_nor_start_anything(server: Server, is_signed_in: bool) -> None:
    """In a browser that is signed in it has all that it has in another one."""
    with browser.Browser() as running, ThreadingHTTPServer(("127.0.0.1", 0), PageOfAnotherOrigin) as site:
        threading.Thread(target=site.serve_forever, daemon=True).start()
        if is_signed_in:
            home = running.page()
            home.open(server.link())
            home.wait("location.pathname === '/dashboard' && localStorage.getItem('prefect-password') !== null")
        page = running.page()
        page.open(f"http://127.0.0.1:{site.server_port}/")
        page.wait("document.title === 'other'")
        said = page.evaluate(ATTEMPTS.replace("API", server.api_url).replace("INTRUDER", f"intruder-{is_signed_in}"))
        site.shutdown()
    # A request whose answer is hidden from the page may be made: it is not obeyed.
    assert said.pop("blind post") in ("", "refused")
    assert set(said.values()) == {"refused"}, said
    body = json.dumps({"flows": {"name": {"like_": "intruder"}}}).encode()
    headers = {"Content-Type": "application/json", **password(server)}
    with urllib.request.urlopen(urllib.request.Request(f"{server.api_url}/flows/filter", body, headers)) as answer:
        assert json.load(answer) == []


@pytest.mark.parametrize(("length", "expected"), [("x", 400), ("-1", 400), ("99999", 413), ("1", 403)])
def test_a_length_that_is_no_number_is_refused(length: str, expected: int) -> None:
    client = TestClient(guarded(Starlette(), ["http://testserver"], "user:password"))
    assert client.post("/glint/session", content=b"x", headers={"content-length": length}).status_code == expected
