"""Tables that commands print at the end, and their rows as JSON."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from glint.flows.errors import message_and_remedy
from glint.storage.edits.edits import Edits
from glint.storage.errors import printable
from glint.storage.locations.location import Location
from glint.storage.locking.locks import run_owner
from glint.storage.versions.repository import ObjectRepository, object_ids

if TYPE_CHECKING:
    from glint.flows.pipeline.run import Summary
    from glint.flows.results import CaptureResult

PIPE_WIDTH = 200
"""Columns of a table that is written to a file or a pipe."""


def show(table: Table | str) -> None:
    """Print a table, or the sentence in place of an empty one, on standard output."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=PIPE_WIDTH)
    console.print(_text(table) if isinstance(table, str) else table)


def table_of(rows: Sequence[dict[str, Any]], empty: str) -> Table | str:
    """Lay out rows with equal keys as a table; return `empty` if there are none."""
    if not rows:
        return empty
    table = Table(box=None, header_style="bold", pad_edge=False)
    for name, value in rows[0].items():
        table.add_column(name, justify="right" if isinstance(value, int | float) else "left", overflow="fold")
    for row in rows:
        table.add_row(*(_text(value) for value in row.values()))
    return table


def run_table(summary: "Summary") -> Table | str:
    """Lay out one row for each capture of a run."""
    rows = run_rows(summary)
    for row in rows:
        row |= {name: "" if row[name] is None else f"{row[name]:.0%}" for name in ("observed", "confident")}
        row |= {name: "" if row[name] is None else row[name] for name in ("version", "frames", "lights")}
    return table_of(rows, "no capture was chosen")


def run_rows(summary: "Summary") -> list[dict[str, Any]]:
    """Return one row for each capture: its result, how much was observed and is confident, and the seconds it took.

    Shares are from 0 to 1; what is not known is None.
    """
    return [
        {
            "capture": capture.name,
            "result": capture.outcome,
            "version": None if item.version is None or capture.error else item.version.name,
            "frames": _count(capture, "frames", "frames"),
            "lights": _count(capture, "lights", "accepted"),
            "observed": _share(capture, "labels", "observed pixels"),
            "confident": _rounded(capture.count("labels", "confident share")),
            "warnings": len(capture.warnings),
            "seconds": round(capture.seconds, 1),
        }
        for item in summary.result.objects
        for capture in item.captures
    ]


def summary_json(summary: "Summary") -> dict[str, Any]:
    """Return the run as JSON: its rows with errors and warnings, its page on the dashboard."""
    rows = [
        row | {"error": capture.error, "remedy": capture.remedy, "messages": capture.warnings}
        for row, capture in zip(run_rows(summary), summary.result.captures, strict=True)
    ]
    drifts = [
        {
            "capture": f"{item.object_id}/{item.capture_id}",
            "degrees": item.degrees,
            "before": item.before,
            "after": item.after,
        }
        for item in summary.result.drifts
    ]
    return {"kind": "summary", "run": summary.result.run, "page": summary.page, "captures": rows, "drifts": drifts}


def status_rows(store: str) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return one row for each object of a store, and the errors of those that cannot be read."""
    location = Location.parse(store)
    rows, damaged = list[dict[str, Any]](), list[dict[str, Any]]()
    for object_id in object_ids(location):
        try:
            row = _object_row(location, object_id)
        except Exception as error:
            # Whatever is wrong with one object must not hide the others.
            message, remedy = message_and_remedy(error)
            damaged.append({"object": object_id, "error": message, "remedy": remedy})
            row = {"object": object_id, "version": "", "captures": 0, "published": "", "state": "unreadable"}
        rows.append(row)
    return rows, damaged


def _object_row(location: Location, object_id: str) -> dict[str, Any]:
    history = ObjectRepository.open(location, object_id, create=False).history()
    holder = run_owner(location, object_id)
    newest = history[-1] if history else None
    return {
        "object": object_id,
        "version": newest.name if newest else "",
        "captures": len(newest.captures) if newest else 0,
        "published": newest.time.isoformat(timespec="seconds") if newest else "",
        "state": "idle" if holder is None else f"running ({holder})",
    }


def history_rows(store: str, object_id: str) -> list[dict[str, Any]]:
    """Return one row for each version of an object and each edit of its inputs, in the order of their times."""
    repository = ObjectRepository.open(Location.parse(store), object_id, create=False)
    rows = [
        {
            "version": version.name,
            "published": version.time.isoformat(timespec="seconds"),
            "captures": ", ".join(version.captures),
            "author": "",
            "glint": version.metadata.get("glint", ""),
            "catalogue": version.metadata.get("catalogue", ""),
            "message": version.message,
        }
        for version in repository.history()
    ]
    rows += [
        {
            "version": f"edit {revision.number}",
            "published": revision.time.isoformat(timespec="seconds"),
            "captures": revision.capture,
            "author": revision.author,
            "glint": "",
            "catalogue": "",
            "message": revision.sentence,
        }
        for revision in Edits(repository).history()
    ]
    return sorted(rows, key=lambda row: str(row["published"]))


def _count(result: "CaptureResult", stage: str, name: str) -> int | None:
    value = result.count(stage, name)
    return None if value is None else int(value)


def _share(result: "CaptureResult", stage: str, name: str) -> float | None:
    value, pixels = result.count(stage, name), result.count("mask", "object pixels")
    return _rounded(value / pixels if value is not None and pixels else None)


def _rounded(share: float | None) -> float | None:
    return None if share is None else round(share, 4)


def _text(value: Any) -> Text:
    """Return a cell: text is shown as it is, without rich's markup and without what a terminal would obey."""
    text = f"{value:,}" if isinstance(value, int) and not isinstance(value, bool) else str(value)
    return Text(printable(text, keep="\n"))
