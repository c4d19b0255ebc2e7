"""Rows of one object's captures, read from its newest version, or from its newest work where it has none."""

import os
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from typing import Any

from glint.flows.errors import message_and_remedy
from glint.flows.review.remedies import on_page
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.storage.versions.transaction import repository_folder
from glint.tasks.review.summary import summary_of

REMOTE_SECONDS = 30.0
"""Interval at which an object of an object store is read again: nothing shows cheaply whether it has changed."""


@dataclass(frozen=True)
class Row:
    """A capture as the catalogue view shows it; docs/commands.md explains the states."""

    object: str
    capture: str
    state: str
    verdict: str = ""
    reason: str = ""
    warnings: tuple[str, ...] = ()
    cost_deg: float = 0.0
    confident: float | None = None
    observed: float | None = None
    version: str = ""
    date: str = ""
    stage: str = ""
    progress: float | None = None
    seconds_left: float | None = None
    error: str = ""
    remedy: str = ""

    @property
    def name(self) -> str:
        """OBJECT/CAPTURE."""
        return f"{self.object}/{self.capture}"

    @cached_property
    def text(self) -> str:
        """The text that a search matches, in lower case."""
        return " ".join((self.name, self.verdict, self.reason, self.error, *self.warnings)).lower()

    def to_json(self) -> dict[str, Any]:
        """Return what the view shows as JSON values."""
        names = "object capture state verdict reason warnings confident observed version date stage progress"
        names += " seconds_left error remedy"
        texts = {name: on_page(getattr(self, name)) for name in ("reason", "error", "remedy")}
        warnings = [on_page(warning) for warning in self.warnings]
        return {name: getattr(self, name) for name in names.split()} | texts | {"warnings": warnings}


def object_rows(location: Location, object_id: str) -> list[Row]:
    """Read the rows of an object's captures.

    Raises:
        StoreError: the object cannot be read.
    """
    repository = ObjectRepository.open(location, object_id, create=False)
    names = repository.version_names()
    version = repository.version(names[-1]) if names else None
    published = {} if version is None else version.stages
    rows = []
    for capture in sorted({*repository.captures(), *published} - {WHOLE_OBJECT}):
        is_published = version is not None and capture in published
        records = repository.records(capture, version.snapshot if version is not None and is_published else "work")
        summary = summary_of(records)
        if not is_published:
            state = "waiting"
        elif summary.is_doubtful:
            state = "doubtful"
        else:
            state = "warnings" if summary.warnings else "done"
        rows.append(
            Row(
                object_id,
                capture,
                state,
                verdict=summary.verdict.word if summary.verdict else "",
                reason=summary.verdict.reason if summary.verdict else "",
                warnings=tuple(on_page(warning.message) for warning in summary.warnings),
                cost_deg=max((warning.cost_deg for warning in summary.warnings), default=0.0),
                confident=summary.confident,
                observed=summary.observed,
                version=version.name if version is not None and is_published else "",
                date=version.time.isoformat(timespec="seconds") if version is not None and is_published else "",
                stage="" if is_published else summary.stage,
            )
        )
    return rows


def failed_row(object_id: str, capture: str, error: Exception) -> Row:
    """Return the row of a capture whose results cannot be read."""
    message, remedy = message_and_remedy(error)
    # Rows are sorted by the text of their dates, and those of versions are in UTC.
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return Row(object_id, capture, "failed", error=message, remedy=remedy, date=now)


def object_stamp(location: Location, object_id: str) -> Any:
    """Return another value if results of an object may have changed, without reading them."""
    folder = repository_folder(location, object_id)
    if folder.local is None:
        return int(time.monotonic() // REMOTE_SECONDS)
    try:
        entries = sorted((entry.name, entry.stat().st_mtime_ns) for entry in os.scandir(folder.local))
    except OSError as error:
        return str(error)
    return tuple(entries)
