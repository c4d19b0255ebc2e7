"""The questions view in a real browser: loops are shown, answers become marks, and the last one is taken back."""

import pytest

from glint.flows.review.app import STATIC
from tests.flows.review.conftest import ServedPage, Tab
from tests.flows.review.inputs_view import asked

pytestmark = [pytest.mark.long, pytest.mark.slow]

VIEW, READY = "#/hemisphere/front/questions", "canvas.loop[data-shown]"


def test_answers_are_saved_as_marks_labelled_at_once_and_taken_back(served: ServedPage, tab: Tab) -> None:
    page = tab.open(VIEW, READY)
    first, second = asked(served, "questions")["questions"][:2]
    assert len(first["lights"]) == first["loop"]["count"] <= 49 and first["sheet"]
    shown = f"{first['frame']} {first['x']} {first['y']}"
    assert page.get_attribute("canvas.loop", "data-shown") == shown
    page.keyboard.press("t")
    tab.wait("document.getElementById('status').textContent.startsWith('Write your name')")
    page.fill("input[autocomplete=name]", "Ada")
    page.focus("main")
    page.keyboard.press("t")
    tab.wait("document.querySelector('.questions img.normals').naturalWidth > 0")
    (mark,) = asked(served, "edits")["marks"]
    assert mark == {"frame": first["frame"], "x": first["x"], "y": first["y"], "kind": "true"}
    page.wait_for_selector(f"canvas.loop[data-shown='{second['frame']} {second['x']} {second['y']}']")
    page.keyboard.press("f")
    tab.wait("document.querySelector('aside').innerText.includes('2 marks: ')")
    assert [mark["kind"] for mark in asked(served, "edits")["marks"]] == ["true", "false"]
    for left in (1, 0):
        page.keyboard.press("u")
        tab.wait(f"document.querySelector('aside').innerText.includes('{['No marks', '1 mark:'][left]}')")
    assert not asked(served, "edits")["marks"]
    page.keyboard.press("s")
    page.wait_for_selector(f"canvas.loop[data-shown='{second['frame']} {second['x']} {second['y']}']")


def test_a_loop_is_stopped_stepped_and_tinted_without_keys(tab: Tab) -> None:
    page = tab.open(VIEW, READY)
    controls = page.locator("[role=group][aria-label=Loop]")
    controls.get_by_text("Stop").click()
    frame = page.inner_text(".frame-number")
    page.wait_for_timeout(200)
    assert page.inner_text(".frame-number") == frame, "it has stopped"
    controls.get_by_label("Next frame").click()
    assert page.inner_text(".frame-number") != frame
    controls.get_by_label("Frame before").click()
    assert page.inner_text(".frame-number") == frame
    tint = controls.get_by_text("Tint")
    assert tint.get_attribute("aria-pressed") == "true"
    page.focus("main")
    page.keyboard.press("h")
    assert tint.get_attribute("aria-pressed") == "false"
    page.keyboard.press("p")
    controls.wait_for(state="hidden")  # nothing is chosen yet that a loop could show
    page.keyboard.press("q")
    controls.get_by_text("Play").click()
    tab.wait(f"document.querySelector('.frame-number').innerText !== '{frame}'")


def test_axe_has_no_serious_findings(tab: Tab) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    page = tab.open(VIEW, READY)
    findings = axe.run(page).response["violations"]
    assert [finding["id"] for finding in findings if finding["impact"] in ("serious", "critical")] == []


def test_modules_of_the_view_are_served_with_the_page() -> None:
    assert {path.name for path in (STATIC / "questions").iterdir()} == {
        "draft.js",
        "free.js",
        "loop.js",
        "loop_controls.js",
        "marks.js",
        "questions.css",
        "view.js",
    }


def test_no_loop_of_another_question_is_shown_while_the_server_does_not_answer(tab: Tab) -> None:
    page = tab.open(VIEW, READY)
    page.route("**/questions/loop*", lambda route: route.abort())
    page.focus("main")
    page.keyboard.press("s")
    page.wait_for_selector("#status.error >> text=the server does not answer")
    page.wait_for_selector("canvas.loop", state="hidden")
    page.unroute("**/questions/loop*")
    page.wait_for_selector("#status >> text=The server answers again.")
    page.wait_for_selector(READY)
    tab.complaints[:] = [text for text in tab.complaints if "ERR_FAILED" not in text]
