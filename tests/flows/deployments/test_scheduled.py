"""Tables that deployments put on the dashboard, which renders their cells as markdown."""

import os
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from markdown_it import MarkdownIt

from glint.flows.deployments import maintenance, scheduled
from glint.storage.inbox import Inbox
from glint.storage.locations.location import Location
from glint.storage.maintenance.maintain import Cleaning, Maintenance

NAMES = ("[click](https:evil.example)", "<b>bold", "![](evil)", "~~gone~~ *a*", os.fsdecode(b"gr\xfcn"))


@pytest.fixture
def tables(monkeypatch: pytest.MonkeyPatch) -> list[list[dict[str, Any]]]:
    """The tables that are made, instead of being sent to the dashboard."""
    made: list[list[dict[str, Any]]] = []
    for module in (scheduled, maintenance):
        monkeypatch.setattr(module, "create_table_artifact", lambda table, **_: made.append(table))
    return made


def shown(cell: str) -> str:
    """A cell as the dashboard renders it."""
    return MarkdownIt("commonmark").enable("strikethrough").renderInline(cell)


def test_names_and_errors_of_an_inbox_are_shown_as_they_are(tmp_path: Path, tables: list[Any]) -> None:
    for name in NAMES:
        (tmp_path / "inbox" / name).mkdir(parents=True)
        (tmp_path / "inbox" / name / "notes.txt").write_text("x")
    (tmp_path / "inbox" / "![](evil)" / "catalogue.yaml").write_text("schema: 1\nobjects:\n- '**bold** [a](b)'\n")
    scan = Inbox(str(tmp_path / "inbox"), str(tmp_path / "store")).scan(timedelta(0))
    scheduled._create_scan_artifact("inbox", scan, dict(scan.problems))
    (table,) = tables
    assert len(table) == len(NAMES)
    cells = [shown(cell) for row in table for cell in row.values()]
    assert {"[click](https:evil.example)", "&lt;b&gt;bold", "![](evil)", "~~gone~~ *a*", r"gr\udcfcn"} <= set(cells)
    assert any("**bold** [a](b)" in cell for cell in cells) and not any("<" in cell for cell in cells)


def test_notes_of_maintenance_are_shown_as_they_are(
    tmp_path: Path, tables: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    note = "opening it failed at /data/<b>*a* (denied)"
    done = Maintenance("store", dry_run=True, cleanings=(Cleaning("a_b_c", 0, 0, note, failed=True),))
    monkeypatch.setattr(maintenance, "maintain", lambda *_, **__: done)
    maintenance.run_maintenance.fn(Location.parse(tmp_path).uri)
    ((row,),) = tables
    assert shown(row["note"]) == "opening it failed at /data/&lt;b&gt;*a* (denied)"
    assert shown(row["target"]) == "a_b_c"
