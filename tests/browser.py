"""Chromium, driven over its debugging protocol, for tests of what pages can do; Debian's package `chromium`."""

import json
import shutil
import subprocess
import tempfile
import time
from itertools import count
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

from tests.polling import PATIENCE, until

CLOSING = 0.2
"""Seconds for the browser's answer when a connection ends: none comes behind events that nobody has read."""


def program() -> str | None:
    """The browser's command, None where it is not installed."""
    return shutil.which("chromium")


class Channel:
    """A connection over which a browser is sent commands, and the events that came in between."""

    def __init__(self, channel: ClientConnection) -> None:
        self._channel, self._numbers = channel, count(1)
        self.events: list[dict[str, Any]] = []

    def command(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command and return its result; keep the events that come before it."""
        number = next(self._numbers)
        self._channel.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            message: dict[str, Any] = json.loads(self._channel.recv(timeout=PATIENCE))
            if message.get("id") == number:
                assert "error" not in message, message
                result: dict[str, Any] = message["result"]
                return result
            self.events.append(message)


class Page(Channel):
    """A tab: evaluates JavaScript, and records what it requests, what is refused, and what its console says."""

    def __init__(self, channel: ClientConnection) -> None:
        super().__init__(channel)
        for domain in ("Page", "Network", "Runtime", "Log"):
            self.command(f"{domain}.enable")

    def open(self, url: str) -> None:
        """Go to an address."""
        self.command("Page.navigate", url=url)

    def evaluate(self, expression: str) -> Any:
        """The value of an expression, awaited."""
        answer = self.command("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait(self, expression: str, seconds: float = PATIENCE) -> Any:
        """The value of an expression as soon as it is true."""
        deadline = time.monotonic() + seconds
        while not (value := self._evaluated(expression)):
            assert time.monotonic() < deadline, f"{expression} stays {value!r} in {self.text()[:2000]}"
            time.sleep(0.2)
        return value

    def text(self) -> str:
        """What the page shows."""
        return str(self._evaluated("document.body.innerText"))

    def requested(self) -> list[str]:
        """Addresses that the page asked for, those that its policy refused included."""
        return [each["params"]["request"]["url"] for each in self._of("Network.requestWillBeSent")]

    def complaints(self) -> list[str]:
        """Messages of the browser about the page: refused requests, violated policies."""
        return [each["params"]["entry"]["text"] for each in self._of("Log.entryAdded")]

    def _evaluated(self, expression: str) -> Any:
        try:
            return self.evaluate(expression)
        except AssertionError:  # the page is being replaced
            return None

    def _of(self, method: str) -> list[dict[str, Any]]:
        return [event for event in self.events if event.get("method") == method]


class Browser:
    """A headless Chromium with a profile of its own; a context manager."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="chromium-", ignore_cleanup_errors=True)
        options = ["--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-extensions"]
        options += ["--disable-background-networking", "--disable-component-update", "--remote-debugging-port=0"]
        options += ["--disable-dev-shm-usage", "--remote-allow-origins=*", f"--user-data-dir={self._folder.name}"]
        self._process = subprocess.Popen(
            [program() or "chromium", *options, "about:blank"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        port = Path(self._folder.name) / "DevToolsActivePort"
        until(lambda: port.exists() and len(port.read_text().splitlines()) == 2)
        number, path = port.read_text().splitlines()
        self._origin = f"ws://127.0.0.1:{number}"
        self._channels = [connect(self._origin + path, proxy=None, max_size=None, close_timeout=CLOSING)]

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_: object) -> None:
        for channel in self._channels:
            channel.close()
        self._process.terminate()
        self._process.wait(PATIENCE)
        self._folder.cleanup()

    def page(self) -> Page:
        """A new tab."""
        self._channels[0].send(json.dumps({"id": 0, "method": "Target.createTarget", "params": {"url": "about:blank"}}))
        answer = json.loads(self._channels[0].recv(timeout=PATIENCE))
        channel = connect(
            f"{self._origin}/devtools/page/{answer['result']['targetId']}",
            proxy=None,
            max_size=None,
            close_timeout=CLOSING,
        )
        self._channels.append(channel)
        return Page(channel)
