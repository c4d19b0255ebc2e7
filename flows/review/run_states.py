"""List the running captures of a store, and those whose last run failed, as Prefect's server knows them.

The server is asked once when the page's server starts, and polled while a view is open. Runs that the page itself has
started need no polling.
"""

import threading
import time
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from typing import Any

from glint.flows.review.object_rows import Row
from glint.flows.review.runs import Runs
from glint.storage.catalogue.models import MODEL

POLLING_SECONDS = 3.0
"""Seconds from one question to the next."""
WANTED_SECONDS = 15.0
"""Seconds for which the server is polled after the last request of a view."""


class RunStates:
    """States of running and failed captures by OBJECT/CAPTURE."""

    def __init__(self, store: str, runs: Runs) -> None:
        self._store, self._runs = store, runs
        self._running: dict[str, dict[str, Any]] = {}
        self._failed: dict[str, dict[str, Any]] = {}
        self._polls, self._asked = 0, -WANTED_SECONDS
        self._is_answer_due = False
        self._ended, self._woken = threading.Event(), threading.Event()

    def start(self) -> None:
        """Begin to ask the server; until it has answered, it is not known which captures are new."""
        self._is_answer_due = True
        threading.Thread(target=self._keep, name="glint-run-states", daemon=True).start()

    def stop(self) -> None:
        """Ask no more."""
        self._ended.set()
        self._woken.set()

    def wanted(self) -> None:
        """Extend the polling of the server, which begins at once where it has rested."""
        has_rested = not self._is_wanted()
        self._asked = time.monotonic()
        if has_rested:
            self._woken.set()

    @property
    def revision(self) -> int:
        """A number that grows with every change."""
        return self._polls + self._runs.revision

    def names(self) -> list[str]:
        """Return the captures that run, or whose last run failed."""
        names = sorted({*self._running, *self._failed})
        return [name for name in names if not name.endswith(f"/{MODEL}")]

    def applied(self, row: Row) -> Row:
        """Return the row with what is going on, or how its last run failed."""
        own = self._runs.of(row.name)
        if own is not None and own.state == "running":
            return replace(row, state="running", stage=own.stage, progress=own.share, seconds_left=own.seconds_left)
        begin, end = ("", "") if own is None else (_iso(own.started), _iso(own.ended))
        running = self._running.get(row.name)
        # The server may not know yet that the page's own run has ended.
        if running is not None and not (_is_later(running["since"], begin) and _is_later(end, running["since"])):
            share = running["progress"]
            left = _seconds_left(share, running["since"])
            return replace(row, state="running", stage=running["stage"], progress=share, seconds_left=left)
        failed = self._failed.get(row.name)
        if failed is not None and not any(_is_later(date, failed["ended"]) for date in (row.date, end)):
            return replace(row, state="failed", stage=failed["stage"], error=failed["error"])
        if own is not None and own.state == "failed" and not _is_later(row.date, end):
            return replace(row, state="failed", error=own.error, remedy=own.remedy)
        return replace(row, state="reading") if self._is_answer_due and row.state == "new" else row

    def _is_wanted(self) -> bool:
        return time.monotonic() - self._asked < WANTED_SECONDS

    def _keep(self) -> None:
        while not self._ended.is_set():
            if self._is_answer_due or self._is_wanted():
                with suppress(Exception):
                    # A server that is starting, ending or absent is polled again.
                    self._ask()
                if self._is_answer_due:
                    self._is_answer_due = False
                    self._polls += 1
            self._woken.wait(POLLING_SECONDS)
            self._woken.clear()

    def _ask(self) -> None:
        from glint.flows.reporting.flow_runs import failed_rows, running_rows
        from glint.flows.runtime.prefect_server import running_server

        server = running_server()
        running, failed = dict[str, dict[str, Any]](), dict[str, dict[str, Any]]()
        if server is not None:
            with server.reached():
                for item in running_rows(self._store):
                    if item["type"] == "capture":
                        percent = item["progress"].removesuffix("%")
                        running[item["running"]] = item | {"progress": float(percent) / 100 if percent else None}
                failed = {item["capture"]: item for item in failed_rows(self._store)}
        if (running, failed) != (self._running, self._failed):
            self._running, self._failed = running, failed
            self._polls += 1


def _seconds_left(share: float | None, since: str) -> float | None:
    """Return the seconds that a run on the server has left.

    share: part of its time that had passed when the run reported it last; since: ISO date of its begin.
    """
    if not share or not since:
        return None
    begin = datetime.fromisoformat(since)
    return round((datetime.now(begin.tzinfo) - begin).total_seconds() * (1.0 / share - 1.0), 1)


def _iso(seconds: float | None) -> str:
    """Return seconds since the epoch as an ISO date, None as an empty text."""
    return "" if seconds is None else datetime.fromtimestamp(seconds).astimezone().isoformat()


def _is_later(date: str, other_date: str) -> bool:
    """Return whether the first of two ISO dates, which may be empty, is the later one."""
    if not date or not other_date:
        return bool(date)
    return datetime.fromisoformat(date) > datetime.fromisoformat(other_date)
