"""The server killed while people save, paint and run: whatever it has acknowledged is there, and the page goes on."""

import base64
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import requests

from glint import reading
from glint.flows.runtime.prefect_server import Server
from glint.storage.edits.edits import Edits
from glint.storage.edits.models import mask_png
from glint.storage.locations.location import Location
from tests.flows.review.conftest import Tab
from tests.flows.review.inputs_view import INPUTS, READY, drag
from tests.pictures import decode_picture
from tests.polling import PATIENCE, until

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

PASSWORD = "only for this test"
SAVES_BEFORE_KILLS = (3, 7, 5)
"""Acknowledged saves after which the server is killed, while the next is under way."""
RUN_SECONDS = 280.0
"""Longest wait for a run: several share the machine."""


class KilledServer:
    """`glint review` in a process of its own, at one port, killed and started again."""

    def __init__(self, store: Path, catalogue: Path, home: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.origin, self.store = f"http://127.0.0.1:{port}", store
        command = [sys.executable, "-m", "glint", "review", str(catalogue), "--store", str(store), "--port", str(port)]
        self._command = command
        self._environment = os.environ | {"GLINT_REVIEW_PASSWORD": PASSWORD, "GLINT_HOME": str(home)}
        self.start()

    def start(self) -> None:
        """Start it and wait until it answers."""
        self._process = subprocess.Popen(self._command, env=self._environment, stdout=subprocess.DEVNULL)
        until(self._answers)

    def kill(self) -> None:
        """End it as a failure of the machine would, at once."""
        self._process.send_signal(signal.SIGKILL)
        self._process.wait()

    def client(self) -> requests.Session:
        """A client that was let in."""
        session = requests.Session()
        assert session.post(f"{self.origin}/api/session", data=PASSWORD, timeout=60).ok
        return session

    def save(self, session: requests.Session, changes: Mapping[str, str | float], base: int) -> requests.Response:
        """The answer to changes by Ada that follow a revision."""
        return session.post(
            self.path("edits"), json={"changes": changes, "author": "Ada", "base_revision": base}, timeout=60
        )

    def path(self, path: str) -> str:
        return f"{self.origin}/api/captures/hemisphere/front/{path}"

    def _answers(self) -> bool:
        assert self._process.poll() is None, "it has ended"
        with suppress(requests.ConnectionError):
            return requests.get(f"{self.origin}/open", timeout=60).ok
        return False


@pytest.fixture
def killed(stored: tuple[Path, Path], tmp_path: Path) -> Iterator[KilledServer]:
    """A server of a copy of the store."""
    shutil.copytree(stored[0], tmp_path / "store")
    server = KilledServer(tmp_path / "store", stored[1], Path(os.environ.get("GLINT_HOME", tmp_path / "home")))
    yield server
    server.kill()


def test_every_acknowledged_stroke_is_there_after_kills(killed: KilledServer) -> None:
    height, width = _frame_shape(killed)
    acknowledged: dict[int, np.ndarray] = {}
    for n_saves in SAVES_BEFORE_KILLS:
        session, enough, first = killed.client(), threading.Event(), len(acknowledged)

        def paint(session: requests.Session, enough: threading.Event, first: int, n_saves: int) -> None:
            mask = np.zeros((height, width), bool)
            for stroke in range(first, first + 100):
                mask[stroke % height, : 20 + stroke] = True
                text = base64.b64encode(mask_png(mask)).decode()
                answer = killed.save(session, {"mask": text}, max(acknowledged, default=0))
                if not answer.ok:  # what was saved before the kill without an answer came before this
                    base = session.get(killed.path("edits"), timeout=60).json()["revision"]
                    answer = killed.save(session, {"mask": text}, base)
                acknowledged[answer.json()["revision"]["number"]] = mask.copy()
                if len(acknowledged) >= first + n_saves:
                    enough.set()

        painter = threading.Thread(target=_until_disconnected(paint), args=(session, enough, first, n_saves))
        painter.start()
        assert enough.wait(PATIENCE)
        killed.kill()
        painter.join()
        killed.start()
    edits = Edits.open(Location.parse(killed.store), "hemisphere", create=False)
    assert len(acknowledged) >= sum(SAVES_BEFORE_KILLS)
    assert set(acknowledged) <= {revision.number for revision in edits.history("front")}
    for number, mask in acknowledged.items():
        np.testing.assert_array_equal(edits.current("front", number).mask, mask)
    shown = killed.client().get(killed.path("mask"), timeout=60).content
    newest = edits.current("front").mask
    np.testing.assert_array_equal(decode_picture(shown) > 0, newest)


def test_a_page_whose_server_was_killed_in_a_stroke_saves_it_to_the_next_one(
    killed: KilledServer, chromium: Any
) -> None:
    page = opened(killed, chromium)
    page.keyboard.press("b")
    tab = Tab(page, [])
    drag(tab, (10, 10), (30, 12))
    killed.kill()
    drag(tab, (30, 12), (34, 40))
    painted = page.get_attribute("section[data-pixels]", "data-pixels")
    page.fill("aside input[autocomplete=name]", "Ada")
    page.click("aside .save button:has-text('Save')")
    page.wait_for_selector("#status.error >> text=the server does not answer")
    killed.start()
    page.click("aside .save button:has-text('Save')")
    page.wait_for_selector("#status >> text=Saved.")
    mask = Edits.open(Location.parse(killed.store), "hemisphere", create=False).current("front").mask
    assert mask is not None and str(np.count_nonzero(mask)) == painted
    page.goto(f"{killed.origin}/{INPUTS}")  # the bookmark is good: the browser is still let in
    page.wait_for_selector(READY)
    assert re.search("Ada", page.inner_text(".revisions"))
    page.close()


def test_a_page_finds_its_server_again_and_shows_what_it_could_not(killed: KilledServer, chromium: Any) -> None:
    page = opened(killed, chromium)
    page.keyboard.press("b")
    drag(Tab(page, []), (10, 10), (30, 12))
    painted = page.get_attribute("section[data-pixels]", "data-pixels")
    killed.kill()
    page.keyboard.press("m")
    page.wait_for_selector("#status.error >> text=this page keeps what is not saved")
    killed.start()
    page.wait_for_selector("#status >> text=The server answers again.")
    page.wait_for_selector(".stage[data-shown$='level/peak']")
    assert page.get_attribute("section[data-pixels]", "data-pixels") == painted
    page.fill("aside input[autocomplete=name]", "Ada")
    page.click("aside .save button:has-text('Save')")
    page.wait_for_selector("#status >> text=Saved.")
    killed.kill()
    page.click("#tabs >> text=Versions")  # its module has not been loaded
    page.wait_for_selector("[role=alert] >> text=the server does not answer")
    killed.start()
    page.wait_for_selector(".versions .divider")
    page.close()


@pytest.mark.server
def test_a_run_goes_on_where_its_server_was_killed_and_the_page_finds_it_again(
    server: Server, killed: KilledServer, chromium: Any
) -> None:
    session = killed.client()
    assert killed.save(session, {"pixel_size": 0.5}, 0).ok
    page = opened(killed, chromium)
    page.click("text=Run from here")
    until(lambda: bool((session.get(killed.path("run"), timeout=60).json() or {}).get("stage")), RUN_SECONDS)
    killed.kill()
    page.wait_for_selector(".run .doubt >> text=The run goes on without it")
    killed.start()
    page.wait_for_selector(".run [role=status]:not(.doubt)")
    until(lambda: "v2" in reading.open(killed.store)["hemisphere"].versions, RUN_SECONDS)
    entry = reading.open(killed.store)["hemisphere"].latest.metadata["captures"]["front"]
    assert entry["entry"]["pixel_size"] == 0.5
    page.wait_for_selector(f"{READY}")  # shown anew, with what the run has left
    until(lambda: "looking" not in page.inner_text(".run"), RUN_SECONDS)
    page.close()


def opened(killed: KilledServer, chromium: Any) -> Any:
    """A page that was let in, with the inputs of the capture."""
    page = chromium.new_page(viewport={"width": 1280, "height": 800})
    page.set_default_timeout(PATIENCE * 1000)
    page.goto(f"{killed.origin}/open")
    page.fill("#password", PASSWORD)
    page.click("button")
    page.wait_for_selector(".row img")
    page.evaluate("view => { location.hash = view; }", INPUTS)
    page.wait_for_selector(READY)
    page.wait_for_selector("section[data-pixels]")
    return page


def _frame_shape(killed: KilledServer) -> tuple[int, int]:
    width, height = killed.client().get(killed.path("inputs"), timeout=120).json()["frame_size"]
    return height, width


def _until_disconnected(action: Callable[..., None]) -> Callable[..., None]:
    """Return an action that ends when its server does."""

    def ended(*arguments: Any) -> None:
        with suppress(requests.ConnectionError):
            action(*arguments)

    return ended
