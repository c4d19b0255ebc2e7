"""Errors of a run: each names the offending value and the remedy."""

from glint.storage.errors import GlintError, printable
from glint.tasks.engine.errors import UnusableCapture


class RunningError(Exception):
    """Base of the errors of this package: `message` names the offending value, `remedy` says what to do about it."""

    def __init__(self, message: str, remedy: str) -> None:
        self.message, self.remedy = printable(message), printable(remedy)
        super().__init__(f"{self.message}: {self.remedy}")

    def __reduce__(self) -> tuple[type["RunningError"], tuple[str, str]]:
        """Pickle both texts, so that a worker process can raise the error."""
        return type(self), (self.message, self.remedy)


class ServerError(RunningError):
    """The Prefect server does not answer, or could not be started."""


class ClusterError(RunningError):
    """The Dask cluster does not answer, could not be started, or is too small for the work."""


USER_ERRORS = (GlintError, UnusableCapture, RunningError)
"""Errors that name their remedy; any other is an internal error, whose traceback is logged."""

INTERNAL_ERROR = "internal error; see the traceback in the run's log and report it"
"""The remedy for any other error."""


def message_and_remedy(error: Exception) -> tuple[str, str]:
    """Return what is wrong and what to do about it."""
    if isinstance(error, USER_ERRORS):
        return error.message, error.remedy
    return f"{type(error).__name__}: {error}", INTERNAL_ERROR
