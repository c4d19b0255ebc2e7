"""Errors of a run: each names the offending value and the remedy, also when it comes from a worker process."""

import pickle
from collections.abc import Iterator
from contextlib import contextmanager

from glint.storage.errors import GlintError
from glint.tasks.engine.errors import UnusableCapture


class RunningError(GlintError):
    """Base of the errors of this package: what a run needs besides its inputs and its store."""


class ServerError(RunningError):
    """The Prefect server does not answer, or could not be started."""


class ClusterError(RunningError):
    """The Dask cluster does not answer, could not be started, or is too small for the work."""


USER_ERRORS = (GlintError, UnusableCapture)
"""Errors that name their remedy; any other is an internal error, whose traceback is logged."""

INTERNAL_ERROR = "internal error; see the traceback in the run's log and report it"
"""The remedy for any other error."""


MAX_SENT_CHARACTERS = 9000
"""Length of a message from a worker: Dask replaces an error of more than 10,000 characters by another."""


@contextmanager
def sent_from_worker() -> Iterator[None]:
    """Raise errors so that they survive pickling: the causes of many libraries' errors do not, and become text."""
    try:
        yield
    except Exception as error:
        for sent in (error, _with_text_as_cause(error)):
            if _survives(sent):
                raise sent from sent.__cause__
        raise RuntimeError(f"{type(error).__name__}: {str(error)[:MAX_SENT_CHARACTERS]}") from None


def _with_text_as_cause(error: Exception) -> Exception:
    """Return an error of a user without its cause's object, shortened; any other error unchanged."""
    if not isinstance(error, USER_ERRORS):
        return error
    cause, short = error.__cause__, error
    if len(str(error)) > MAX_SENT_CHARACTERS:
        kind = next(kind for kind in (RunningError, GlintError, UnusableCapture) if isinstance(error, kind))
        short = kind(error.message[: MAX_SENT_CHARACTERS // 2] + " ..", error.remedy[: MAX_SENT_CHARACTERS // 3])
    short.__cause__ = None if cause is None else RuntimeError(f"{type(cause).__name__}: {cause}")
    return short.with_traceback(error.__traceback__)


def _survives(error: Exception) -> bool:
    """Return whether an error arrives as it is, with all its causes."""
    causes: list[BaseException] = [error]
    while causes[-1].__cause__ is not None:
        causes.append(causes[-1].__cause__)
    try:
        return len(str(error)) <= MAX_SENT_CHARACTERS and all(
            type(pickle.loads(pickle.dumps(cause))) is type(cause) for cause in causes
        )
    except Exception:
        return False


def message_and_remedy(error: Exception) -> tuple[str, str]:
    """Return what is wrong and what to do about it."""
    if isinstance(error, USER_ERRORS):
        return error.message, error.remedy
    return f"{type(error).__name__}: {error}", INTERNAL_ERROR
