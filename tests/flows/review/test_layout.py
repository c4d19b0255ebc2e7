"""What is needed stays in sight and in its place: at every size, and with long names."""

from typing import Any

import pytest

from tests.flows.review.conftest import ServedPage, Tab
from tests.flows.review.inputs_view import INPUTS, READY, asked, place, settle

pytestmark = pytest.mark.long

SURFACE, POSES = (INPUTS.replace("inputs", view) for view in ("surface", "poses"))


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
