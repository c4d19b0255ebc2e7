"""The page as a person uses it, in a real browser: captures found, a sphere moved, a mask painted, conflicts seen."""

from dataclasses import replace
from typing import Any

import pytest

from glint.flows.review.object_rows import Row
from glint.storage.edits.edits import Edits
from glint.storage.edits.models import Changes
from glint.storage.locations.location import Location
from tests.flows.review.conftest import ServedPage, Tab, let_in
from tests.flows.review.inputs_view import INPUTS, NOISE, READY, asked, drag, place, saved
from tests.polling import until

pytestmark = pytest.mark.long

SCREENS = ((1280, 800), (820, 1180))
"""Sizes for which the page is made: a small laptop, and a tablet held upright."""


def test_the_catalogue_shows_searches_and_opens_captures(tab: Tab) -> None:
    page = tab.page
    assert page.locator(".row").count() == 1
    assert "hemisphere" in page.inner_text(".row") and "v1" in page.inner_text(".row")
    page.keyboard.press("/")
    page.keyboard.type("no such capture")
    page.wait_for_selector(".empty")
    page.fill("input[type=search]", "HEMI")
    page.wait_for_selector(".row img")
    page.keyboard.press("Enter")
    page.keyboard.press("Home")
    page.keyboard.press("Enter")
    page.wait_for_selector(READY)
    assert page.evaluate("location.hash") == INPUTS
    assert page.title() == "Inputs · hemisphere/front · Glint"


def test_what_needs_a_person_comes_first_and_names_are_only_text(
    served: ServedPage, tab: Tab, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Neither catalogue nor store have the rows that are added here.
    monkeypatch.setattr(served.app.state.review.listing, "refresh_names", list)
    hostile = "<img src=x onerror=alert(1)><script>alert(2)</script>"
    rows = served.app.state.review.listing._rows
    good = rows["hemisphere"]["front"]
    rows["zebra"] = {"front": Row("zebra", "front", "failed", error=hostile, remedy=hostile)}
    rows["yak"] = {"front": replace(good, object="yak", state="doubtful", verdict=hostile, warnings=(hostile,))}
    served.app.state.review.listing._revision += 1
    try:
        tab.page.reload()
        tab.page.wait_for_selector(".row:nth-child(3)")
        names = tab.page.eval_on_selector_all(".row b", "all => all.map(one => one.textContent)")
        assert [name for name in names if name[:1] != "v" and name != "–"] == ["zebra", "yak", "hemisphere"]
        assert hostile in tab.page.inner_text(".row:first-child")
        assert tab.page.locator("main script, main img[src=x]").count() == 0
        tab.page.click("button[data-state=doubtful]")
        tab.wait("document.querySelectorAll('.row').length === 1")
    finally:
        del rows["zebra"], rows["yak"]
        served.app.state.review.listing._revision += 1
        tab.page.goto("about:blank")
    tab.complaints[:] = [text for text in tab.complaints if "404" not in text]  # there is no picture of a zebra


def test_a_warning_offers_the_tool_that_corrects_what_it_is_about(tab: Tab) -> None:
    def with_warning(route: Any) -> None:
        answer = route.fetch()
        warning = {"message": "the mask is doubtful: correct it", "cause": "mask", "cost_deg": 5.0}
        video = {"message": "the video ends early", "cause": "video", "cost_deg": 0.0}
        route.fulfill(response=answer, json=answer.json() | {"warnings": [warning, video]})

    tab.page.route("**/hemisphere/front/inputs", with_warning)
    page = tab.open(INPUTS, READY)
    assert page.locator(".warnings-list button").count() == 1
    page.click(".warnings-list button:has-text('Brush')")
    assert page.get_attribute("[data-tool=brush]", "aria-pressed") == "true"


def test_a_sphere_that_is_off_is_moved_fitted_saved_and_taken_back(served: ServedPage, tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    (sphere,) = asked(served, "inputs")["used"]["spheres"]
    centre, shift = (sphere["x"], sphere["y"]), 0.07 * sphere["radius"]
    page.keyboard.press("s")
    drag(tab, centre, (centre[0] + shift, centre[1]))
    page.wait_for_selector(".sphere [role=status] >> text=off the contour")
    assert "a run would use the contour" in page.inner_text(".sphere")
    page.click("text=Take the fit")
    page.wait_for_selector(".sphere .good")
    saved(tab)
    edits = asked(served, "edits")
    (moved,) = edits["spheres"]
    assert abs(moved["x"] - centre[0]) < 0.015 * sphere["radius"]
    assert edits["history"][0]["author"] == "Ada" and "sphere" in edits["history"][0]["sentence"]
    page.click("text=take back")
    tab.wait("document.getElementById('status').textContent === 'Taken back.'")
    assert asked(served, "edits")["spheres"] is None


def test_a_leaking_mask_is_repaired_by_eraser_brush_and_polygon(served: ServedPage, tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.wait_for_selector("section[data-pixels]")
    region = asked(served, "inputs")["used"]["region"]
    before = int(page.get_attribute("section[data-pixels]", "data-pixels"))
    page.keyboard.press("b")
    corner = (region["x"] + 2, region["y"] + 2)
    drag(tab, corner, (0, 0))  # a leak, up to the frame's edge
    leaked = int(page.get_attribute("section[data-pixels]", "data-pixels"))
    assert leaked > before and page.is_visible("text=The mask touches the frame's edge")
    page.keyboard.press("e")
    for _ in range(4):
        page.keyboard.press("]")
    drag(tab, (corner[0] + 2, corner[1] + 2), (0, 0))
    assert int(page.get_attribute("section[data-pixels]", "data-pixels")) < leaked
    assert not page.is_visible("text=The mask touches the frame's edge")
    for _ in range(2):
        page.keyboard.press("Control+z")
    assert int(page.get_attribute("section[data-pixels]", "data-pixels")) == before
    page.keyboard.press("p")
    middle = (region["x"] + region["width"] / 2, region["y"] + region["height"] / 2)
    for x, y in ((-6, -6), (6, -6), (6, 6), (-6, 6)):
        page.mouse.click(*place(tab, middle[0] + x, middle[1] + y))
    page.keyboard.press("Shift+Enter")
    cut = int(page.get_attribute("section[data-pixels]", "data-pixels"))
    assert before - 180 < cut < before - 110
    saved(tab)
    page.reload()
    tab.wait(f"document.querySelector('section[data-pixels]')?.dataset.pixels === '{cut}'")
    assert "set on the page" in page.inner_text("section[data-pixels]")


def test_an_unfinished_polygon_waits_while_another_tool_is_used(served: ServedPage, tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.wait_for_selector("section[data-pixels]")

    def pixels() -> int:
        return int(page.get_attribute("section[data-pixels]", "data-pixels") or "")

    region, before = asked(served, "inputs")["used"]["region"], pixels()
    # Beside the middle, which an earlier test may have cut out.
    middle = (region["x"] + region["width"] / 2 + 14, region["y"] + region["height"] / 2)
    page.keyboard.press("p")
    for x, y in ((-6, -6), (6, -6)):
        page.mouse.click(*place(tab, middle[0] + x, middle[1] + y))
    page.keyboard.press("v")
    tab.wait("document.getElementById('status').textContent.startsWith('2 corners are kept')")
    page.mouse.click(*place(tab, middle[0], middle[1]))
    page.keyboard.press("Escape")
    page.keyboard.press("p")
    for x, y in ((6, 6), (-6, 6)):
        page.mouse.click(*place(tab, middle[0] + x, middle[1] + y))
    page.keyboard.press("Shift+Enter")
    tab.wait("document.getElementById('status').textContent === 'polygon cut out'")
    assert before - 180 < pixels() < before - 110, "the four corners are those of one polygon"
    page.keyboard.press("Control+z")
    page.mouse.click(*place(tab, middle[0], middle[1]))
    page.keyboard.press("Escape")
    page.keyboard.press("v")
    page.keyboard.press("p")
    page.keyboard.press("Enter")
    tab.wait("document.getElementById('status').textContent.startsWith('corner 1 at ')")
    page.keyboard.press("Backspace")


def test_a_polygon_is_drawn_by_keys_alone(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.wait_for_selector("section[data-pixels]")
    steps = 10

    def move(key: str, count: int = steps) -> None:
        for _ in range(count):
            page.keyboard.press(f"Arrow{key}")

    def pixels() -> int:
        return int(page.get_attribute("section[data-pixels]", "data-pixels") or "")

    before = pixels()
    page.focus("[data-tool=polygon]")
    page.keyboard.press("Enter")  # a button of the toolbar, after which keys go to the picture
    page.keyboard.press("Enter")
    tab.wait("document.getElementById('status').textContent.startsWith('corner 1 at ')")
    move("Right")
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    tab.wait("document.getElementById('status').textContent.startsWith('a polygon needs three corners')")
    move("Down")
    page.keyboard.press("Space")
    move("Left")
    page.keyboard.press("Enter")
    page.keyboard.press("Shift+Enter")
    tab.wait("document.getElementById('status').textContent === 'polygon cut out'")
    cut = pixels()
    page.keyboard.press("Enter")
    for key in ("Right", "Up", "Left"):
        move(key)
        page.keyboard.press("Enter")
    move("Left", 3)
    page.keyboard.press("Enter")
    page.keyboard.press("Backspace")
    tab.wait("document.getElementById('status').textContent === '4 corners'")
    move("Right", 3)
    move("Down")
    page.keyboard.press("Enter")  # on the first corner
    tab.wait("document.getElementById('status').textContent === 'polygon filled'")
    side = 4 * steps
    assert abs(pixels() - cut - side**2) <= 2 * side, "a square was cut out, and filled again"
    for _ in range(2):
        page.keyboard.press("Control+z")
    assert pixels() == before
    page.keyboard.press("Enter")
    page.keyboard.press("Escape")
    assert page.get_attribute("[data-tool=polygon]", "aria-pressed") == "true"
    page.keyboard.press("Escape")
    assert page.get_attribute("[data-tool=look]", "aria-pressed") == "true"


def test_pictures_lights_and_pixels(served: ServedPage, tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.keyboard.press("m")
    page.wait_for_selector("[data-shown$='level/peak']")
    page.keyboard.press("PageDown")
    page.wait_for_selector("[data-shown$='frame?number=100']")
    page.keyboard.press(",")
    page.wait_for_selector("[data-shown$='frame?number=99']")
    page.click("aside canvas", position={"x": 106, "y": 106})
    tab.wait("document.querySelector('.stage').dataset.shown !== null")
    region = asked(served, "inputs")["used"]["region"]
    page.keyboard.press("v")
    page.mouse.click(*place(tab, region["x"] + region["width"] // 2 + 12, region["y"] + region["height"] // 2))
    page.wait_for_selector("aside .chip")
    page.click("aside .chip >> nth=0")
    number = page.inner_text("aside .chip >> nth=0").replace(",", "")
    page.wait_for_selector(f"[data-shown$='frame?number={number}']")
    for _ in range(30):
        page.keyboard.press("+")
    assert page.evaluate("globalThis.Konva.stages.at(-1).scaleX()") == 8


def test_region_and_scale_are_set_by_keyboard_and_line(served: ServedPage, tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    region = asked(served, "inputs")["used"]["region"]
    page.keyboard.press("r")
    page.fill("input[aria-label='Region: width']", str(region["width"] - 3))
    page.keyboard.press("Enter")
    page.keyboard.press("l")
    drag(tab, (10, 10), (60, 10))
    page.fill("[aria-label='Length of the line in millimetres']", "25")
    page.keyboard.press("Tab")
    saved(tab)
    edits = asked(served, "edits")
    assert edits["region"]["width"] == region["width"] - 3
    assert edits["pixel_size"] == pytest.approx(0.5, rel=0.03)


def test_a_scale_is_typed_without_a_line(served: ServedPage, tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    before = asked(served, "edits")["pixel_size"]
    page.fill("[aria-label='Length of the line in millimetres']", "25")
    page.keyboard.press("Tab")
    tab.wait("document.getElementById('status').textContent.startsWith('Draw the line')")
    page.fill("[aria-label='Millimetres of a pixel']", "0.25")
    page.keyboard.press("Tab")
    saved(tab)
    assert asked(served, "edits")["pixel_size"] == 0.25
    page.fill("[aria-label='Millimetres of a pixel']", "" if before is None else str(before))
    page.keyboard.press("Tab")
    saved(tab)
    until(lambda: asked(served, "edits")["pixel_size"] == before)


def test_a_conflict_is_shown_and_nothing_is_lost(served: ServedPage, tab: Tab, chromium: Any) -> None:
    page = tab.open(INPUTS, READY)
    page.keyboard.press("s")
    page.keyboard.press("]")
    page.wait_for_selector(".sphere [role=status]")
    edits = Edits.open(Location.parse(served.store), "hemisphere")
    theirs = Changes.model_validate({"spheres": [{"x": 30.0, "y": 30.0, "radius": 9.0}]})
    edits.save("front", theirs, "Grace", edits.current("front").revision)
    page.fill("aside input[autocomplete=name]", "Ada")
    page.wait_for_timeout(600)
    page.click("aside .save button:has-text('Save')")
    page.wait_for_selector(".conflict")
    assert "Grace changed spheres" in page.inner_text(".conflict")
    assert asked(served, "edits")["spheres"][0]["radius"] == 9.0
    page.click("text=Save mine over it")
    tab.wait("document.getElementById('status').textContent === 'Saved.'")
    after = asked(served, "edits")
    assert after["spheres"][0]["radius"] > 9.0
    assert [revision["author"] for revision in after["history"][:2]] == ["Ada", "Grace"]
    tab.complaints[:] = [text for text in tab.complaints if "409" not in text]


def test_a_link_of_an_earlier_start_opens_nothing(served: ServedPage, chromium: Any) -> None:
    page = chromium.new_page()
    page.goto(f"{served.origin}/open#{'x' * 43}")
    page.wait_for_selector("text=This link is of an earlier start")
    page.fill("#password", served.access.token)
    page.click("button")
    page.wait_for_selector(".row img")
    page.close()


def test_a_bookmark_leads_to_its_view_by_way_of_the_password(served: ServedPage, chromium: Any) -> None:
    page = chromium.new_page()
    page.goto(f"{served.origin}/{INPUTS}")
    page.fill("#password", served.access.token)
    page.click("button")
    page.wait_for_selector(READY)
    assert page.evaluate("location.pathname + location.hash") == f"/{INPUTS}"
    page.close()


def test_no_request_leaves_the_machine(served: ServedPage, chromium: Any) -> None:
    for tab in let_in(served, chromium):
        addresses = list[str]()
        tab.page.on("request", lambda request, addresses=addresses: addresses.append(request.url))
        tab.page.reload()
        tab.page.wait_for_selector(".row img")
        tab.open(INPUTS, READY)
        assert addresses and all(address.startswith((served.origin, "blob:")) for address in addresses)


def test_axe_has_no_serious_findings(tab: Tab) -> None:
    from axe_playwright_python.sync_playwright import Axe

    views = {"#/": ".row img", INPUTS: READY, INPUTS.replace("inputs", "surface"): "canvas.picture"}
    views[INPUTS.replace("inputs", "versions")] = ".versions .divider"
    for view, ready in views.items():
        for width, height in SCREENS:
            tab.page.set_viewport_size({"width": width, "height": height})
            tab.open(view, ready)
            tab.page.wait_for_timeout(500)
            violations = Axe().run(tab.page).response["violations"]
            assert [
                (item["id"], node["target"], node["failureSummary"])
                for item in violations
                if item["impact"] in ("serious", "critical")
                for node in item["nodes"]
            ] == [], (view, width)
            fits = "all => all.every(part => part.scrollWidth <= part.clientWidth)"
            assert tab.page.eval_on_selector_all("html, .view, .surface-page", fits), (view, width)
    tab.complaints[:] = [text for text in tab.complaints if not any(noise in text for noise in NOISE)]


def test_everything_can_be_done_by_keyboard(served: ServedPage, tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.wait_for_selector("section[data-pixels]")
    page.keyboard.press("s")
    page.keyboard.press("a")
    page.wait_for_selector(".sphere:nth-child(2)")
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("Delete")
    tab.wait("document.querySelectorAll('.sphere').length === 1")
    before = int(page.get_attribute("section[data-pixels]", "data-pixels"))
    page.keyboard.press("b")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Space")  # the frame's middle lies between object and sphere
    tab.wait(f"Number(document.querySelector('section[data-pixels]').dataset.pixels) > {before}")
    page.keyboard.press("Control+z")
    tab.wait(f"Number(document.querySelector('section[data-pixels]').dataset.pixels) === {before}")
    page.keyboard.press("v")
    page.keyboard.press("Space")
    page.wait_for_selector("aside section >> text=outside the region")
    page.keyboard.press("?")
    page.wait_for_selector("dialog[open] dd >> text=maximum over time")
    page.keyboard.press("Escape")
    assert page.locator("dialog[open]").count() == 0
    tab.complaints[:] = [text for text in tab.complaints if "422" not in text]


def test_the_mask_grows_from_a_pixel_and_shrinks_with_the_tolerance(served: ServedPage, tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.wait_for_selector("section[data-pixels]")
    region = asked(served, "inputs")["used"]["region"]
    before = int(page.get_attribute("section[data-pixels]", "data-pixels"))
    middle = (region["x"] + region["width"] // 2 + 14, region["y"] + region["height"] // 2)
    page.keyboard.press("w")
    page.wait_for_selector("[data-shown$='level/peak']")

    def pixels(condition: str) -> int:
        tab.wait(f"Number(document.querySelector('section[data-pixels]').dataset.pixels) {condition}")
        return int(page.get_attribute("section[data-pixels]", "data-pixels"))

    page.keyboard.down("Shift")
    page.mouse.click(*place(tab, *middle))
    page.keyboard.up("Shift")
    cut = pixels(f"< {before}")
    page.fill("input[aria-label^='Tolerance']", "12")
    less = pixels(f"> {cut}")
    assert less < before
    page.keyboard.press("Control+z")
    assert pixels(f"=== {before}") == before
    page.mouse.click(*place(tab, 1, 1))
    page.wait_for_selector("#status.error >> text=far from the mask")
    tab.complaints[:] = [text for text in tab.complaints if "422" not in text]


def test_camera_and_pose_are_set_on_the_picture_and_by_numbers(served: ServedPage, tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    width, height = asked(served, "inputs")["frame_size"]
    page.keyboard.press("c")
    page.fill("aside input[aria-label='Focal length in pixels']", "800")
    page.keyboard.press("Tab")
    page.wait_for_selector("aside >> text=perspective")
    drag(tab, ((width - 1) / 2, (height - 1) / 2), (width / 2 + 9, height / 2 - 6))
    page.select_option("aside select", "turntable")
    page.fill("aside input[aria-label^='Degrees']", "30")
    page.keyboard.press("Tab")
    saved(tab)
    edits = asked(served, "edits")
    (fx, skew, cx), (_, fy, cy), _ = edits["camera"]["matrix"]
    assert (fx, skew, fy) == (800, 0, 800)
    assert cx == pytest.approx(width / 2 + 9, abs=1.0) and cy == pytest.approx(height / 2 - 6, abs=1.0)
    assert edits["pose"]["turntable"] == 30
    page.fill("aside input[aria-label^='Focal length as of']", "26")
    page.keyboard.press("Tab")
    assert page.input_value("aside input[aria-label='Focal length in pixels']") == str(
        round(26 * (width**2 + height**2) ** 0.5 / 43.27, 2)
    )
    page.select_option("aside select", "camera_to_world")
    page.fill("aside textarea", "1 0 0 0\n0 1 0 0\n0 0 1 250\n0 0 0 1")
    page.keyboard.press("Tab")
    page.click("aside .save button:has-text('Save')")
    until(lambda: asked(served, "edits")["pose"]["camera_to_world"] is not None)
    assert asked(served, "edits")["pose"]["camera_to_world"][2] == [0, 0, 1, 250]
    edits = Edits.open(Location.parse(served.store), "hemisphere")
    edits.discard("front", "Ada")
