"""What commands print at the end: tables for people, the same facts as JSON."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from glint.storage.locations.location import Location
from glint.storage.locking.locks import run_holder
from glint.storage.versions.objects import object_ids
from glint.storage.versions.repository import ObjectRepository

if TYPE_CHECKING:
    from glint.flows.pipeline.run import Summary
    from glint.flows.results import CaptureResult

WIDE = 200
"""Columns of a table that goes to a file or a pipe."""


def show(table: Table | str) -> None:
    """Print a table on standard output."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=WIDE)
    console.print(table)


def table_of(rows: Sequence[dict[str, Any]], empty: str) -> Table | str:
    """Rows with equal keys as a table; `empty` where there are none."""
    if not rows:
        return empty
    table = Table(box=None, header_style="bold", pad_edge=False)
    for name, value in rows[0].items():
        table.add_column(name, justify="right" if isinstance(value, int | float) else "left", overflow="fold")
    for row in rows:
        table.add_row(*(_text(value) for value in row.values()))
    return table


def run_table(summary: "Summary") -> Table | str:
    """One row for each capture of a run."""
    return table_of(run_rows(summary), "the catalogue chose no capture")


def run_rows(summary: "Summary") -> list[dict[str, Any]]:
    """What people want to know of each capture: what was seen of it, how sure the normals are, how long it took."""
    rows = []
    for each in summary.result.objects:
        for one in each.captures:
            rows.append(
                {
                    "capture": one.name,
                    "result": "failed" if one.error else "unchanged" if one.cached else "done",
                    "version": "" if each.version is None else each.version.name,
                    "frames": _count(one, "frames", "frames"),
                    "lights": _count(one, "lights", "accepted"),
                    "observed": _share(one, "labels", "observed pixels"),
                    "confident": _percent(one.count("labels", "confident share")),
                    "warnings": len(one.warnings),
                    "seconds": round(one.seconds, 1),
                }
            )
    return rows


def summary_json(summary: "Summary") -> dict[str, Any]:
    """The run as JSON: its rows with errors and warnings, its page."""
    rows = [
        row | {"error": one.error, "remedy": one.remedy, "messages": one.warnings}
        for row, one in zip(run_rows(summary), summary.result.captures, strict=True)
    ]
    drifts = [asdict(each) for each in summary.result.drifts]
    return {"kind": "summary", "run": summary.result.run, "page": summary.page, "captures": rows, "drifts": drifts}


def status_rows(store: str) -> list[dict[str, Any]]:
    """One row for each object of a store."""
    location = Location.parse(store)
    rows = []
    for object_id in object_ids(location):
        history = ObjectRepository.open(location, object_id, create=False).history()
        holder = run_holder(location, object_id)
        newest = history[-1] if history else None
        rows.append(
            {
                "object": object_id,
                "version": newest.name if newest else "",
                "captures": len(newest.stages) if newest else 0,
                "published": newest.time.isoformat(timespec="seconds") if newest else "",
                "state": "idle" if holder is None else f"running ({holder})",
            }
        )
    return rows


def history_rows(store: str, object_id: str) -> list[dict[str, Any]]:
    """One row for each version of an object."""
    repository = ObjectRepository.open(Location.parse(store), object_id, create=False)
    return [
        {
            "version": each.name,
            "published": each.time.isoformat(timespec="seconds"),
            "captures": ", ".join(each.stages),
            "glint": each.metadata.get("glint", ""),
            "message": each.message,
        }
        for each in repository.history()
    ]


def _count(result: "CaptureResult", stage: str, name: str) -> int | str:
    value = result.count(stage, name)
    return "" if value is None else int(value)


def _share(result: "CaptureResult", stage: str, name: str) -> str:
    value, pixels = result.count(stage, name), result.count("mask", "object pixels")
    return _percent(value / pixels if value is not None and pixels else None)


def _percent(share: float | None) -> str:
    return "" if share is None else f"{share:.0%}"


def _text(value: Any) -> str:
    return f"{value:,}" if isinstance(value, int) and not isinstance(value, bool) else str(value)
