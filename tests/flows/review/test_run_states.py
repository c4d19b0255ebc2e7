"""States of runs that Prefect's server knows: asked for when the page's server starts, and as soon as a view opens."""

import threading
from dataclasses import replace

import pytest

from glint.flows.review import run_states
from glint.flows.review.object_rows import Row
from glint.flows.review.run_states import RunStates
from glint.flows.review.runs import Runs
from tests.polling import until

FAILURE = {"stage": "survey", "error": "no sphere", "ended": "2026-01-03 00:00:00+00:00"}


class HeldStates(RunStates):
    """States whose server answers when it is let, each time that one of its captures has failed."""

    def __init__(self) -> None:
        super().__init__("/absent", Runs("/absent"))
        self.answer, self.questions = threading.Event(), 0

    def _ask(self) -> None:
        self.questions += 1
        self.answer.wait()
        self._failed = {"glass/front": FAILURE}


def test_a_capture_passes_for_new_only_when_it_is_known_that_it_has_not_failed() -> None:
    failed, new, done = Row("glass", "front", "new"), Row("glass", "back", "new"), Row("bowl", "front", "done")
    states = HeldStates()
    states.start()
    try:
        until(lambda: states.questions == 1)
        revision = states.revision
        assert states.applied(failed) == replace(failed, state="reading")
        assert states.applied(done) is done
        states.answer.set()
        until(lambda: states.applied(failed).state == "failed")
        until(lambda: states.applied(new) is new)
        assert states.revision > revision, "views that have the rows already are told"
    finally:
        states.answer.set()
        states.stop()


def test_the_server_is_asked_as_soon_as_a_view_opens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_states, "POLLING_SECONDS", 3600.0)
    states = HeldStates()
    states.answer.set()
    states.start()
    try:
        until(lambda: states.questions == 1)
        states.wanted()
        until(lambda: states.questions == 2)
    finally:
        states.stop()
