"""Runs that a person stops from the page: what they end as, and what the page shows."""

import signal
import sys
import threading
from typing import Any

import pytest

from glint.flows.review.runs import Run, Runs
from tests.flows.review.conftest import Tab
from tests.flows.review.inputs_view import INPUTS, READY, settle
from tests.polling import until

SLEEP = [sys.executable, "-c", "import time; time.sleep(120)"]
DONE = [sys.executable, "-c", ""]


def followed(runs: Runs, command: list[str]) -> tuple[Run, threading.Thread]:
    """Follow the process of a command as the run of glass/front."""
    run = runs._runs["glass/front"] = Run("glass/front")
    thread = threading.Thread(target=runs._follow, args=(run, command), daemon=True)
    thread.start()
    return run, thread


def test_a_run_is_interrupted_and_says_that_it_was_stopped() -> None:
    runs = Runs("store")
    run, thread = followed(runs, SLEEP)
    until(lambda: "glass/front" in runs._processes)
    process = runs._processes["glass/front"]
    assert runs.stop("glass/front") is run and run.is_stopping
    thread.join(60)
    told = run.to_json()
    assert (told["state"], told["error"], told["remedy"]) == ("stopped", "", "")
    assert process.returncode not in (None, 0) and not runs._processes


def test_a_run_that_is_stopped_before_its_process_has_begun_does_not_go_on() -> None:
    runs, run = Runs("store"), Run("glass/front", is_stopping=True)
    runs._follow(run, SLEEP)
    assert run.state == "stopped"


def test_a_run_is_stopped_where_the_server_ignores_interrupts_as_one_in_the_background_does() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        run = Run("glass/front", is_stopping=True)
        Runs("store")._follow(run, [sys.executable, "-c", "import time; time.sleep(20)"])
    finally:
        signal.signal(signal.SIGINT, before)
    assert run.state == "stopped"


def test_a_run_that_has_ended_cannot_be_stopped() -> None:
    runs = Runs("store")
    assert runs.stop("glass/front") is None
    run, thread = followed(runs, DONE)
    thread.join(60)
    assert runs.stop("glass/front") is run
    assert (run.state, run.is_stopping) == ("done", False)


def test_a_run_that_ends_leaves_the_process_of_the_next_one_to_be_stopped() -> None:
    runs = Runs("store")
    _, thread = followed(runs, SLEEP)
    until(lambda: "glass/front" in runs._processes)
    first = runs._processes["glass/front"]
    run, next_thread = followed(runs, SLEEP)
    until(lambda: runs._processes["glass/front"] is not first)
    first.terminate()
    thread.join(60)
    runs.stop("glass/front")
    next_thread.join(60)
    assert run.state == "stopped"


def test_a_run_that_is_done_before_it_stops_is_done() -> None:
    run = Run("glass/front", is_stopping=True)
    run.end("done")
    assert run.state == "done"


@pytest.mark.long
def test_the_page_says_why_it_cannot_follow_a_run(tab: Tab) -> None:
    """A server that refuses is none that has ended."""
    run: dict[str, Any] = {"state": "running", "stage": "labels", "stages": {}, "seconds": 70.0, "total": None}
    run |= {"seconds_left": None, "is_stopping": False}
    answers = [lambda route: route.fulfill(json=run), lambda route: route.fulfill(status=401, json={})]
    answers.append(lambda route: route.abort())
    tab.page.route("**/front/run", lambda route: answers[0](route))
    page = tab.open(INPUTS, READY)
    page.wait_for_selector("aside .run >> text=labels · for 70 s")
    for text in ("this browser is not let in any longer", "The server does not answer."):
        answers.pop(0)
        page.wait_for_selector(f"aside .run >> text={text}")
    page.unroute("**/front/run")
    settle(tab)
    tab.complaints[:] = [text for text in tab.complaints if "401" not in text and "ERR_FAILED" not in text]


@pytest.mark.long
def test_the_page_stops_a_run_and_another_can_be_started(tab: Tab) -> None:
    run: dict[str, Any] = {"state": "running", "stage": "labels", "stages": {}, "seconds": 70.0, "total": None}
    run |= {"seconds_left": None, "is_stopping": False, "error": "", "remedy": "", "version": ""}
    methods = list[str]()

    def answer(route: Any) -> None:
        methods.append(route.request.method)
        if route.request.method == "DELETE":
            run["is_stopping"] = True
        route.fulfill(json=run)

    tab.page.route("**/front/run", answer)
    page = tab.open(INPUTS, READY)
    page.click("aside .run button:has-text('Stop')")
    page.wait_for_selector("aside .run >> text=stopping · for 70 s")
    assert page.is_disabled("aside .run button:has-text('Stop')") and methods.count("DELETE") == 1
    run["state"] = "stopped"
    page.wait_for_selector("aside .run >> text=stopped: what is finished is kept")
    assert page.is_hidden("aside .run button:has-text('Stop')")
    assert page.is_enabled("aside .run button:has-text('Run from here')")
    settle(tab)
