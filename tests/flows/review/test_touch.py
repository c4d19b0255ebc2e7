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


def test_more_fingers_take_back_the_corner_of_the_first_alone(tablet: tuple[Tab, Any]) -> None:
    tab, sender = tablet
    tab.page.tap("[data-tool=polygon]")
    points = [place(tab, x, 8) for x in (8, 20, 32, 44)]
    for point in points[:2]:
        touch(sender, "touchStart", point)
        touch(sender, "touchEnd")
    touch(sender, "touchStart", points[1])
    touch(sender, "touchStart", *points[1:3])
    touch(sender, "touchStart", *points[1:])
    touch(sender, "touchEnd")
    tab.page.keyboard.press("Backspace")
    tab.wait("document.getElementById('status').textContent === '1 corner'")
    tab.page.keyboard.press("Escape")


def test_a_camera_follows_the_pointer_only_while_it_is_held(tablet: tuple[Tab, Any]) -> None:
    tab, sender = tablet
    page, turn = tab.open(INPUTS.replace("inputs", "poses"), ".plan .camera"), ".plan .camera[aria-valuenow='10']"
    page.select_option("aside select", "turntable")
    page.fill("aside tbody input", "10")
    page.keyboard.press("Enter")
    page.wait_for_selector(turn)
    box, plan = page.locator(".plan .camera rect").bounding_box(), page.locator(".plan").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down(button="right")
    page.mouse.move(plan["x"] + plan["width"] / 2, plan["y"])
    page.mouse.up(button="right")
    assert page.is_visible(turn), "the right button turns nothing"
    touch(sender, "touchStart", (x, y))
    touch(sender, "touchCancel")
    page.mouse.move(x, y)
    page.mouse.move(x + 8, y)
    assert page.is_visible(turn), "a finger that the browser has taken holds it no longer"
