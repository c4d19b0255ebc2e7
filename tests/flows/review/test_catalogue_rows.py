"""Rows of the catalogue view in a browser: they open at the first click, say all, and keep the keyboard's place."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from glint.flows.review.object_rows import Row
from tests.flows.review.conftest import ServedPage, Tab

pytestmark = pytest.mark.long

CHOSEN = "document.activeElement.closest('.row')?.querySelector('b').textContent"


@pytest.fixture
def rows(served: ServedPage, tab: Tab, monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, dict[str, Row]]]:
    """The server's rows, to which a test adds some that neither catalogue nor store has."""
    monkeypatch.setattr(served.app.state.review.listing, "refresh_names", list)
    known = served.app.state.review.listing._rows
    before = {name: dict(captures) for name, captures in known.items()}
    yield known
    # A page that is gone complains of no picture that these rows have not.
    tab.page.close()
    known.clear()
    known.update(before)
    served.app.state.review.listing._revision += 1
    tab.complaints[:] = [text for text in tab.complaints if "404" not in text]


def shown(served: ServedPage, tab: Tab, selector: str) -> Any:
    """Tell the views that there is something new, and wait until an element is there."""
    served.app.state.review.listing._revision += 1
    tab.page.wait_for_selector(selector)
    return tab.page


def test_a_click_opens_a_row_whichever_was_chosen_before(
    served: ServedPage, tab: Tab, rows: dict[str, dict[str, Row]]
) -> None:
    rows["yak"] = {"front": Row("yak", "front", "new")}
    page = shown(served, tab, ".row >> text=yak")
    page.click(".row:has-text('yak')")
    tab.wait("location.hash.startsWith('#/yak/front')")


def test_the_keyboard_stays_in_a_row_that_changes(
    served: ServedPage, tab: Tab, rows: dict[str, dict[str, Row]]
) -> None:
    page, good = tab.page, rows["hemisphere"]["front"]
    page.focus("main")
    page.keyboard.press("Home")
    assert page.evaluate(CHOSEN) == "hemisphere"
    rows["hemisphere"] = {"front": replace(good, version="v9")}
    shown(served, tab, ".version >> text=v9")
    assert page.evaluate(CHOSEN) == "hemisphere"


def test_all_that_is_said_of_a_capture_is_read_by_keys_and_by_a_click(
    served: ServedPage, tab: Tab, rows: dict[str, dict[str, Row]]
) -> None:
    error = "no sphere was found in any of the frames, " * 8
    said = Row(
        "yak", "front", "failed", warnings=("the camera shook", "no scale"), error=error, remedy="draw its circle"
    )
    rows["yak"] = {"front": said}
    rows["zebra"] = {"front": Row("zebra", "front", "failed", error="it is short")}
    page = shown(served, tab, ".row >> text=yak")
    shown_texts = "[...document.querySelectorAll('dialog.reasons p')].map((part) => part.textContent)"
    assert [page.is_visible(f".row:has-text('{name}') .more") for name in ("yak", "zebra")] == [True, False]
    page.focus("main")
    page.keyboard.press("Home")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    assert page.evaluate(shown_texts) == [error, "draw its circle", "the camera shook", "no scale"]
    assert page.evaluate(
        "document.querySelector('.reason').scrollHeight > document.querySelector('.reason').clientHeight"
    )
    page.keyboard.press("Escape")
    tab.wait("document.activeElement.textContent === 'More'")
    rows["yak"] = {"front": replace(rows["yak"]["front"], remedy="")}
    page.keyboard.press("i")
    shown(served, tab, "dialog.reasons")
    tab.wait("document.querySelector('.row .more').dataset.texts === '3'")
    page.click("dialog.reasons button")
    tab.wait(f"{CHOSEN} === 'yak'")
    page.click(".row:has-text('yak') .more")
    assert page.evaluate("location.hash") in ("", "#/")
    page.click("dialog.reasons a")
    tab.wait("location.hash.startsWith('#/yak/front')")
    assert page.locator("dialog.reasons").count() == 0


def test_who_comes_back_from_a_capture_finds_the_list_where_it_was_left(
    served: ServedPage, tab: Tab, rows: dict[str, dict[str, Row]]
) -> None:
    # More rows than one answer holds.
    rows |= {f"vase-{number:03d}": {"front": Row(f"vase-{number:03d}", "front", "new")} for number in range(230)}
    page = shown(served, tab, ".row >> text=vase-000")
    page.focus("main")
    page.keyboard.press("End")
    page.wait_for_selector(".row.chosen >> text=vase-229")
    page.keyboard.press("Enter")
    tab.wait("location.hash.startsWith('#/vase-229')")
    page.go_back()
    page.wait_for_selector(".row.chosen >> text=vase-229")
    row, list_ = page.locator(".row.chosen").bounding_box(), page.locator(".scroller").bounding_box()
    assert list_["y"] <= row["y"] and row["y"] + row["height"] <= list_["y"] + list_["height"]
    page.fill("input[type=search]", "vase-1")
    page.wait_for_selector(".row.chosen >> text=vase-100")


def test_a_long_path_is_broken_not_cut(served: ServedPage, tab: Tab, rows: dict[str, dict[str, Row]]) -> None:
    path = "/shared/" + "videos-of-the-second-day/" * 5 + "front.mp4"
    rows["yak"] = {"front": Row("yak", "front", "failed", error=f"{path} cannot be read")}
    page = shown(served, tab, ".row >> text=yak")
    assert page.evaluate(
        "(({ scrollWidth, clientWidth }) => scrollWidth <= clientWidth)(document.querySelector('.reason'))"
    )
