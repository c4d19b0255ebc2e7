"""Marks set freely: a click means the highlight that lies there, and is refused in words where none does."""

import json
import urllib.error
import urllib.request
from typing import Any

import pytest

from tests.flows.review.conftest import ServedPage, Tab
from tests.flows.review.inputs_view import drag, place

pytestmark = [pytest.mark.long, pytest.mark.slow]

CAPTURE = "/api/captures/hemisphere/front"
VIEW, READY = "#/hemisphere/front/questions", ".free-stage .stage[data-shown]"
SHOWN = "document.querySelector('.question').textContent"


def asked(served: ServedPage, path: str, body: Any = None) -> tuple[int, Any]:
    """Status and answer of the interface; with a body it is sent."""
    headers = served.session | {"Origin": served.origin, "Content-Type": "application/json"}
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(f"{served.origin}{CAPTURE}/{path}", data=data, headers=headers)
    try:
        with urllib.request.urlopen(request) as answer:
            return answer.status, json.load(answer)
    except urllib.error.HTTPError as error:
        return error.code, json.load(error)


def meant(served: ServedPage, points: list[tuple[int, int]], frame: int | None = None) -> tuple[int, Any]:
    """What a click or a line means."""
    return asked(served, "questions/highlights", {"frame": frame, "points": points})


def save(served: ServedPage, marks: list[dict[str, Any]]) -> None:
    """Save these marks as the only ones."""
    revision = asked(served, "edits")[1]["revision"]
    body = {"changes": {"marks": marks}, "author": "Ada", "base_revision": revision}
    assert asked(served, "edits", body)[0] == 200


@pytest.fixture(scope="module")
def middle(served: ServedPage) -> tuple[int, int]:
    """The pixel in the middle of the region, and so of the hemisphere."""
    region = asked(served, "inputs")[1]["used"]["region"]
    return region["x"] + region["width"] // 2, region["y"] + region["height"] // 2


def test_a_click_means_the_highlight_near_it_in_the_frame_and_in_all_frames(
    served: ServedPage, middle: tuple[int, int]
) -> None:
    status, answer = meant(served, [middle])
    assert status == 200 and answer["choices"]
    for choice in answer["choices"]:
        (highlight,) = choice["highlights"]
        assert np_distance(highlight, middle) <= 12 and choice["sheet"]
        assert choice["refused"] == {"true": None, "false": None}
        assert [frame for frame, *_ in highlight["track"]] == sorted({frame for frame, *_ in highlight["track"]})
        # The same highlight is meant by a click some pixels beside it in its own frame.
        beside = (highlight["x"] + 3, highlight["y"])
        (again,) = meant(served, [beside], highlight["frame"])[1]["choices"][0]["highlights"]
        assert np_distance(again, (highlight["x"], highlight["y"])) <= 12 and again["frame"] == highlight["frame"]


def np_distance(highlight: dict[str, Any], pixel: tuple[int, int]) -> float:
    """Pixels from a highlight to a pixel."""
    return float(((highlight["x"] - pixel[0]) ** 2 + (highlight["y"] - pixel[1]) ** 2) ** 0.5)


def test_where_no_highlight_is_the_reason_names_the_nearest_one(served: ServedPage, middle: tuple[int, int]) -> None:
    region = asked(served, "inputs")[1]["used"]["region"]
    corner = (region["x"], region["y"])
    status, refused = meant(served, [corner])
    assert status == 422 and f"x {corner[0]}, y {corner[1]}" in refused["error"]
    assert "pixels away, at x" in refused["error"] and "outside the mask" in refused["error"]
    assert refused["remedy"].startswith("click there")
    highlight = meant(served, [middle])[1]["choices"][0]["highlights"][0]
    status, refused = meant(served, [corner], highlight["frame"])
    assert status == 422 and f"in frame {highlight['frame']:,}" in refused["error"]
    assert meant(served, [middle], 1_000_000)[0] == 422
    assert meant(served, [(0, 0)])[1]["error"].endswith("lies outside the region")


def test_marks_that_contradict_others_are_refused(served: ServedPage, middle: tuple[int, int]) -> None:
    choices = meant(served, [middle])[1]["choices"]
    mark = {name: choices[0]["highlights"][0][name] for name in ("frame", "x", "y")}
    save(served, [mark | {"kind": "true"}])
    try:
        refused = meant(served, [middle])[1]["choices"][0]["refused"]
        assert "marked as true already" in refused["true"]
        assert "calls true: remove that mark first" in refused["false"]
        (tracked,) = asked(served, "questions/tracks")[1]["marks"]
        centre = next((x, y) for frame, x, y in tracked["track"] if frame == mark["frame"])
        assert tracked["kind"] == "true" and np_distance(mark, centre) < 2
        if len(choices) > 1:  # another candidate of the same pixel is another normal
            second = meant(served, [middle])[1]["choices"][1]["refused"]
            assert "two normals" in second["true"] and second["false"] is None
    finally:
        save(served, [])


def test_a_line_marks_the_sheet_under_it(served: ServedPage, middle: tuple[int, int]) -> None:
    line = [(middle[0] - 12 + step, middle[1]) for step in range(30)]
    (choice,) = meant(served, line)[1]["choices"]
    assert 2 <= len(choice["highlights"]) <= 6
    assert all(abs(item["y"] - middle[1]) <= 1 for item in choice["highlights"])


def test_a_person_marks_by_mouse_and_by_keyboard_sees_the_track_and_the_refusal(
    served: ServedPage, tab: Tab, middle: tuple[int, int]
) -> None:
    page = tab.open(VIEW, ".question-stage")
    page.fill("input[autocomplete=name]", "Ada")
    page.focus("main")
    page.keyboard.press("p")
    page.wait_for_selector(READY)
    page.mouse.click(*place(tab, *middle))
    tab.wait(f"{SHOWN}.startsWith('Highlight at')")
    page.keyboard.press("t")
    page.wait_for_selector(".marks-list .true")
    tab.wait("document.querySelector('aside').innerText.includes('followed through')")
    (mark,) = asked(served, "edits")[1]["marks"]
    assert mark["kind"] == "true"
    lines = "globalThis.Konva.stages.at(-1).find('Line, Circle, Path').filter((shape) => shape.isVisible()).length"
    tab.wait(f"{lines} >= 1")
    page.mouse.click(*place(tab, *middle))
    tab.wait(f"{SHOWN}.startsWith('Highlight at')")
    page.keyboard.press("f")
    tab.wait(f"{SHOWN}.startsWith('Refused: ')")
    page.mouse.click(*place(tab, 1, 1))
    tab.wait("document.querySelector('.question').classList.contains('refused')")
    page.keyboard.press("Escape")
    page.keyboard.press("u")
    tab.wait("document.querySelector('.marks-list').innerText.includes('None yet')")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    tab.wait("document.querySelector('.question').textContent.length > 20")
    drag(tab, (middle[0] - 15, middle[1]), (middle[0] + 15, middle[1] + 1))
    tab.wait(f"{SHOWN}.includes('highlights under the line')")
    page.keyboard.press("f")
    tab.wait("document.querySelectorAll('.marks-list .false').length > 1")
    count = page.locator(".marks-list .false").count()
    page.click(".marks-list li:first-child button[title=Remove]")
    tab.wait(f"document.querySelectorAll('.marks-list .false').length === {count - 1}")
    save(served, [])
    tab.complaints[:] = [text for text in tab.complaints if "422" not in text]  # the refusal is the answer
