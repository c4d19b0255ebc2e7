"""Where Glint keeps what belongs to no store, and the settings that libraries read from the environment.

Prefect, numba and OpenMP read theirs once, at import; so `prepare_environment` comes before any of them is imported.
"""

import os
from pathlib import Path

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
"""One thread per process: the workers are as many as the processors."""

_PREFECT = {
    "DO_NOT_TRACK": "1",
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "PREFECT_SERVER_EPHEMERAL_ENABLED": "false",
    # The console is for progress and for what went wrong in a sentence; the dashboard has every line and trace.
    "PREFECT_LOGGING_HANDLERS_CONSOLE_LEVEL": "CRITICAL",
    "PREFECT_LOGGING_INTERNAL_LEVEL": "CRITICAL",
    "PREFECT_LOGGING_TO_API_WHEN_MISSING_FLOW": "ignore",
}


def glint_home() -> Path:
    """The folder of the embedded server: $GLINT_HOME, else ~/.glint."""
    return Path(os.environ.get("GLINT_HOME") or Path.home() / ".glint").absolute()


def prepare_environment(api_url: str | None = None, prefect_home: Path | None = None) -> None:
    """Set what the libraries read at import, in this process and for its workers; what the user has set stays.

    `api_url` and `prefect_home` are the embedded server's, and are set in any case.
    """
    for name, value in (ONE_THREAD | _PREFECT).items():
        os.environ.setdefault(name, value)
    if api_url is not None:
        os.environ["PREFECT_API_URL"] = api_url
    if prefect_home is not None:
        os.environ["PREFECT_HOME"] = str(prefect_home)
