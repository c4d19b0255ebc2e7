"""The rows of the catalogue view: what the catalogue lists and the store holds, kept up to date in the background.

Reading an object takes milliseconds, so ten thousand are read once; after that only those that changed. A view is
filtered and sorted in memory.
"""

import logging
import math
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from glint.flows.review.object_rows import Row, failed_row, object_rows, object_stamp
from glint.flows.review.run_states import RunStates
from glint.flows.review.runs import Runs
from glint.storage.errors import GlintError
from glint.storage.locations.location import Location
from glint.storage.versions.repository import object_ids
from glint.tasks.engine.references import load_catalogue

LOG = logging.getLogger(__name__)
LISTING_SECONDS = 2.0
"""Seconds from the end of one look at the store to the next."""
RETRY_SECONDS = 30.0
"""Seconds after which an object that could not be read is read again, also where it has not changed."""
REST_SHARE = 1.0
"""Time of rest by time of reading: a server that fills its rows leaves half a processor to the views."""
MAX_PAGE = 500
"""Rows of one answer."""

KEPT_VIEWS = 7
"""Orders and filters whose rows are kept until something changes."""

RANK = {"failed": 0, "doubtful": 1, "running": 2, "waiting": 3, "warnings": 4, "done": 5, "new": 6, "reading": 7}
"""States in the order of the view: what needs a person comes first."""


@dataclass(frozen=True, slots=True)
class View:
    """A part of the rows. total: number of rows that match; counts: of all rows by state; revision: another one if
    anything has changed; complete: whether all objects have been read; problem: why the catalogue cannot be read, empty
    if it can."""

    rows: Sequence[Row]
    total: int
    counts: dict[str, int]
    revision: int
    complete: bool
    problem: str


class Listing:
    """The rows of all captures, by OBJECT/CAPTURE."""

    def __init__(self, location: Location, catalogue: str | None, runs: Runs) -> None:
        self._location, self._catalogue = location, catalogue
        self._states = RunStates(location.uri, runs)
        self._listed: dict[str, list[str]] = {}
        self._rows: dict[str, dict[str, Row]] = {}
        self._stamps: dict[str, Any] = {}
        self._retries: dict[str, float] = {}
        self._views: dict[tuple[str, tuple[str, ...], str], tuple[int, list[Row], dict[str, int]]] = {}
        # Counted from the present on: a page that outlives its server must not take the next one's rows for its own.
        self._revision, self._is_complete, self._problem = int(1000 * time.time()), False, ""
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._keep, name="glint-listing", daemon=True)

    def start(self) -> None:
        """List what the catalogue names, and begin to read the store."""
        with suppress(GlintError, OSError):
            self.refresh_names()
        self._thread.start()
        self._states.start()

    def stop(self) -> None:
        """End the reading."""
        self._ended.set()
        self._states.stop()

    @property
    def revision(self) -> int:
        """A number that grows with every change."""
        return self._revision + self._states.revision

    def view(self, search: str, states: Sequence[str], sort: str, offset: int, limit: int) -> View:
        """Return the rows from `offset` that match.

        search: words that are all in OBJECT/CAPTURE or in the verdict or warnings; states: those to show, empty: all;
        sort: `attention` (what needs a person first), `name`, `date` (newest first) or `confident` (least first).
        """
        self._states.wanted()
        key, revision = (search, tuple(states), sort), self.revision
        known = self._views.get(key)
        if known is None or known[0] != revision:
            known = revision, *self._matching(search.lower().split(), states, sort)
            self._views = dict(list(self._views.items())[-KEPT_VIEWS:]) | {key: known}
        _, matching, counts = known
        shown = matching[offset : offset + min(limit, MAX_PAGE)]
        return View(shown, len(matching), counts, revision, self._is_complete, self._problem)

    def _matching(self, words: Sequence[str], states: Sequence[str], sort: str) -> tuple[list[Row], dict[str, int]]:
        """Return the rows that match in their order, and the number of all rows by state."""
        known = {row.name: row for rows in list(self._rows.values()) for row in list(rows.values())}
        # A capture that failed before it stored anything is in no repository, and perhaps in another catalogue.
        names = [name.partition("/") for name in self._states.names() if name not in known]
        absent = [Row(object_id, capture, "new") for object_id, _, capture in names]
        rows = [self._states.applied(row) for row in (*known.values(), *absent)]
        counts = dict[str, int]()
        for row in rows:
            counts[row.state] = counts.get(row.state, 0) + 1
        matching = [
            row for row in rows if (not states or row.state in states) and all(word in row.text for word in words)
        ]
        matching.sort(key=SORT_KEYS[sort])
        if sort == "date":
            matching.sort(key=lambda row: row.date, reverse=True)
        return matching, counts

    def row(self, object_id: str, capture_id: str) -> Row | None:
        """Return the row of a capture, None where it is not known."""
        self._states.wanted()
        row = self._rows.get(object_id, {}).get(capture_id)
        return None if row is None else self._states.applied(row)

    def refresh_names(self) -> list[str]:
        """Take over the names of all captures that the catalogue lists; return the ids of the objects of the store.

        A catalogue that cannot be read is a `problem` of the views, which keep its captures.

        Raises:
            StoreError, OSError: the store cannot be listed.
        """
        problem = ""
        try:
            objects = () if self._catalogue is None else load_catalogue(self._catalogue).objects
            self._listed = {item.id: [capture.id for capture in item.captures] for item in objects}
        except (GlintError, OSError) as error:
            problem = str(error)
        for object_id, captures in self._listed.items():
            rows = self._rows.setdefault(object_id, {})
            for capture_id in captures:
                if capture_id not in rows:
                    rows[capture_id] = Row(object_id, capture_id, "new")
                    self._revision += 1
        if problem != self._problem:
            self._problem = problem
            self._revision += 1
        stored = object_ids(self._location)
        self._drop_absent(frozenset(stored))
        for object_id in stored:
            if object_id not in self._stamps:
                known = self._rows.setdefault(object_id, {})
                for capture_id, row in known.items():
                    known[capture_id] = replace(row, state="reading")
        return stored

    def _drop_absent(self, stored: frozenset[str]) -> None:
        """Drop the rows of captures that neither the catalogue nor the store has any longer."""
        for object_id, rows in list(self._rows.items()):
            listed = self._listed.get(object_id, ())
            if object_id in stored:
                kept = {
                    name: row for name, row in rows.items() if name in listed or row.state not in ("new", "reading")
                }
            else:
                self._stamps.pop(object_id, None)
                self._retries.pop(object_id, None)
                kept = {name: Row(object_id, name, "new") for name in listed}
            if kept != rows:
                self._rows[object_id] = kept
                self._revision += 1
            if not kept:
                del self._rows[object_id]

    def read_changed(self, stored: Sequence[str]) -> None:
        """Read the objects that have changed since they were read last."""
        for object_id in stored:
            if self._ended.is_set():
                return
            started, stamp = time.monotonic(), object_stamp(self._location, object_id)
            if self._stamps.get(object_id) == stamp and started < self._retries.get(object_id, math.inf):
                continue
            self._retries.pop(object_id, None)
            try:
                rows = object_rows(self._location, object_id)
            except Exception as error:
                # Whatever is wrong with one object must not hide the others; it may pass without a change of the store.
                self._retries[object_id] = started + RETRY_SECONDS
                rows = [failed_row(object_id, capture, error) for capture in self._rows.get(object_id) or ("-",)]
            self._rows[object_id] = {
                capture: Row(object_id, capture, "new") for capture in self._listed.get(object_id, ())
            } | {row.capture: row for row in rows}
            self._stamps[object_id] = stamp
            self._revision += 1
            self._ended.wait(REST_SHARE * (time.monotonic() - started))
        if not self._is_complete:
            self._is_complete = True
            self._revision += 1

    def _keep(self) -> None:
        while not self._ended.is_set():
            try:
                self.read_changed(self.refresh_names())
            except (GlintError, OSError):
                pass  # a store that is absent or does not answer is looked at again
            except Exception:
                LOG.exception("the list of captures could not be refreshed")
            self._ended.wait(LISTING_SECONDS)


SORT_KEYS = {
    "attention": lambda row: (RANK[row.state], -row.cost_deg, row.name),
    "name": lambda row: row.name,
    "date": lambda row: row.name,
    "confident": lambda row: (row.confident is None, row.confident or 0.0, row.name),
}
