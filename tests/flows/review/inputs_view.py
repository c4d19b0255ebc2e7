"""What the tests in a browser do with the view of a capture's inputs."""

import json
import urllib.request
from typing import Any

from tests.flows.review.conftest import ServedPage, Tab

INPUTS = "#/hemisphere/front/inputs"
READY = ".stage[data-shown]"
NOISE = ("GL Driver Message", "fallback to software WebGL")
"""What Chromium remarks about drawing without a graphics card."""


def asked(served: ServedPage, path: str) -> Any:
    """What the interface answers."""
    request = urllib.request.Request(f"{served.origin}/api/captures/hemisphere/front/{path}", headers=served.session)
    with urllib.request.urlopen(request) as answer:
        return json.load(answer)


def place(tab: Tab, x: float, y: float) -> tuple[float, float]:
    """Where a pixel of the full frame is on the screen."""
    script = """([x, y]) => {
        const stage = globalThis.Konva.stages.at(-1);
        const box = stage.container().getBoundingClientRect();
        return [box.x + stage.x() + x * stage.scaleX(), box.y + stage.y() + y * stage.scaleY()];
    }"""
    column, row = tab.page.evaluate(script, [x, y])
    return column, row


def drag(tab: Tab, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Drag from a pixel of the full frame to another."""
    hold(tab, start, end)


def hold(tab: Tab, start: tuple[float, float], *ends: tuple[float, float]) -> None:
    """Press the mouse at a pixel of the full frame, move it to others one after another, and let it go."""
    mouse = tab.page.mouse
    mouse.move(*place(tab, *start))
    mouse.down()
    for end in ends:
        for share in (0.3, 0.7, 1.0):
            mouse.move(*place(tab, *(a + (b - a) * share for a, b in zip(start, end, strict=True))))
        start = end
    mouse.up()


def saved(tab: Tab, author: str = "Ada") -> None:
    """Write the author's name and save."""
    tab.page.fill("aside input[autocomplete=name]", author)
    tab.page.click("aside .save button:has-text('Save')")
    tab.wait("document.getElementById('status').textContent === 'Saved.'")


def settle(tab: Tab) -> None:
    """Close the page, so that nothing is drawn any longer, and forget what Chromium remarked about drawing."""
    tab.page.goto("about:blank")
    tab.complaints[:] = [text for text in tab.complaints if not any(part in text for part in NOISE)]
