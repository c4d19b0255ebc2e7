"""What is changed on the page and not saved is lost only when a person agrees; failures are announced."""

from typing import Any

import pytest

from tests.flows.review.conftest import Tab
from tests.flows.review.inputs_view import INPUTS, READY

pytestmark = pytest.mark.long


def test_keys_change_nothing_while_changes_are_saved(tab: Tab) -> None:
    page, held = tab.open(INPUTS, READY), list[Any]()
    page.route("**/edits", lambda route: held.append(route) if route.request.method == "POST" else route.continue_())
    page.fill("aside input[autocomplete=name]", "Ada")
    page.focus("main")
    page.keyboard.press("s")
    page.keyboard.press("a")
    page.keyboard.press("Control+s")
    while not held:
        page.wait_for_timeout(50)
    spheres = page.locator(".sphere").count()
    page.keyboard.press("a")
    assert page.locator(".sphere").count() == spheres
    held[0].abort()
    tab.wait("document.getElementById('status').className === 'error'")
    page.keyboard.press("a")
    assert page.locator(".sphere").count() == spheres + 1
    page.once("dialog", lambda dialog: dialog.dismiss())
    page.click("#tabs a >> text=Poses")
    assert page.evaluate("location.hash") == INPUTS
    tab.complaints[:] = [text for text in tab.complaints if "ERR_FAILED" not in text]


def test_an_address_that_cannot_be_read_is_a_problem_in_words(tab: Tab) -> None:
    tab.open("#/%E0/x", ".problem")


def test_what_a_button_of_a_view_fails_at_is_announced(tab: Tab) -> None:
    tab.page.evaluate(
        "import('/static/dom.js').then(({ guarded }) => guarded(() => Promise.reject(new Error('no space')))())"
    )
    tab.wait("document.getElementById('status').textContent === 'no space'")
