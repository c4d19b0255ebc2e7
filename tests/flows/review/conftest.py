"""The review page of a small store as it is served, and a browser to use it with."""

import re
import shutil
import socket
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import uvicorn
from fastapi import FastAPI

from glint.flows.review.access import Access
from glint.flows.review.app import create_app
from glint.storage.locations.location import Location
from glint.tasks.engine.references import CaptureReference
from glint.tasks.publish import publish
from glint.tasks.up_to_date import pending_stages
from tests import browser
from tests.polling import PATIENCE, until
from tests.tasks.smooth_labels import smooth_labels

playwright = pytest.importorskip("playwright.sync_api")


@dataclass
class ServedPage:
    """A server in this process: its addresses, and its application."""

    origin: str
    access: Access
    app: FastAPI
    store: Path
    catalogue: Path | None
    server: uvicorn.Server = field(repr=False)
    thread: threading.Thread = field(repr=False)

    @property
    def session(self) -> dict[str, str]:
        """The header that a browser sends which was let in."""
        return {"Cookie": f"{self.access.cookie}={self.access.session}"}

    def stop(self) -> None:
        """End the server, and wait until it has ended."""
        self.server.should_exit = True
        self.thread.join(PATIENCE)
        assert not self.thread.is_alive()


def serve(store: Path, catalogue: Path | None) -> ServedPage:
    """Serve a store's page on a free port of 127.0.0.1."""
    listener = socket.socket()
    listener.bind(("127.0.0.1", 0))
    origin = f"http://127.0.0.1:{listener.getsockname()[1]}"
    access = Access((origin,))
    app = create_app(str(store), None if catalogue is None else str(catalogue), access)
    server = uvicorn.Server(uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=1))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    until(lambda: server.started)
    return ServedPage(origin, access, app, store, catalogue, server, thread)


@pytest.fixture(scope="module", autouse=True)
def smooth_questions() -> Iterator[None]:
    """Whatever a server in this process labels, for questions and drafts, takes a tenth of its time."""
    with smooth_labels():
        yield


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory, simulated: Path, performed: Path) -> tuple[Path, Path]:
    """A store in which the simulated capture is published, and its catalogue, in a folder of their own."""
    folder = tmp_path_factory.mktemp("review")
    shutil.copytree(simulated.parent, folder / "captures")
    catalogue, store = folder / "captures" / simulated.name, folder / "store"
    shutil.copytree(performed, store)
    reference = CaptureReference(Location.parse(catalogue).uri, "hemisphere", "front", str(store), "run")
    context = reference.context()
    assert pending_stages(context) == ()
    publish([context], "test", reference.catalogue)
    return store, catalogue


@pytest.fixture(scope="module")
def served(stored: tuple[Path, Path]) -> Iterator[ServedPage]:
    """The page of that store."""
    page = serve(*stored)
    yield page
    page.stop()


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """Debian's Chromium, driven by Playwright."""
    program = browser.program()
    if program is None:
        pytest.skip("no chromium (Debian's package chromium)")
    with playwright.sync_playwright() as driver:
        running = driver.chromium.launch(
            executable_path=program, args=["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"]
        )
        yield running
        running.close()


LOUD = ("error", "warning")
"""Kinds of messages of the console that nothing on the page may cause."""


@dataclass
class Tab:
    """A tab that was let in by the link: Playwright's page, and what its console said."""

    page: Any
    complaints: list[str]

    def wait(self, expression: str) -> None:
        """Wait until an expression is true; Playwright's own way to wait is forbidden by the page's policy."""
        until(lambda: bool(self.page.evaluate(expression)))

    def open(self, view: str, ready: str) -> Any:
        """Go to a view, and wait until it shows an element."""
        self.page.evaluate("view => { location.hash = view; }", view)
        self.page.wait_for_selector(ready)
        return self.page


@pytest.fixture
def tab(served: ServedPage, chromium: Any) -> Iterator[Tab]:
    """A new browser profile that was let in; nothing may have been refused or thrown when a test ends."""
    yield from let_in(served, chromium)


def let_in(served: ServedPage, chromium: Any) -> Iterator[Tab]:
    """Open the page's link in a profile of its own."""
    profile = chromium.new_context(viewport={"width": 1280, "height": 800})
    page, complaints = profile.new_page(), list[str]()
    page.set_default_timeout(PATIENCE * 1000)
    page.on(
        "console", lambda message: complaints.append(message.text) if message.type in ("error", "warning") else None
    )
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(served.access.link())
    page.wait_for_url(re.compile(re.escape(served.origin) + r"/(#.*)?$"))
    page.wait_for_selector(".row img")
    yield Tab(page, complaints)
    profile.close()
    assert complaints == []
