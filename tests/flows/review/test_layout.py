"""What is needed stays in sight and in its place: at every size, and with long names."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glint.storage.locations.location import Location
from glint.tasks.engine.references import CaptureReference
from glint.tasks.stages.capture_geometry import load_geometry
from tests.flows.review.conftest import ServedPage, Tab
from tests.flows.review.inputs_view import INPUTS, READY, asked, place, settle

pytestmark = pytest.mark.long

SURFACE, POSES = (INPUTS.replace("inputs", view) for view in ("surface", "poses"))
VIEWS = ("inputs", "poses", "questions", "surface", "versions")


def test_the_picture_stays_and_what_was_changed_can_be_saved_whichever_tool_is_chosen(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    heights = set()
    for tool in page.eval_on_selector_all("[data-tool]", "all => all.map(({ dataset }) => dataset.tool).slice(0, 9)"):
        page.click(f".tools [data-tool={tool}]")
        heights.add(page.locator(".stage").bounding_box()["height"])
        save, side = page.locator(".save button >> nth=0").bounding_box(), page.locator("aside").bounding_box()
        assert side["y"] <= save["y"] < side["y"] + side["height"] - save["height"], tool
    assert len(heights) == 1


def test_the_pose_of_a_view_with_a_long_name_is_in_sight(tab: Tab) -> None:
    name = "seen-from-the-front-left-under-the-new-lamp-of-the-second-day-07"

    def named(route: Any) -> None:
        answer = route.fetch()
        known = answer.json()
        route.fulfill(response=answer, json=known | {"views": [view | {"capture": name} for view in known["views"]]})

    tab.page.route("**/hemisphere/poses", named)
    page = tab.open(POSES, ".plan .camera")
    cell, plan = page.locator("aside td").last.bounding_box(), page.locator(".plan").bounding_box()
    assert cell["x"] + cell["width"] <= 1280
    label = page.locator(".plan .camera text").bounding_box()
    assert plan["x"] <= label["x"] and label["width"] < plan["width"] / 2
    # The store has no such capture, and so no picture and no row of it; a closed page asks for no more.
    page.close()
    tab.complaints[:] = [text for text in tab.complaints if "404" not in text]


def test_lists_of_keys_and_reasons_begin_at_their_beginning_with_close_in_sight(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    for width, height in ((1280, 800), (1024, 600)):
        page.set_viewport_size({"width": width, "height": height})
        page.click("#help")
        first, close = (page.locator(f"#keys {name}").first.bounding_box() for name in ("dt", "button"))
        assert 0 <= first["y"] < close["y"] and close["y"] + close["height"] <= height
        page.keyboard.press("Escape")


def test_what_is_known_of_a_pixel_comes_into_sight(served: ServedPage, tab: Tab) -> None:
    page, region = tab.open(INPUTS, READY), asked(served, "inputs")["used"]["region"]
    page.mouse.click(*place(tab, region["x"] + region["width"] / 2, region["y"] + region["height"] / 2))
    page.wait_for_selector("aside .chips >> nth=0")
    row, side = page.locator("aside .chips").first.bounding_box(), page.locator("aside").bounding_box()
    assert row["y"] + row["height"] <= side["y"] + side["height"]


def test_the_scale_of_angles_lies_on_the_picture(tab: Tab) -> None:
    page = tab.open(INPUTS.replace("inputs", "versions"), ".versions .divider")
    for width, height in ((1280, 800), (1024, 768)):
        page.set_viewport_size({"width": width, "height": height})
        page.check("text=Map of angles")
        page.wait_for_selector(".legend-box", state="visible")
        legend, stage = (page.locator(name).bounding_box() for name in (".legend-box", ".versions .light-stage"))
        assert stage["x"] < legend["x"] and legend["x"] + legend["width"] < stage["x"] + stage["width"]
        assert stage["y"] < legend["y"] and legend["y"] + legend["height"] < stage["y"] + stage["height"] < height
    settle(tab)


def test_the_surface_fills_the_page_and_the_profile_comes_into_sight(tab: Tab) -> None:
    page = tab.page
    for width, height in ((1280, 800), (1024, 768)):
        page.set_viewport_size({"width": width, "height": height})
        tab.open(SURFACE, "[aria-label=Version]")
        stage, controls = (
            page.locator(f".viewer {name}").first.bounding_box() for name in (".light-stage", ".controls")
        )
        assert stage["height"] == controls["height"] > height - 160
        place = "document.querySelector('.surface-page')"
        assert page.evaluate(f"{place}.scrollHeight <= {place}.clientHeight")
    tab.wait("globalThis.glint.ready.then(() => true)")
    page.focus("main")
    page.keyboard.press("d")
    page.wait_for_selector(".profile-chart")
    chart = page.locator(".profile-chart").bounding_box()
    assert chart["y"] + chart["height"] <= 768
    settle(tab)


@pytest.mark.parametrize(("width", "height"), [(390, 844), (800, 1200), (700, 450)])
def test_nothing_lies_beside_a_small_screen(tab: Tab, width: int, height: int) -> None:
    page = tab.page
    page.set_viewport_size({"width": width, "height": height})
    page.wait_for_selector(".row img")
    beside = """() => [...document.querySelectorAll("body *")]
        .filter((part) => part.getBoundingClientRect().right > innerWidth + 1)
        .map((part) => `${part.tagName}.${part.className}`)"""
    assert page.evaluate(beside) == []
    if width < 600:
        page.wait_for_selector(".row .version", state="hidden")
        page.click(".row .name")
        page.wait_for_selector(READY)
    for view in VIEWS:
        tab.open(INPUTS.replace("inputs", view), ".view > *")
        page.wait_for_selector("aside, .versions .side, .viewer .controls")
        page.wait_for_timeout(300)
        assert page.evaluate(beside) == [], view
        if view == "questions":
            stage = page.locator(".question-place").bounding_box()
            assert stage["width"] * stage["height"] > width * height / 6
    settle(tab)


def test_a_run_that_a_key_begins_comes_into_sight(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    running = {"state": "running", "is_stopping": False, "stages": {}, "seconds": 1.0, "total": None}
    running |= {"stage": "labels", "seconds_left": None}
    page.route("**/front/run", lambda route: route.fulfill(json=running if route.request.method == "POST" else None))
    page.keyboard.press("c")
    page.evaluate("document.querySelector('aside').scrollTop = 10000")
    page.keyboard.press("g")
    page.wait_for_selector(".run >> text=labels")
    save, run = page.locator(".save").first.bounding_box(), page.locator(".run").bounding_box()
    assert save["y"] + save["height"] <= run["y"] + 1 and run["y"] + run["height"] <= 800


def test_what_is_known_of_a_candidate_of_a_single_frame_is_shown(stored: tuple[Path, Path], tab: Tab) -> None:
    store, catalogue = stored
    reference = CaptureReference(Location.parse(catalogue).uri, "hemisphere", "front", str(store), "run")
    clusters, region = reference.context().load("clusters"), load_geometry(reference.context()).region
    single = np.isfinite(clusters.read("normals")[..., 0]) & np.isnan(clusters.read("spread"))
    row, column = np.argwhere(single.any(axis=0))[0]
    page = tab.open(INPUTS, READY)
    page.mouse.click(*place(tab, region.x + int(column), region.y + int(row)))
    page.wait_for_selector("aside caption >> text=Candidates")
    assert "–" in page.inner_text("aside table")


def test_the_verdict_and_its_reason_are_said_once(tab: Tab) -> None:
    warning = {"message": "the mask is doubtful at its foot: correct it", "cause": "mask", "cost_deg": 9.0}
    verdict = "needs a mask: the mask is doubtful at its foot"

    def judged(route: Any) -> None:
        answer = route.fetch()
        route.fulfill(response=answer, json=answer.json() | {"verdict": verdict, "warnings": warnings.pop()})

    warnings = [[], [warning]]
    tab.page.route("**/hemisphere/front/inputs", judged)
    page = tab.open(INPUTS, READY)
    assert page.inner_text("aside h2 >> nth=0") == "Verdict: needs a mask"
    tab.open("#/", ".row img")
    page = tab.open(INPUTS, READY)
    assert page.inner_text("aside h2 >> nth=0") == f"Verdict: {verdict}"


def test_caps_lock_changes_no_key(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    for key, ctrl in (("S", False), ("S", True)):
        page.evaluate(
            """([key, ctrlKey]) => document.body.dispatchEvent(
                new KeyboardEvent("keydown", { key, ctrlKey, modifierCapsLock: true, bubbles: true }))""",
            [key, ctrl],
        )
    assert page.get_attribute("[data-tool=spheres]", "aria-pressed") == "true"
    assert page.inner_text("#status") == "There is nothing to save."
