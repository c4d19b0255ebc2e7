"""What the page says: it goes when it no longer holds, hides nothing that is needed, and names what was refused."""

from typing import Any

import pytest

from tests.flows.review.conftest import ServedPage, Tab
from tests.flows.review.inputs_view import INPUTS, READY, asked, place, settle
from tests.polling import until

pytestmark = pytest.mark.long

STATUS = "document.getElementById('status').textContent"
VERSIONS, SURFACE = INPUTS.replace("inputs", "versions"), INPUTS.replace("inputs", "surface")


def test_the_request_for_a_name_goes_when_it_is_written(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.focus("main")
    page.keyboard.press("a")
    page.wait_for_selector(".sphere:nth-child(2)")
    page.keyboard.press("Control+s")
    tab.wait(f"{STATUS}.startsWith('Write your name')")
    page.keyboard.type("A")
    tab.wait(f"{STATUS} === ''")


def test_an_error_covers_no_control_and_is_closed_by_mouse_and_keys(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.route("**/level/peak", lambda route: route.abort())
    for close in (lambda: page.click("#status"), lambda: page.keyboard.press("Escape")):
        page.focus("main")
        page.keyboard.press("m")
        tab.wait(f"{STATUS} !== ''")
        for width, height in ((1280, 800), (1024, 768)):
            page.set_viewport_size({"width": width, "height": height})
            status, timeline, side = (page.locator(name).bounding_box() for name in ("#status", ".timeline", "aside"))
            assert status["y"] + status["height"] <= timeline["y"]
            assert status["x"] + status["width"] <= side["x"]
        close()
        assert page.evaluate(STATUS) == ""
    tab.complaints[:] = [text for text in tab.complaints if "ERR_FAILED" not in text]


def test_a_picture_that_does_not_come_is_not_said_to_be_shown(tab: Tab) -> None:
    page, peak, median = tab.open(INPUTS, READY), "[data-kind=peak]", "[data-kind=background]"
    refusal = {"error": "the frames are damaged", "remedy": "run the capture again"}
    page.route("**/level/peak", lambda route: route.fulfill(status=422, json=refusal))
    page.focus("main")
    page.keyboard.press("m")
    tab.wait(f"{STATUS}.startsWith('the frames are damaged')")
    assert [page.get_attribute(button, "aria-pressed") for button in (peak, median)] == ["false", "true"]
    page.unroute("**/level/peak")
    page.keyboard.press("m")
    page.wait_for_selector(".stage[data-shown$='level/peak']")
    assert [page.get_attribute(button, "aria-pressed") for button in (peak, median)] == ["true", "false"]
    tab.complaints[:] = [text for text in tab.complaints if "422" not in text]


def test_who_is_not_let_in_any_longer_is_told_how_to_save(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.fill("aside input[autocomplete=name]", "Ada")
    page.fill("[aria-label='Millimetres of a pixel']", "0.3")
    page.keyboard.press("Tab")
    cookies = page.context.cookies()
    page.context.clear_cookies()
    page.click("aside .save button:has-text('Save')")
    tab.wait(f"{STATUS}.includes('in another tab; this page keeps what is not saved')")
    page.context.add_cookies(cookies)
    page.click("aside .save button:has-text('Save')")
    tab.wait(f"{STATUS} === 'Saved.'")
    page.click("text=take back")
    tab.wait(f"{STATUS} === 'Taken back.'")
    tab.complaints[:] = [text for text in tab.complaints if "401" not in text]


NOT_TAKEN = (
    ("Region: width", "5000", "The region cannot have width 5000"),
    ("Region: x", "", 'No number was typed for "Region: x"'),
    ("r of sphere 1", "1", '"r of sphere 1" cannot be 1: it must be at least 3 pixels'),
    ("y of sphere 1", "", 'No number was typed for "y of sphere 1"'),
    ("Diameter of sphere 1 in millimetres", "-2", '"Diameter of sphere 1 in millimetres" cannot be -2'),
    ("Focal length in pixels", "0", '"Focal length in pixels" cannot be 0: it must be more than 0'),
    ("Millimetres of a pixel", "-1", '"Millimetres of a pixel" cannot be -1'),
)


def test_a_number_that_is_not_taken_is_named(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)

    def typed(field: str, value: str) -> None:
        page.fill(f"[aria-label='{field}']", value)
        page.keyboard.press("Enter")

    for field, value, words in NOT_TAKEN:
        before = page.input_value(f"[aria-label='{field}']")
        typed(field, value)
        tab.wait(f"{STATUS}.startsWith({words!r})")
        assert page.input_value(f"[aria-label='{field}']") == before, field
        assert page.is_disabled("aside .save button >> nth=0"), f"nothing is changed by {field}"
    for field, value, words in NOT_TAKEN:
        before = page.input_value(f"[aria-label='{field}']")
        typed(field, value)
        tab.wait(f"{STATUS}.startsWith({words!r})")
        typed(field, str(float(before or 10.0) - 1.0))
        tab.wait(f"{STATUS} === ''")


@pytest.mark.parametrize(
    ("view", "ready", "kind", "angle"),
    [
        (INPUTS, READY, "How the pose is given", "Degrees by which the object is turned"),
        (INPUTS.replace("inputs", "poses"), ".plan .camera", "Pose of front", "Degrees of front"),
    ],
)
def test_an_emptied_angle_of_a_turntable_is_named_and_stays(
    tab: Tab, view: str, ready: str, kind: str, angle: str
) -> None:
    page = tab.open(view, ready)
    page.select_option(f"[aria-label='{kind}']", "turntable")
    for typed, words in (("", "No number was typed for"), ("50000", "cannot be 50000: it must lie between")):
        page.fill(f"[aria-label^='{angle}']", "30")
        page.keyboard.press("Tab")
        page.fill(f"[aria-label^='{angle}']", typed)
        page.keyboard.press("Tab")
        tab.wait(f"{STATUS}.includes({words!r})")
        assert page.input_value(f"[aria-label^='{angle}']") == "30"


def test_a_note_without_words_is_refused_in_words_and_one_with_them_confirmed(served: ServedPage, tab: Tab) -> None:
    page = tab.open(VERSIONS, ".versions textarea")
    page.fill(".versions form input", "Ada")
    for text, words in (("  ", "Write the note first."), ("a crack", "Note added.")):
        page.fill(".versions textarea", text)
        page.click("text=Add the note")
        tab.wait(f"{STATUS} === {words!r}")
    settle(tab)


def test_a_version_says_what_was_edited_and_a_digest_is_told_by_its_beginning(tab: Tab) -> None:
    def two_versions(route: Any) -> None:
        answer = route.fetch()
        (version, *_) = answer.json()
        edits = {"front": {"mask": "Ada", "pixel_size": "Bob"}}
        message = "run b7806b41-6020-46f3-80f2-bacf9d72381f"
        route.fulfill(response=answer, json=[version | {"name": "v2", "edits": edits, "message": message}, version])

    def difference(route: Any) -> None:
        address = route.request.url.replace("/v1/v2/", "/v1/v1/")
        if not address.endswith("/front"):
            # Pictures may still be on their way when the test ends.
            return route.continue_(url=address)
        answer = route.fetch(url=address)
        change = {"stage": "markup", "name": "input markup", "before": "not set", "after": "7218b1ff" * 8}
        return route.fulfill(response=answer, json=answer.json() | {"changes": [change]})

    tab.page.route("**/hemisphere/versions", two_versions)
    tab.page.route("**/differences/v1/v2/**", difference)
    page = tab.open(VERSIONS, ".versions .changes")
    edited, catalogue = (page.inner_text(f".versions .side tbody tr:nth-child({number})") for number in (1, 2))
    assert "edited: mask, pixel size (Ada, Bob)\nrun b7806b41\n" in edited and "inputs of the catalogue" in catalogue
    cell = page.locator(".versions .changes td").last
    assert (cell.inner_text(), cell.get_attribute("title")) == ("contents 7218b1ff…", "7218b1ff" * 8)
    settle(tab)


def test_a_view_that_is_being_read_says_so(tab: Tab) -> None:
    held = list[Any]()
    tab.page.route("**/hemisphere/versions", lambda route: held.append(route))
    tab.page.evaluate("view => { location.hash = view; }", SURFACE)
    until(lambda: bool(tab.page.wait_for_timeout(50)) or bool(held))
    assert tab.page.get_attribute("main", "aria-busy") == "true"
    held[0].continue_()
    tab.wait("!document.querySelector('main').hasAttribute('aria-busy')")
    assert tab.page.is_visible("[aria-label=Version]")
    settle(tab)


def test_a_run_tells_the_time_that_is_left_or_else_the_time_that_it_took(tab: Tab) -> None:
    run = {"state": "running", "stage": "labels", "stages": {}, "seconds": 70.0, "total": None, "version": ""}
    left: dict[str, float | None] = {"seconds_left": None}
    tab.page.route("**/front/run", lambda route: route.fulfill(json=run | left))
    page = tab.open(INPUTS, READY)
    page.wait_for_selector("aside .run >> text=labels · for 70 s")
    left["seconds_left"] = 30.0
    page.wait_for_selector("aside .run >> text=labels · about 30 s left")


def test_what_cannot_be_saved_is_told_in_words_alone(served: ServedPage, tab: Tab) -> None:
    page, (width, height) = tab.open(INPUTS, READY), asked(served, "inputs")["frame_size"]
    page.wait_for_selector("section[data-pixels]")
    page.fill("aside input[autocomplete=name]", "Ada")
    page.keyboard.press("Enter")
    page.keyboard.press("p")
    for x, y in ((-1, -1), (width, -1), (width, height), (-1, height)):
        page.mouse.click(*place(tab, x, y))
    page.keyboard.press("Shift+Enter")
    page.wait_for_selector("section[data-pixels='0']")
    page.keyboard.press("Control+s")
    empty = "the mask is empty → paint the object, or take the edit back to have it estimated"
    tab.wait(f"{STATUS} === {empty!r}")
    page.keyboard.press("Control+z")
    page.select_option("[aria-label='How the pose is given']", "camera_to_world")
    page.fill("[aria-label^='Matrix from camera']", "2 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1")
    page.keyboard.press("Control+s")
    tab.wait(f"{STATUS}.includes('their lengths are 2, 1, 1') && {STATUS}.includes(' → give a rotation there')")
    tab.complaints[:] = [text for text in tab.complaints if "422" not in text]


def test_a_value_that_is_refused_is_told_also_where_it_was_to_be_saved(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.fill("[aria-label='Focal length in pixels']", "-5")
    page.keyboard.press("Control+s")
    tab.wait(f"{STATUS}.includes('cannot be -5')")
    page.select_option("[aria-label='How the pose is given']", "camera_to_world")
    page.keyboard.press("Control+z")
    page.select_option("[aria-label='How the pose is given']", "camera_to_world")
    page.fill("[aria-label^='Matrix from camera']", "1 2 3")
    page.keyboard.press("Tab")
    tab.wait(f"{STATUS}.startsWith('The matrix of a pose has four rows')")
    page.fill("[aria-label^='Matrix from camera']", "1 0 0 5\n0 1 0 0\n0 0 1 0\n0 0 0 1")
    page.keyboard.press("Tab")
    tab.wait(f"{STATUS} === ''")


def test_what_was_not_taken_is_told_where_the_rest_is_saved(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.fill("aside input[autocomplete=name]", "Ada")
    page.fill("[aria-label='Millimetres of a pixel']", "0.25")
    page.fill("[aria-label='Focal length in pixels']", "-5")
    page.keyboard.press("Control+s")
    tab.wait(f"{STATUS} === 'Saved, except: \"Focal length in pixels\" cannot be -5: it must be more than 0.'")
    page.click("text=take back")
    tab.wait(f"{STATUS} === 'Taken back.'")
    tab.open(INPUTS.replace("inputs", "poses"), ".plan .camera")
    page.select_option("[aria-label='Pose of front']", "turntable")
    page.fill("[aria-label='Degrees of front']", "50000")
    page.keyboard.press("Control+s")
    tab.wait(f"{STATUS}.startsWith('Saved, except: \"Degrees of front\" cannot be 50000')")
    page.select_option("[aria-label='Pose of front']", "")
    page.keyboard.press("Control+s")
    tab.wait(f"{STATUS} === 'Saved.'")


def test_an_address_of_no_view_opens_the_inputs_in_their_tab(tab: Tab) -> None:
    page = tab.open(INPUTS.replace("inputs", "imputs"), READY)
    assert page.inner_text("#tabs [aria-current=page]") == "Inputs"
