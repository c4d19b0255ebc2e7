"""What is changed on the page and not saved is lost only when a person agrees; failures are announced."""

from typing import Any

import pytest

from tests.flows.review.conftest import ServedPage, Tab
from tests.flows.review.inputs_view import INPUTS, NOISE, READY, asked

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


def test_back_and_the_skip_link_lose_nothing(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.focus("main")
    page.keyboard.press("s")
    page.keyboard.press("a")
    spheres = page.locator(".sphere").count()
    page.locator(".skip").press("Enter")
    assert page.evaluate("document.activeElement.id") == "main"
    page.once("dialog", lambda dialog: dialog.dismiss())
    page.go_back(wait_until="commit")
    tab.wait(f"location.hash === '{INPUTS}'")
    assert page.locator(".sphere").count() == spheres
    page.once("dialog", lambda dialog: dialog.accept())
    page.click("#tabs a >> text=Versions")
    page.wait_for_selector(".versions textarea")
    tab.complaints[:] = [text for text in tab.complaints if not any(part in text for part in NOISE)]


def test_a_link_that_is_opened_in_another_tab_asks_nothing_and_loses_nothing(tab: Tab) -> None:
    page, questions = tab.open(INPUTS, READY), list[str]()
    page.focus("main")
    page.keyboard.press("s")
    page.keyboard.press("a")

    def answer(dialog: Any) -> None:
        questions.append(dialog.message)
        dialog.accept()

    page.on("dialog", answer)
    with page.context.expect_page() as opened:
        page.click("#tabs a >> text=Versions", modifiers=["Control"])
    opened.value.close()
    assert not questions and page.evaluate("location.hash") == INPUTS
    assert page.is_enabled(".save button:has-text('Undo')")
    page.keyboard.press("Control+z")
    tab.complaints[:] = [text for text in tab.complaints if not any(part in text for part in NOISE)]


def test_corners_of_a_polygon_are_not_left_without_a_question(tab: Tab) -> None:
    page, questions = tab.open(INPUTS, READY), list[str]()

    def set_corner() -> None:
        page.focus("main")
        page.keyboard.press("p")
        page.keyboard.press("Enter")
        tab.wait("document.getElementById('status').textContent.startsWith('corner 1 at ')")

    def leave() -> None:
        page.click("#tabs a >> text=Versions")

    def answer(dialog: Any) -> None:
        questions.append(dialog.message)
        if len(questions) == 1:
            dialog.dismiss()
        else:
            dialog.accept()

    page.on("dialog", answer)
    set_corner()
    leave()
    assert page.evaluate("location.hash") == INPUTS and len(questions) == 1
    page.keyboard.press("Backspace")
    tab.wait("document.getElementById('status').textContent === '0 corners'")
    leave()
    page.wait_for_selector(".versions textarea")
    assert len(questions) == 1, "nothing was left to be lost"
    tab.open(INPUTS, READY)
    set_corner()
    leave()
    page.wait_for_selector(".versions textarea")
    assert len(questions) == 2
    tab.complaints[:] = [text for text in tab.complaints if not any(part in text for part in NOISE)]


def test_a_note_that_is_being_written_stays_while_versions_are_compared(tab: Tab) -> None:
    page = tab.open(INPUTS.replace("inputs", "versions"), ".versions textarea")
    page.fill(".versions textarea", "a chip at the rim")
    page.click("input[aria-label='Left: v1']")
    page.click("input[aria-label='Right: v1']")
    page.wait_for_timeout(300)
    assert page.input_value(".versions textarea") == "a chip at the rim"
    page.once("dialog", lambda dialog: dialog.dismiss())
    page.click("#tabs a >> text=Inputs")
    assert page.locator(".versions textarea").count() == 1
    tab.complaints[:] = [text for text in tab.complaints if not any(part in text for part in NOISE)]


def test_the_key_that_saves_also_works_while_a_number_is_typed(served: ServedPage, tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.fill("aside input[autocomplete=name]", "Ada")
    page.fill("input[aria-label='Diameter of sphere 1 in millimetres']", "24.5")
    page.keyboard.press("Control+s")
    tab.wait("document.getElementById('status').textContent === 'Saved.'")
    (sphere,) = asked(served, "edits")["spheres"]
    assert sphere["diameter_mm"] == 24.5
    page.click("text=take back")
    tab.wait("document.getElementById('status').textContent === 'Taken back.'")


def test_a_sphere_is_removed_by_its_button(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.click("button[aria-label='Remove sphere 1']")
    assert page.locator(".sphere").count() == 0
    page.keyboard.press("Control+z")
    assert page.locator(".sphere").count() == 1
