"""Rows of the catalogue view in a browser: they open at the first click, and change under the keyboard's hands."""

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
    """The server's rows, to which a test adds some that neither catalogue nor store has; `shown` shows them."""
    monkeypatch.setattr(served.app.state.review.listing, "refresh_names", list)
    known = served.app.state.review.listing._rows
    before = {name: dict(captures) for name, captures in known.items()}
    yield known
    known.clear()
    known.update(before)
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
