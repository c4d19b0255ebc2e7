"""Errors on their way from a Dask worker: kind, message and remedy arrive, whatever their cause is."""

from typing import Any

import pytest
from distributed.core import clean_exception, error_message

from glint.flows.errors import INTERNAL_ERROR, ClusterError, message_and_remedy, sent_from_worker
from glint.storage.catalogue.diagnostics import Diagnostic
from glint.storage.catalogue.loading import CatalogueError
from glint.storage.errors import InputError, StoreError, StoreUnreachable
from glint.tasks.engine.errors import UnusableCapture


class TwoArguments(Exception):
    """As libraries have them: pickling calls it with one argument."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(f"{code} {text}")


class Unpicklable(Exception):
    """Holds what no process can send."""

    def __init__(self) -> None:
        super().__init__("lock")
        self.call = lambda: None


def arrived(error: Exception, cause: BaseException | None) -> Any:
    """What a worker's error is in the flow's process."""

    @sent_from_worker()
    def work() -> None:
        raise error from cause

    try:
        work()
    except Exception as sent:
        message = error_message(sent)
        _, received, _ = clean_exception(message["exception"].data, None)
        return received


@pytest.mark.parametrize("cause", [None, ValueError("x"), TwoArguments(5, "gone"), Unpicklable()])
@pytest.mark.parametrize("kind", [InputError, StoreError, StoreUnreachable, UnusableCapture, ClusterError])
def test_errors_of_users_arrive(kind: type[Exception], cause: BaseException | None) -> None:
    received = arrived(kind("front.mp4 is damaged", "copy it again"), cause)
    assert type(received) is kind
    assert message_and_remedy(received) == ("front.mp4 is damaged", "copy it again")


def test_a_cause_of_a_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    cause = ValueError("x")
    cause.__cause__ = TwoArguments(5, "gone")
    assert message_and_remedy(arrived(StoreError("it is damaged", "restore it"), cause))[1] == "restore it"


def test_long_errors_keep_their_remedy() -> None:
    message, remedy = message_and_remedy(arrived(StoreError("x" * 50_000, "restore it"), TwoArguments(5, "gone")))
    assert message.startswith("xxx") and len(message) < 5000 and remedy == "restore it"
    diagnostics = tuple(Diagnostic("c.yaml", line, "this is wrong", "correct it") for line in range(2000))
    message, remedy = message_and_remedy(arrived(CatalogueError(diagnostics), None))
    assert message.startswith("c.yaml:0: this is wrong") and remedy == "fix the catalogue and run again"


@pytest.mark.parametrize("error", [TwoArguments(5, "gone"), Unpicklable(), ZeroDivisionError("division by zero")])
def test_internal_errors_are_named(error: Exception) -> None:
    message, remedy = message_and_remedy(arrived(error, None))
    assert type(error).__name__ in message and str(error) in message and remedy == INTERNAL_ERROR
