"""Names and values of other people reach the terminal escaped, by every way."""

import io
import json
import pickle
import re
from pathlib import Path

import pytest
from rich.console import Console

from glint.flows.cli.output import echo
from glint.flows.cli.tables import show, table_of
from glint.flows.errors import ServerError
from glint.flows.reporting.console import JsonLines, PlainLines
from glint.flows.reporting.events import CaptureWarning, Message
from glint.flows.reporting.progress_bars import ProgressBars
from glint.storage.errors import InputError, printable

CLI = Path(__file__).parents[3] / "flows" / "cli"
HOSTILE = "a\x1b[2Jb\x9b31mc\u202egnp.exe\u2066d\x7fe\rf\u2028g\udcff\U000e0041"
OBEYED = re.compile(
    "[\x00-\x09\x0b-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\U000e0000-\U000e0fff]"
)


def test_what_a_terminal_obeys_is_escaped() -> None:
    assert not OBEYED.search(printable(HOSTILE)) and printable(printable(HOSTILE)) == printable(HOSTILE)
    assert printable("Gläser 世界 ~ \\x") == "Gläser 世界 ~ \\x"
    assert printable("a\nb") == "a\\nb" and printable("a\nb", keep="\n") == "a\nb"


@pytest.mark.parametrize("kind", [InputError, ServerError])
def test_errors_are_one_line(kind: type[Exception]) -> None:
    error = kind(f"{HOSTILE}\nglint: all is well", HOSTILE)
    assert not OBEYED.search(str(error)) and "\n" not in str(error)
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_commands(capsys: pytest.CaptureFixture[str]) -> None:
    echo(HOSTILE)
    echo(HOSTILE, err=True)
    shown = capsys.readouterr()
    assert "gnp" in shown.out and not OBEYED.search(shown.out) and not OBEYED.search(shown.err)


def test_tables_show_text_as_it_is() -> None:
    stream = io.StringIO()
    Console(file=stream, width=200).print(table_of([{"object": f"[red]{HOSTILE}", "count": 1000}], ""))
    assert "[red]" in stream.getvalue() and "1,000" in stream.getvalue() and not OBEYED.search(stream.getvalue())


def test_sentences_show_text_as_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    show(f"no objects in the store /data/[old]/[/x]/{HOSTILE}")
    shown = capsys.readouterr().out
    assert "/data/[old]/[/x]/" in shown and not OBEYED.search(shown)


def test_events() -> None:
    lines, plain, bars = io.StringIO(), io.StringIO(), io.StringIO()
    for event in (Message(HOSTILE, HOSTILE), CaptureWarning(HOSTILE, HOSTILE, "mask")):
        JsonLines(lines).emit(event)
        PlainLines(plain).emit(event)
        ProgressBars(Console(file=bars, width=500)).emit(event)
    assert not any(OBEYED.search(stream.getvalue()) for stream in (lines, plain, bars))
    assert json.loads(lines.getvalue().splitlines()[0])["capture"].startswith("a\x1b[2Jb")


@pytest.mark.parametrize("path", sorted(CLI.glob("*.py")), ids=lambda path: path.name)
def test_no_command_prints_in_another_way(path: Path) -> None:
    if path.name != "output.py":
        assert not re.search(r"\btyper\.s?echo\(|(?<![\w.])print\(", path.read_text(encoding="utf-8"))
