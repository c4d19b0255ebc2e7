"""Two people in two browsers, and a script beside them: nobody's work is lost, and who comes second is told."""

import json
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from tests.flows.review.conftest import ServedPage, Tab, let_in
from tests.flows.review.inputs_view import INPUTS, READY, drag, saved

pytestmark = [pytest.mark.long, pytest.mark.slow]

QUESTIONS, LOOP = "#/hemisphere/front/questions", "canvas.loop[data-shown]"
POSES = "#/hemisphere/front/poses"


def asked(served: ServedPage, path: str, body: Any = None) -> Any:
    """What the interface answers; with a body it is sent."""
    headers = served.session | {"Origin": served.origin, "Content-Type": "application/json"}
    data = None if body is None else json.dumps(body).encode()
    address = f"{served.origin}/api/captures/hemisphere/front/{path}"
    with urllib.request.urlopen(urllib.request.Request(address, data=data, headers=headers)) as answer:
        return json.load(answer)


@contextmanager
def two(served: ServedPage, chromium: Any, view: str, ready: str, field: str) -> Iterator[tuple[Tab, Tab]]:
    """Ada's and Bob's browsers, both with the same view open; what it saves is taken back in the end."""
    ada, bob = (let_in(served, chromium) for _ in range(2))
    tabs = next(ada), next(bob)
    try:
        for tab, name in zip(tabs, ("Ada", "Bob"), strict=True):
            tab.open(view, ready)
            tab.page.fill("aside input[autocomplete=name]", name)
            tab.page.focus("main")
        yield tabs
    finally:
        revision = asked(served, "edits")["revision"]
        asked(served, "edits", {"changes": {field: None}, "author": "Ada", "base_revision": revision})
        for tab in tabs:  # a conflict is an answer, which Chromium reports
            expected = ("409", "net::ERR_FAILED")  # the latter: a request that a test let fail
            tab.complaints[:] = [text for text in tab.complaints if not any(part in text for part in expected)]
        for running in (ada, bob):
            next(running, None)


def kinds(served: ServedPage) -> list[str]:
    return [mark["kind"] for mark in asked(served, "edits")["marks"] or []]


def test_answers_of_two_people_and_a_script_are_all_kept(served: ServedPage, chromium: Any) -> None:
    with two(served, chromium, QUESTIONS, LOOP, "marks") as (ada, bob):
        second, third = asked(served, "questions")["questions"][1:3]
        ada.page.keyboard.press("t")
        ada.page.wait_for_selector(".marks-list .true")
        bob.page.keyboard.press("s")
        bob.page.wait_for_selector(f"{LOOP[:-1]}='{second['frame']} {second['x']} {second['y']}']")
        bob.page.keyboard.press("f")
        bob.wait("document.getElementById('status').textContent.includes('Ada has saved marks meanwhile')")
        assert kinds(served) == ["true", "false"]
        # A script saves on top of both; Ada, who has seen neither, goes on.
        edits = asked(served, "edits")
        marks = [*edits["marks"], {name: third[name] for name in ("frame", "x", "y")} | {"kind": "true"}]
        body = {"changes": {"marks": marks}, "author": "script", "base_revision": edits["revision"]}
        assert asked(served, "edits", body)["revision"]
        ada.page.keyboard.press("u")  # her own answer, though others have added theirs since
        ada.wait("document.querySelectorAll('.marks-list li').length === 2")
        assert kinds(served) == ["false", "true"]
        assert [mark["author"] for mark in asked(served, "questions/tracks")["marks"]] == ["Bob", "script"]
        ada.wait("document.querySelector('.marks-list .false').innerText.includes('Bob: frame')")
        authors = {item["author"] for item in asked(served, "edits")["history"]}
        assert {"Ada", "Bob", "script"} <= authors


def test_the_second_of_two_opposite_marks_is_reported_and_its_author_chooses(served: ServedPage, chromium: Any) -> None:
    with two(served, chromium, QUESTIONS, LOOP, "marks") as (ada, bob):
        ada.page.keyboard.press("t")
        ada.page.wait_for_selector(".marks-list .true")
        bob.page.keyboard.press("f")
        bob.page.wait_for_selector(".conflict >> text=Ada calls the highlight")
        assert kinds(served) == ["true"]
        bob.page.click("text=Save mine over it")
        bob.page.wait_for_selector(".marks-list .false")
        assert kinds(served) == ["false"]
        assert [item["author"] for item in asked(served, "edits")["history"]][:2] == ["Bob", "Ada"]


def test_an_answer_older_than_what_was_saved_since_is_not_taken(served: ServedPage, chromium: Any) -> None:
    with two(served, chromium, QUESTIONS, LOOP, "marks") as (ada, bob):
        late = list[tuple[Any, Any]]()
        ada.page.keyboard.press("t")
        ada.page.wait_for_selector(".marks-list .true")
        bob.page.route("**/questions/tracks", lambda route: late.append((route, route.fetch())), times=1)
        bob.page.keyboard.press("f")
        bob.page.wait_for_selector(".conflict >> text=Ada calls the highlight")
        while not late:
            bob.page.wait_for_timeout(50)
        bob.page.click("text=Save mine over it")
        bob.page.wait_for_selector(".marks-list .false")
        (route, answer), *_ = late  # of the time before he saved
        with bob.page.expect_response("**/questions/tracks"):
            route.fulfill(response=answer)
        bob.page.wait_for_timeout(200)
        assert bob.page.locator(".marks-list .true").count() == 0
        bob.page.keyboard.press("s")
        bob.page.keyboard.press("t")
        bob.page.wait_for_selector(".marks-list .true")
        assert kinds(served) == ["false", "true"]
        assert len([text for text in bob.complaints if "409" in text]) == 1


def test_a_choice_stays_until_it_is_saved(served: ServedPage, chromium: Any) -> None:
    with two(served, chromium, QUESTIONS, LOOP, "marks") as (ada, bob):
        ada.page.keyboard.press("t")
        ada.page.wait_for_selector(".marks-list .true")
        bob.page.keyboard.press("f")
        bob.page.wait_for_selector(".conflict >> text=Ada calls the highlight")
        bob.page.route("**/edits", lambda route: route.abort())
        bob.page.click("text=Save mine over it")
        bob.wait("document.getElementById('status').textContent.startsWith('the server does not answer')")
        bob.page.unroute("**/edits")
        bob.page.click("text=Save mine over it")
        bob.page.wait_for_selector(".conflict", state="detached")
        assert kinds(served) == ["false"]


def test_different_inputs_are_both_kept_and_the_same_one_is_a_conflict(served: ServedPage, chromium: Any) -> None:
    (sphere,) = asked(served, "inputs")["used"]["spheres"]
    centre = sphere["x"], sphere["y"]
    with two(served, chromium, INPUTS, READY, "spheres") as (ada, bob):
        revision = asked(served, "edits")["revision"]
        body = {"changes": {"pixel_size": 0.25}, "author": "script", "base_revision": revision}
        assert asked(served, "edits", body)["revision"]
        for tab, shift in ((ada, 2.0), (bob, -3.0)):
            tab.page.keyboard.press("s")
            drag(tab, centre, (centre[0] + shift, centre[1]))
        saved(ada)
        bob.page.click("aside .save button:has-text('Save')")
        bob.page.wait_for_selector(".conflict >> text=Ada changed spheres")
        assert "If you take theirs, yours is lost" in bob.page.inner_text(".conflict")
        edits = asked(served, "edits")
        assert edits["pixel_size"] == 0.25 and edits["spheres"][0]["x"] == pytest.approx(centre[0] + 2.0, abs=0.6)
        bob.page.click("text=Save mine over it")
        bob.wait("document.getElementById('status').textContent === 'Saved.'")
        edits = asked(served, "edits")
        assert edits["pixel_size"] == 0.25 and edits["spheres"][0]["x"] == pytest.approx(centre[0] - 3.0, abs=0.6)
        assert [item["author"] for item in edits["history"]][:3] == ["Bob", "Ada", "script"]
        asked(served, "edits", {"changes": {"pixel_size": None}, "author": "Ada", "base_revision": edits["revision"]})


def test_poses_are_turned_by_mouse_keys_and_numbers_and_conflicts_are_shown(served: ServedPage, chromium: Any) -> None:
    with two(served, chromium, POSES, ".plan .camera", "pose") as (ada, bob):
        for tab, angle in ((ada, 30), (bob, 75)):
            tab.page.select_option("aside select", "turntable")
            tab.page.focus(".plan .camera")
            tab.page.keyboard.press("Shift+ArrowRight")
            tab.page.keyboard.press("ArrowRight")
            tab.wait("document.querySelector('.plan .camera').getAttribute('aria-valuenow') === '11'")
            tab.page.fill("aside tbody input", str(angle))
            tab.page.keyboard.press("Enter")
        ada.page.keyboard.press("Control+s")
        ada.wait("document.getElementById('status').textContent === 'Saved.'")
        assert asked(served, "edits")["pose"]["turntable"] == 30
        bob.page.keyboard.press("Control+s")
        bob.page.wait_for_selector(".conflict >> text=Ada changed its pose")
        assert asked(served, "edits")["pose"]["turntable"] == 30
        bob.page.click("text=Save mine over it")
        bob.wait("document.getElementById('status').textContent === 'Saved.'")
        assert asked(served, "edits")["pose"]["turntable"] == 75
        box = bob.page.locator(".plan .camera rect").bounding_box()
        plan = bob.page.locator(".plan").bounding_box()
        bob.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        bob.page.mouse.down()
        bob.page.mouse.move(plan["x"] + plan["width"] / 2, plan["y"] + plan["height"])  # the front
        bob.page.mouse.up()
        bob.wait("document.querySelector('.plan .camera').getAttribute('aria-valuenow') === '0'")
        bob.page.keyboard.press("Control+z")
        bob.wait("document.querySelector('.plan .camera').getAttribute('aria-valuenow') === '75'")
