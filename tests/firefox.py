"""Firefox, driven by WebDriver BiDi, for pages that must work in any browser; Debian: firefox-esr and xvfb.

Its headless mode draws no WebGL without a graphics card, so it has a virtual screen.
"""

import base64
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from websockets.sync.client import connect

from tests.browser import CLOSING, Channel
from tests.polling import PATIENCE, until

PORT_FILE = "WebDriverBiDiServer.json"
SCREEN = "1280x1024x24"
PREFERENCES = {
    "webgl.force-enabled": True,
    "browser.shell.checkDefaultBrowser": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "app.update.enabled": False,
    "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False,
    "services.settings.server": "",
}
"""Settings of the profile: drawing without a graphics card, and no request of the browser's own."""


def program() -> str | None:
    """The browser's command, None where it or the virtual screen is not installed."""
    return (shutil.which("firefox-esr") or shutil.which("firefox")) if shutil.which("Xvfb") else None


class Firefox(Channel):
    """A Firefox on a virtual screen with a profile of its own and one tab; a context manager."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="firefox-", ignore_cleanup_errors=True)
        lines = [f"user_pref({json.dumps(name)}, {json.dumps(value)});" for name, value in PREFERENCES.items()]
        Path(self._folder.name, "user.js").write_text("\n".join(lines))
        read, write = os.pipe()
        self._screen = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write), "-screen", "0", SCREEN, "-nolisten", "tcp"], pass_fds=[write],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(write)
        with os.fdopen(read) as pipe:
            display = f":{pipe.readline().strip()}"
        command = [program() or "firefox-esr", "--no-remote", "--profile", self._folder.name]
        self._process = subprocess.Popen(
            [*command, "--remote-debugging-port", "0"], env=os.environ | {"DISPLAY": display},
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        port = Path(self._folder.name) / PORT_FILE
        until(lambda: port.exists() and port.stat().st_size > 0)
        place = json.loads(port.read_text())
        address = f"ws://{place['ws_host']}:{place['ws_port']}/session"
        super().__init__(connect(address, proxy=None, max_size=None, close_timeout=CLOSING))
        self.command("session.new", capabilities={})
        self.command("session.subscribe", events=["log.entryAdded", "network.beforeRequestSent"])
        self._tab = self.command("browsingContext.getTree")["contexts"][0]["context"]

    def __enter__(self) -> "Firefox":
        return self

    def __exit__(self, *_: object) -> None:
        self._channel.close()
        self._process.terminate()
        self._process.wait(PATIENCE)
        self._screen.terminate()
        self._screen.wait(PATIENCE)
        self._folder.cleanup()

    def open(self, url: str) -> None:
        """Open a page, and wait until it is loaded."""
        self.command("browsingContext.navigate", context=self._tab, url=url, wait="complete")

    def evaluate(self, expression: str) -> Any:
        """Return the value, a string or number, of an expression or of its promise."""
        target = {"context": self._tab}
        answer = self.command("script.evaluate", expression=expression, target=target, awaitPromise=True)
        assert answer["type"] == "success", answer
        return answer["result"].get("value")

    def picture(self) -> bytes:
        """What the tab shows, as PNG."""
        return base64.b64decode(self.command("browsingContext.captureScreenshot", context=self._tab)["data"])

    def requested(self) -> list[str]:
        """Addresses that the page has asked for."""
        requests = [item for item in self.events if item.get("method") == "network.beforeRequestSent"]
        return [str(item["params"]["request"]["url"]) for item in requests]

    def complaints(self) -> list[str]:
        """Errors in the page's console."""
        entries = [item["params"] for item in self.events if item.get("method") == "log.entryAdded"]
        return [str(entry["text"]) for entry in entries if entry["level"] == "error"]
