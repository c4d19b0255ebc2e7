"""What is prepared in the background: the capture that is shown now, not those that were left."""

import threading
from typing import Any

import pytest

from glint.flows.review import preparation
from glint.storage.errors import InputError
from tests.polling import PATIENCE, until


def test_of_those_that_wait_the_last_one_is_prepared(monkeypatch: pytest.MonkeyPatch) -> None:
    done, begun, go_on = list[str](), threading.Event(), threading.Event()

    def prepare(context: Any) -> None:
        begun.set()
        go_on.wait(PATIENCE)
        done.append(context)
        if context == "new":
            raise InputError("it has not run yet", "run it")

    monkeypatch.setattr(preparation, "prepare", prepare)
    prepared: Any = preparation.Preparation()
    prepared.show("first")
    assert begun.wait(PATIENCE) and not prepared.is_idle
    prepared.show("left")
    prepared.show("new")
    go_on.set()
    until(lambda: prepared.is_idle)
    assert done == ["first", "new"]
    prepared.show("later")
    until(lambda: done == ["first", "new", "later"])
