"""What running refuses before it starts: every error names the offending value and the remedy."""

from glint.storage.errors import StorageError
from glint.tasks.algorithms.errors import UnusableCapture


class RunningError(Exception):
    """Base of the errors of this package: `message` names the offending value, `remedy` says what to do about it."""

    def __init__(self, message: str, remedy: str) -> None:
        super().__init__(f"{message}: {remedy}")
        self.message = message
        self.remedy = remedy

    def __reduce__(self) -> tuple[type["RunningError"], tuple[str, str]]:
        """Survive the journey back from a worker process with both texts."""
        return type(self), (self.message, self.remedy)


class ServerError(RunningError):
    """The Prefect server does not answer, or could not be started."""


class ClusterError(RunningError):
    """The Dask cluster does not answer, could not be started, or is too small for the work."""


REFUSALS = (StorageError, UnusableCapture, RunningError)
"""Errors that say what is wrong and what to do; any other is a defect, and its trace is logged."""

DEFECT = "this is a defect of Glint; its trace is in the run's log"
"""The remedy for what nobody foresaw."""
