"""Numbers that are typed: the keyboard keeps its place among the fields, and goes back to the picture."""

from typing import Any

import pytest

from tests.flows.review.conftest import ServedPage, Tab
from tests.flows.review.inputs_view import INPUTS, READY, asked, drag

pytestmark = pytest.mark.long

FOCUSED = "document.activeElement.ariaLabel"


def test_tab_goes_on_from_a_number_that_was_typed(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    for field, after in (("x of sphere 1", "y of sphere 1"), ("Region: x", "Region: y")):
        value = float(page.input_value(f"[aria-label='{field}']"))
        page.fill(f"[aria-label='{field}']", str(round(value - 1)))
        page.keyboard.press("Tab")
        assert page.evaluate(FOCUSED) == after
    page.wait_for_selector(".sphere [role=status] >> text=off the contour")


def test_tab_goes_on_from_the_numbers_of_camera_and_pose(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    for name, value, after in (
        ("Focal length in pixels", "400", "Focal length as of a 35 mm camera, in millimetres"),
        ("Focal length in pixels", "500", "Principal point: x"),
        ("Principal point: x", "70", "Principal point: y"),
    ):
        page.fill(f"[aria-label='{name}']", value)
        page.keyboard.press("Tab")
        assert page.evaluate(FOCUSED) == after
    page.select_option("[aria-label='How the pose is given']", "turntable")
    page.fill("[aria-label^='Degrees by which']", "12")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "All views of this object together"


def test_tab_goes_on_from_an_angle_in_the_table_of_poses(tab: Tab) -> None:
    page = tab.open(INPUTS.replace("inputs", "poses"), ".plan .camera")
    page.select_option("[aria-label='Pose of front']", "turntable")
    page.fill("[aria-label='Degrees of front']", "12")
    page.keyboard.press("Shift+Tab")
    assert page.evaluate(FOCUSED) == "Pose of front"


def test_the_keyboard_stays_at_a_sphere_whose_fit_is_taken_and_undone(tab: Tab) -> None:
    page, take = tab.open(INPUTS, READY), ".sphere button:has-text('Take the fit')"
    before = page.input_value("[aria-label='x of sphere 1']")
    page.fill("[aria-label='x of sphere 1']", str(float(before) - 1))
    page.keyboard.press("Tab")
    page.wait_for_selector(take)
    page.focus(take)
    page.keyboard.press("Enter")
    page.wait_for_selector(".sphere [role=status] >> text=centre 0.0 px")
    assert page.evaluate("document.activeElement.textContent") == "Take the fit"
    page.keyboard.press("Control+z")
    assert page.evaluate("document.activeElement.closest('.sphere') !== null")


def test_a_number_is_saved_by_a_click_on_save_right_after_it_was_typed(tab: Tab) -> None:
    page, save = tab.open(INPUTS, READY), "aside .save button >> nth=0"
    page.fill("aside input[autocomplete=name]", "Ada")
    page.fill("[aria-label='Millimetres of a pixel']", "0.3")
    assert page.get_attribute(save, "aria-disabled") == "true"
    box = page.locator(save).bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    tab.wait("document.getElementById('status').textContent === 'Saved.'")
    page.click("text=take back")
    tab.wait("document.getElementById('status').textContent === 'Taken back.'")


def test_what_is_being_typed_is_kept_while_a_contour_is_measured(tab: Tab) -> None:
    page, held = tab.open(INPUTS, READY), list[Any]()
    page.route("**/sphere-fit", lambda route: held.append(route))
    page.fill("[aria-label='x of sphere 1']", "40")
    page.keyboard.press("Tab")
    page.keyboard.type("7")
    while not held:
        page.wait_for_timeout(50)
    held[0].continue_()
    page.wait_for_selector(".sphere [role=status]:not(.faint)")
    assert page.input_value("[aria-label='y of sphere 1']") == "7"


def test_keys_go_to_the_picture_after_a_number_and_after_a_sphere_was_dragged(served: ServedPage, tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    (sphere,) = asked(served, "inputs")["used"]["spheres"]
    page.click(".tools [data-tool=spheres]")
    page.focus("[aria-label='Millimetres of a pixel']")
    drag(tab, (sphere["x"], sphere["y"]), (sphere["x"] + 2, sphere["y"]))
    page.keyboard.press("b")
    assert page.get_attribute("[data-tool=brush]", "aria-pressed") == "true"
    page.fill("[aria-label='Millimetres of a pixel']", "0.3")
    page.keyboard.press("Enter")
    page.keyboard.press("e")
    assert page.get_attribute("[data-tool=eraser]", "aria-pressed") == "true"
    page.click(".tools [data-tool=scale]")
    drag(tab, (4, 4), (24, 4))
    assert page.evaluate(FOCUSED) == "Length of the line in millimetres"
    page.keyboard.type("5")
    page.keyboard.press("Escape")
    page.keyboard.press("v")
    assert page.get_attribute("[data-tool=look]", "aria-pressed") == "true"


def test_enter_accepts_the_name_and_returns_the_keyboard_to_the_picture(tab: Tab) -> None:
    page = tab.open(INPUTS, READY)
    page.focus("main")
    page.keyboard.press("a")
    page.keyboard.press("Control+s")
    tab.wait("document.activeElement.autocomplete === 'name'")
    page.keyboard.type("Ada")
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.className") == "stage"
    page.keyboard.press("b")
    assert page.get_attribute("[data-tool=brush]", "aria-pressed") == "true"
    assert page.input_value("aside input[autocomplete=name]") == "Ada"
    assert page.evaluate("localStorage.getItem('author')") == "Ada"
    page.wait_for_selector(".sphere:nth-child(2) [role=status]:not(.faint)")
