"""The page under fingers, as on a tablet: one paints, two move and zoom the picture and paint nothing."""

from collections.abc import Iterator
from typing import Any

import pytest

from tests.flows.review.conftest import ServedPage, Tab
from tests.flows.review.inputs_view import INPUTS, READY, place

pytestmark = pytest.mark.long

PIXELS = "document.querySelector('[data-pixels]').dataset.pixels"
ZOOM = "globalThis.Konva.stages.at(-1).scaleX()"


@pytest.fixture
def tablet(served: ServedPage, chromium: Any) -> Iterator[tuple[Tab, Any]]:
    """A tab of a tablet held across, let in and at the inputs of the capture, and the sender of its touches."""
    profile = chromium.new_context(viewport={"width": 1024, "height": 768}, has_touch=True)
    page = profile.new_page()
    page.goto(served.access.link())
    page.wait_for_selector(".row img")
    tab = Tab(page, [])
    tab.open(INPUTS, READY)
    tab.wait("document.querySelector('[data-pixels]') !== null")
    yield tab, profile.new_cdp_session(page)
    profile.close()


def touch(sender: Any, kind: str, *points: tuple[float, float]) -> None:
    """Send where the fingers are."""
    fingers = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(points)]
    sender.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": fingers})


def test_one_finger_paints_and_two_zoom(tablet: tuple[Tab, Any]) -> None:
    tab, sender = tablet
    page = tab.page
    page.tap("[data-tool=brush]")
    before, zoom = page.evaluate(PIXELS), page.evaluate(ZOOM)
    x, y = place(tab, 8, 8)
    touch(sender, "touchStart", (x, y))
    touch(sender, "touchStart", (x, y), (x + 80, y))
    for spread in (100, 130, 160):
        touch(sender, "touchMove", (x, y), (x + spread, y))
    touch(sender, "touchEnd", (x, y))
    touch(sender, "touchMove", (x + 60, y + 60))
    touch(sender, "touchEnd")
    assert page.evaluate(ZOOM) == pytest.approx(2.0 * zoom, rel=0.05)
    assert page.evaluate(PIXELS) == before, "two fingers paint nothing"
    assert page.is_disabled(".save button:has-text('Undo')")
    x, y = place(tab, 8, 8)
    touch(sender, "touchStart", (x, y))
    touch(sender, "touchMove", (x + 30, y + 10))
    touch(sender, "touchEnd")
    tab.wait(f"{PIXELS} !== '{before}'")
    assert page.is_enabled(".save button:has-text('Undo')")
