"""Answers that come late or in another order than they were asked for: the newest counts, and what was done stays."""

import json
from typing import Any

import pytest

from tests.flows.review.conftest import ServedPage, Tab
from tests.flows.review.inputs_view import INPUTS, READY, asked, drag, place, settle
from tests.polling import until

pytestmark = pytest.mark.long

QUESTIONS, FREE = INPUTS.replace("inputs", "questions"), ".free-stage .stage[data-shown]"


class Held:
    """Requests of an address that wait: the first ones, or all; the page goes on meanwhile."""

    def __init__(self, tab: Tab, pattern: str, count: int = 1) -> None:
        self._tab, self._count, self.routes = tab, count, list[Any]()
        tab.page.route(pattern, self._hold)

    def _hold(self, route: Any) -> None:
        if len(self.routes) < self._count:
            self.routes.append(route)
        else:
            route.continue_()

    def wait(self) -> None:
        """Wait until they have all been asked for."""
        until(lambda: bool(self._tab.page.wait_for_timeout(20)) or len(self.routes) == self._count)

    def release(self) -> None:
        """Let them be answered, and wait until the page has the answers."""
        for route in self.routes:
            with self._tab.page.expect_response(route.request.url):
                route.continue_()
        self._tab.page.wait_for_timeout(300)


def middle_of(served: ServedPage) -> tuple[int, int]:
    """The pixel in the middle of the region, and so of the hemisphere."""
    region = asked(served, "inputs")["used"]["region"]
    return region["x"] + region["width"] // 2, region["y"] + region["height"] // 2


def test_the_pixel_that_was_clicked_last_is_shown(served: ServedPage, tab: Tab) -> None:
    page, (x, y) = tab.open(INPUTS, READY), middle_of(served)
    held = Held(tab, "**/pixel?*")
    page.mouse.click(*place(tab, x, y))
    held.wait()
    page.mouse.click(*place(tab, x + 8, y))
    page.wait_for_selector(f"aside >> text=x {x + 8}, y {y}")
    held.release()
    assert page.is_visible(f"aside >> text=x {x + 8}, y {y}")


def test_the_mark_is_of_the_highlight_that_was_clicked_last(served: ServedPage, tab: Tab) -> None:
    page, (x, y) = tab.open(QUESTIONS, ".question-stage"), middle_of(served)
    page.click("[data-mode=free]")
    page.wait_for_selector(FREE)
    held = Held(tab, "**/highlights")
    page.mouse.click(*place(tab, x, y))
    held.wait()
    page.mouse.click(*place(tab, x + 20, y + 12))
    tab.wait("document.querySelector('.question').textContent.startsWith('Highlight at')")
    shown = page.inner_text(".question")
    held.release()
    assert page.inner_text(".question") == shown


def test_no_choice_of_an_earlier_picture_is_left_to_be_marked(served: ServedPage, tab: Tab) -> None:
    page, middle = tab.open(QUESTIONS, ".question-stage"), middle_of(served)
    page.click("[data-mode=free]")
    page.wait_for_selector(FREE)
    held = Held(tab, "**/highlights")
    page.mouse.click(*place(tab, *middle))
    held.wait()
    page.click(".timeline [data-kind=peak]")
    held.release()
    assert page.inner_text(".question").startswith("Click a highlight")
    assert page.is_disabled("[data-answer=true]")


def test_a_question_that_is_not_shown_is_not_answered(served: ServedPage, tab: Tab) -> None:
    page = tab.open(QUESTIONS, ".question-stage")
    page.fill("input[autocomplete=name]", "Ada")
    tab.wait("document.querySelector('.question').textContent.startsWith('1 of ')")
    revision = asked(served, "edits")["revision"]
    held = Held(tab, "**/questions")
    page.click("text=More questions")
    held.wait()
    page.keyboard.press("t")
    page.wait_for_timeout(500)
    assert asked(served, "edits")["revision"] == revision
    page.keyboard.press("s")
    assert page.inner_text(".question").startswith("Looking for the questions")
    held.release()
    tab.wait("document.querySelector('.question').textContent.startsWith('1 of ')")


def test_nothing_is_painted_before_the_mask_has_come_which_would_replace_it(served: ServedPage, tab: Tab) -> None:
    held, middle = Held(tab, "**/front/mask"), middle_of(served)
    page = tab.open(INPUTS, READY)
    held.wait()
    page.keyboard.press("b")
    drag(tab, middle, (middle[0] + 9, middle[1]))
    page.keyboard.press("p")
    for x, y in ((-6, -6), (6, -6), (6, 6)):
        page.mouse.click(*place(tab, middle[0] + x, middle[1] + y))
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    assert page.is_disabled("aside .save button:has-text('Undo')"), "nothing can be painted yet"
    assert "is being read" in page.inner_text("#status")
    held.release()
    tab.wait("Number(document.querySelector('section[data-pixels]')?.dataset.pixels) > 0")
    before = page.get_attribute("section[data-pixels]", "data-pixels")
    page.keyboard.press("e")
    drag(tab, middle, (middle[0] + 9, middle[1]))
    assert int(page.get_attribute("section[data-pixels]", "data-pixels") or 0) < int(before or 0)
    page.keyboard.press("Control+z")
    assert page.get_attribute("section[data-pixels]", "data-pixels") == before


def test_the_versions_that_were_chosen_last_are_compared(tab: Tab) -> None:
    tab.open(INPUTS.replace("inputs", "versions"), ".versions .divider")
    shown = tab.page.evaluate("""async () => {
      const { VersionStage } = await import("/static/version_stage.js");
      const stage = new VersionStage();
      document.querySelector("main").append(stage.element);
      const pair = (ready) => ({
        width: 1, height: 1, facts: { difference: { limit: 10 } },
        array: async (name) => (await ready, name.endsWith("normals") ? new Uint16Array(2) : new Uint8Array(1)),
      });
      let come;
      const slow = stage.setPair(pair(new Promise((resolve) => (come = resolve))), "v1", "v2");
      await stage.setPair(pair(null), "v3", "v4");
      come();
      await slow;
      const names = stage.names.map((name) => name.textContent);
      const late = pair(new Promise((resolve) => (come = resolve)));
      await stage.setPair(Object.assign(late, { array: pair(null).array }), "v5", "v6");
      late.array = async () => (await new Promise((resolve) => (come = resolve)), new Uint8Array(1));
      stage.angles.checked = true;
      const on = stage.showAngles(true);
      await stage.showAngles(false);
      come();
      await on;
      const share = stage.views[0].state.lensShare;
      stage.dispose();
      return JSON.stringify([names, share]);
    }""")
    assert json.loads(shown) == [["v3", "v4"], 0]
    settle(tab)


def test_rows_that_are_older_than_others_are_asked_for_again(tab: Tab) -> None:
    page, polled = tab.page, list[str]()

    def answer(route: Any) -> None:
        url = route.request.url
        if "revision=" in url:
            polled.append(url.partition("revision=")[2])
            route.fulfill(status=204)
            return
        offset = int(url.partition("offset=")[2].partition("&")[0])
        row: dict[str, Any] = {"object": "vase", "state": "done", "warnings": [], "version": "", "date": ""}
        rows = [row | {"capture": f"view-{number}", "confident": None} for number in range(offset, offset + 100)]
        facts = {"store": "s", "total": 1000, "counts": {"done": 1000}, "complete": True, "problem": ""}
        route.fulfill(json=facts | {"rows": rows, "revision": 5 if offset == 0 else 6})

    page.route("**/api/captures?*", answer)
    page.route("**/thumbnail*", lambda route: route.fulfill(status=204))
    page.reload()
    page.wait_for_selector("text=view-0")
    page.evaluate("document.querySelector('.scroller').scrollTop = 30000")
    page.wait_for_selector("text=view-420")
    polled.clear()
    until(lambda: bool(page.wait_for_timeout(50)) or len(polled) > 1)
    assert polled[-1] == "5"


def test_what_is_still_growing_when_a_person_saves_is_saved_as_well(served: ServedPage, tab: Tab) -> None:
    page, (x, y) = tab.open(INPUTS, READY), middle_of(served)
    page.wait_for_selector("section[data-pixels]")
    page.fill("aside input[autocomplete=name]", "Ada")
    page.fill("input[aria-label='Millimetres of a pixel']", "0.5")
    page.keyboard.press("Enter")
    page.keyboard.press("w")
    held = Held(tab, "**/growth?*")
    page.keyboard.down("Shift")
    page.mouse.click(*place(tab, x, y))
    page.keyboard.up("Shift")
    held.wait()
    page.keyboard.press("Control+s")
    page.wait_for_timeout(300)
    held.release()
    tab.wait("document.getElementById('status').textContent === 'Saved.'")
    edits = asked(served, "edits")
    assert edits["pixel_size"] == 0.5 and edits["has_mask"]
    page.click("text=take back")
    tab.wait("document.getElementById('status').textContent === 'Taken back.'")
