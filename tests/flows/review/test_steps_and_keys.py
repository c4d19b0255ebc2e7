"""Undo brings back what was there, looking changes nothing, and keys reach what has the focus."""

import json
from datetime import datetime
from typing import Any
from zoneinfo import ZoneInfo

import pytest

from tests.flows.review.conftest import ServedPage, Tab
from tests.flows.review.inputs_view import INPUTS, READY, asked, drag, hold, place, settle
from tests.polling import until

pytestmark = pytest.mark.long

VERSIONS = INPUTS.replace("inputs", "versions")


def sent_edits(tab: Tab) -> list[Any]:
    """What the page sends to be saved, which is refused."""
    sent = list[Any]()

    def refuse(route: Any) -> None:
        if route.request.method == "POST":
            sent.append(json.loads(route.request.post_data)["changes"])
            route.abort()
        else:
            route.continue_()

    tab.page.route("**/edits", refuse)
    return sent


def test_undo_puts_a_sphere_back_where_it_was_before_another_was_added(served: ServedPage, tab: Tab) -> None:
    page, field = tab.open(INPUTS, READY), "[aria-label='x of sphere 1']"
    before = page.input_value(field)
    page.focus("main")
    page.keyboard.press("a")
    page.wait_for_selector(".sphere:nth-child(2)")
    page.fill(field, "30")
    page.keyboard.press("Tab")
    for _ in range(2):
        page.click("aside .save button:has-text('Undo')")
    assert page.locator(".sphere").count() == 1
    assert page.input_value(field) == before


def test_the_tool_for_the_region_alone_changes_nothing(tab: Tab) -> None:
    def without_results(route: Any) -> None:
        answer = route.fetch()
        inputs = answer.json()
        given = inputs["given"] | {"region": None}
        route.fulfill(response=answer, json=inputs | {"used": None, "given": given})

    tab.page.route("**/hemisphere/front/inputs", without_results)
    sent, page = sent_edits(tab), tab.open(INPUTS, READY)
    page.wait_for_selector("text=found when it runs")
    page.fill("aside input[autocomplete=name]", "Ada")
    page.focus("main")
    page.keyboard.press("r")
    page.keyboard.press("a")
    page.keyboard.press("Control+s")
    until(lambda: bool(page.wait_for_timeout(50)) or bool(sent))
    assert set(sent[0]) == {"spheres"}
    page.keyboard.press("r")
    page.fill("input[aria-label='Region: width']", "50")
    page.keyboard.press("Control+s")
    until(lambda: bool(page.wait_for_timeout(50)) or len(sent) == 2)
    assert sent[1]["region"]["width"] == 50
    tab.page.evaluate("document.getElementById('status').textContent = ''")
    tab.complaints[:] = [text for text in tab.complaints if "ERR_FAILED" not in text]


UNDO = "aside .save button:has-text('Undo')"
NOTHING = "document.getElementById('status').textContent === 'There is nothing to save.'"


def test_a_drag_that_ends_where_it_began_is_no_step(served: ServedPage, tab: Tab) -> None:
    page, region = tab.open(INPUTS, READY), asked(served, "inputs")["used"]["region"]
    corner = (region["x"] - 0.5, region["y"] - 0.5)
    page.focus("main")
    page.keyboard.press("r")
    hold(tab, corner, (corner[0] + 6, corner[1] + 6), corner)
    assert page.is_disabled(UNDO)
    drag(tab, corner, (corner[0] + 6, corner[1] + 6))
    assert page.input_value("[aria-label='Region: x']") == str(region["x"] + 6)
    page.click(UNDO)
    assert page.input_value("[aria-label='Region: x']") == str(region["x"])
    page.focus("main")
    page.keyboard.press("s")
    sphere = asked(served, "inputs")["used"]["spheres"][0]
    hold(tab, (sphere["x"], sphere["y"]), (sphere["x"] + 5, sphere["y"]), (sphere["x"], sphere["y"]))
    page.wait_for_selector(".sphere [role=status] >> text=off the contour")
    assert page.is_disabled(UNDO)


def test_a_line_of_the_scale_is_a_step_only_if_it_gives_another_scale(tab: Tab) -> None:
    page, length = tab.open(INPUTS, READY), "[aria-label='Length of the line in millimetres']"
    page.focus("main")
    page.keyboard.press("l")
    hold(tab, (20, 10), (60, 10), (20, 10))
    assert page.is_disabled(UNDO) and page.evaluate("document.activeElement.className") == "stage"
    drag(tab, (10, 10), (60, 10))
    page.fill(length, "25")
    page.keyboard.press("Tab")
    scale = page.input_value("[aria-label='Millimetres of a pixel']")
    assert float(scale) == pytest.approx(0.5, rel=0.03)
    drag(tab, (10, 20), (35, 20))
    assert float(page.input_value(length)) == pytest.approx(12.5, rel=0.05), "the scale is kept, and measures the line"
    page.keyboard.type("25")
    page.keyboard.press("Tab")
    assert float(page.input_value("[aria-label='Millimetres of a pixel']")) == pytest.approx(1, rel=0.05)
    page.click(UNDO)
    assert page.input_value("[aria-label='Millimetres of a pixel']") == scale
    page.click(UNDO)
    assert page.is_disabled(UNDO)


def test_a_line_that_a_second_finger_breaks_off_leaves_the_one_before(tab: Tab) -> None:
    page, said = tab.open(INPUTS, READY), "section:has-text('The line is') > p"
    page.focus("main")
    page.keyboard.press("l")
    drag(tab, (10, 10), (60, 10))
    before = page.inner_text(said)
    page.mouse.move(*place(tab, 30, 30))
    page.mouse.down()
    page.mouse.move(*place(tab, 40, 30))
    assert page.inner_text(said) != before
    page.evaluate("document.querySelector('.stage').dispatchEvent(new PointerEvent('pointercancel'))")
    page.mouse.up()
    assert page.inner_text(said) == before


def test_what_is_unchanged_is_saved_without_a_name(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.keyboard.press("Control+s")
    tab.wait(NOTHING)
    page.focus("main")
    page.keyboard.press("s")
    page.keyboard.press("ArrowRight")
    page.wait_for_timeout(500)
    page.keyboard.press("ArrowLeft")
    page.wait_for_timeout(500)
    page.evaluate("document.getElementById('status').textContent = ''")
    page.keyboard.press("Control+s")
    tab.wait(NOTHING)
    page = tab.open(INPUTS.replace("inputs", "poses"), ".plan")
    page.keyboard.press("Control+s")
    tab.wait(NOTHING)
    before, other = page.input_value("[aria-label='Pose of front']"), "turntable"
    assert before != other
    for kind in (other, before):
        page.select_option("[aria-label='Pose of front']", kind)
    page.evaluate("document.getElementById('status').textContent = ''")
    page.keyboard.press("Control+s")
    tab.wait(NOTHING)
    tab.open("#/", ".row img")


def test_an_angle_that_is_being_typed_is_saved_by_the_button(tab: Tab) -> None:
    page, sent = tab.open(INPUTS.replace("inputs", "poses"), ".plan"), sent_edits(tab)
    page.fill("aside input[autocomplete=name]", "Ada")
    page.select_option("[aria-label='Pose of front']", "turntable")
    page.fill("[aria-label='Degrees of front']", "12")
    page.click("aside .save button:has-text('Save')")
    until(lambda: bool(page.wait_for_timeout(50)) or bool(sent))
    assert sent[0] == {"pose": {"turntable": 12}}
    tab.complaints[:] = [text for text in tab.complaints if "ERR_FAILED" not in text]


def test_arrow_keys_move_the_slider_and_space_the_box_that_has_the_focus(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.wait_for_selector("section[data-pixels]")
    for slider in ("Tolerance of growing, in levels of 255", "Size of the brush"):
        before = int(page.input_value(f"[aria-label='{slider}']"))
        page.focus(f"[aria-label='{slider}']")
        page.keyboard.press("ArrowRight")
        assert int(page.input_value(f"[aria-label='{slider}']")) == before + 1
    assert page.get_attribute(".stage", "data-shown").endswith("level/background"), "the picture is the same"
    page.focus("label:has-text('Show the mask') input")
    page.keyboard.press("Space")
    assert not page.is_checked("label:has-text('Show the mask') input")
    page.focus("[aria-label=Frame]")
    page.keyboard.press("ArrowRight")
    page.wait_for_selector("[data-shown$='frame?number=1']")


def test_keys_reach_the_view_from_a_choice_that_was_clicked(tab: Tab) -> None:
    page = tab.open(INPUTS.replace("inputs", "surface"), "[aria-label=Version]")
    tab.wait("globalThis.glint.ready.then(() => true)")
    page.click("input[value=matte]")
    page.keyboard.press("c")
    assert page.is_checked("input[value=confidence]")
    page.focus("input[value=matte]")
    page.keyboard.press("ArrowRight")
    assert page.is_checked("input[value=glossy]"), "the arrow keys belong to the choice"
    settle(tab)


def test_the_list_of_keys_is_that_of_the_view(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    tab.open(VERSIONS, ".versions .divider")
    page.click("#help")
    assert page.locator("#keys dt").count() == 1
    assert "this list" in page.inner_text("#keys dl")
    settle(tab)


def test_versions_are_chosen_by_keys_one_after_another(tab: Tab) -> None:
    page = tab.open(VERSIONS, ".versions .divider")
    page.focus("input[aria-label='Left: v1']")
    page.evaluate("globalThis.glint = null")
    page.evaluate("document.activeElement.dispatchEvent(new Event('change'))")
    tab.wait("globalThis.glint?.ready.then(() => true)")
    assert page.evaluate("document.activeElement.ariaLabel") == "Left: v1"
    settle(tab)


def test_a_note_is_added_once_however_often_its_button_is_pressed(served: ServedPage, tab: Tab) -> None:
    page = tab.open(VERSIONS, ".versions textarea")
    before = len(asked(served, "edits")["notes"])
    page.fill(".versions textarea", "a chip at the foot")
    page.fill(".versions form input", "Ada")
    page.dblclick("text=Add the note")
    page.wait_for_selector(".notes >> text=a chip at the foot")
    page.wait_for_timeout(500)
    assert len(asked(served, "edits")["notes"]) == before + 1
    settle(tab)


def test_a_result_that_comes_while_something_is_changed_is_not_shown_over_it(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    done = {"state": "done", "version": "v9", "stages": {}, "seconds": 1.0, "total": None, "stage": ""}
    answers = [done | {"state": "running"}, done]
    page.route("**/front/run", lambda route: route.fulfill(json=answers.pop(0) if len(answers) > 1 else answers[0]))
    page.click("text=Run from here")
    page.wait_for_selector("text=done: v9")
    page.keyboard.press("a")
    page.wait_for_selector(".sphere:nth-child(2)")
    page.wait_for_timeout(1500)
    assert page.locator(".sphere").count() == 2


def test_a_run_is_asked_for_once_however_often_its_key_is_pressed(tab: Tab) -> None:
    page, sent = tab.open(INPUTS, READY), list[Any]()
    failed = {"error": "no memory", "remedy": "end other programs"}

    def answer(route: Any) -> None:
        if route.request.method == "POST":
            sent.append(route)
        else:
            route.fulfill(json=None)

    page.route("**/front/run", answer)
    page.focus("main")
    for _ in range(3):
        page.keyboard.press("g")
    until(lambda: bool(page.wait_for_timeout(50)) or bool(sent))
    page.wait_for_timeout(300)
    assert len(sent) == 1
    sent[0].fulfill(status=422, json=failed)
    tab.wait("document.getElementById('status').textContent === 'no memory → end other programs'")
    page.click("text=Run from here")
    until(lambda: bool(page.wait_for_timeout(50)) or len(sent) == 2)
    tab.complaints[:] = [text for text in tab.complaints if "422" not in text]


def test_nothing_is_turned_while_poses_are_saved(tab: Tab) -> None:
    page, held = tab.open(INPUTS.replace("inputs", "poses"), ".plan"), list[Any]()
    page.route("**/edits", lambda route: held.append(route) if route.request.method == "POST" else route.continue_())
    page.fill("aside input[autocomplete=name]", "Ada")
    page.click("text=Evenly, as they are listed")
    page.keyboard.press("Control+s")
    until(lambda: bool(page.wait_for_timeout(50)) or bool(held))
    page.keyboard.press("Control+z")
    assert page.is_disabled("aside button:has-text('Evenly, as')") or page.evaluate(
        "document.querySelector('.poses').inert"
    )
    assert page.input_value("input[aria-label='Degrees of front']") == "0"
    held[0].abort()
    tab.wait("document.getElementById('status').className === 'error'")
    assert not page.evaluate("document.querySelector('.poses').inert")
    tab.complaints[:] = [text for text in tab.complaints if "ERR_FAILED" not in text]


def test_a_page_that_was_signed_out_leads_back_to_its_view(served: ServedPage, tab: Tab) -> None:
    page = tab.page
    page.context.clear_cookies()
    page.evaluate("view => { location.hash = view; }", INPUTS)
    page.route("**/api/session", lambda route: route.abort())
    page.fill("#password", served.access.token)
    page.click("button")
    page.wait_for_selector("text=The server does not answer")
    page.unroute("**/api/session")
    page.click("button")
    page.wait_for_selector(READY)
    assert page.evaluate("location.pathname + location.hash") == f"/{INPUTS}"
    tab.complaints[:] = [text for text in tab.complaints if not ("401" in text or "ERR_FAILED" in text)]


def test_a_picture_that_is_not_answered_is_announced_in_words(tab: Tab) -> None:
    tab.page.route("**/level/peak", lambda route: route.abort())
    page = tab.open(INPUTS, READY)
    page.focus("main")
    page.keyboard.press("m")
    tab.wait("document.getElementById('status').textContent.startsWith('the server does not answer → start')")
    tab.complaints[:] = [text for text in tab.complaints if "ERR_FAILED" not in text]


def test_undoing_a_mark_that_others_have_removed_keeps_the_steps_before(tab: Tab) -> None:
    first = {"frame": 1, "x": 1, "y": 1, "kind": "true"}
    refusal = {"error": "changed", "remedy": "look", "conflicts": []}
    tab.page.route("**/none/edits/undo", lambda route: route.fulfill(status=409, json=refusal))
    answer = {"marks": [first], "revision": 3}
    tab.page.route(
        "**/none/edits", lambda route: route.fulfill(json={"revision": None} if route.request.post_data else answer)
    )
    left = tab.page.evaluate(
        """async (first) => {
          const { Marks } = await import("/static/questions/marks.js");
          const marks = new Marks({ capture: { path: "/none" }, name: "Ada" }, () => {}, () => {});
          const second = { ...first, frame: 2 };
          marks.steps = [{ revision: 1, own: [first], before: [] }, { revision: 2, own: [second], before: [first] }];
          await marks.undo();
          return marks.steps.map(({ revision }) => revision);
        }""",
        first,
    )
    assert left == [1]
    tab.complaints[:] = [text for text in tab.complaints if "409" not in text]


def test_a_draft_that_failed_is_made_again(tab: Tab) -> None:
    answers = [
        (422, {"error": "no frames", "remedy": "run"}),
        (200, {"revision": 1, "changed_pixels": 0, "seconds": 1}),
    ]
    tab.page.route("**/none/labelling", lambda route: route.fulfill(status=answers[0][0], json=answers.pop(0)[1]))
    tab.page.route("**/none/normals*", lambda route: route.fulfill(status=204))
    texts = tab.page.evaluate("""async () => {
      const { Draft } = await import("/static/questions/draft.js");
      const draft = new Draft("/none", { saved: [{}], revision: 1 }), texts = [];
      for (let time = 0; time < 2; time += 1) {
        await draft.show();
        texts.push(draft.state.textContent);
      }
      return texts;
    }""")
    assert texts[0] == "no frames → run" and texts[1].startswith("1 mark: no normals change")
    tab.complaints[:] = [text for text in tab.complaints if "422" not in text]


def test_all_views_show_times_where_the_browser_is(served: ServedPage, chromium: Any) -> None:
    profile = chromium.new_context(viewport={"width": 1280, "height": 800}, timezone_id="Asia/Kolkata")
    tab = Tab(profile.new_page(), [])
    tab.page.goto(served.access.link())
    tab.page.wait_for_selector(".row img")
    moment = tab.page.inner_text(".row .version span")
    row = json.loads(tab.page.evaluate("fetch('/api/captures/hemisphere/front').then((answer) => answer.text())"))
    elsewhere = datetime.fromisoformat(row["date"]).astimezone(ZoneInfo("Asia/Kolkata"))
    assert moment == f"{elsewhere:%Y-%m-%d %H:%M}"
    version = tab.open(VERSIONS, ".versions .divider").locator(".versions tr", has_text=row["version"]).last
    assert moment in version.inner_text()
    surface = tab.open(INPUTS.replace("inputs", "surface"), "[aria-label=Version]")
    assert moment in surface.inner_text("[aria-label=Version] option >> nth=0")
    profile.close()
