"""How the process of the `glint` command ends: with all of its output and the right status."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def ended(code: str) -> subprocess.CompletedProcess[str]:
    """Run code in a process whose output is buffered."""
    return subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=100)


@pytest.mark.parametrize(
    ("body", "status"), [("print('written')", 0), ("sys.exit()", 0), ("sys.exit(3)", 3), ("sys.exit('told')", 1)]
)
def test_the_status_is_that_of_the_command(body: str, status: int) -> None:
    code = f"""
import sys, glint.__main__, glint.flows.cli.main

def command():
    {body}

glint.flows.cli.main.main = command
glint.__main__.main()
"""
    done = ended(code)
    assert done.returncode == status
    assert done.stdout == ("written\n" if "written" in body else "")
    assert done.stderr == ("told\n" if "told" in body else "")


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams_are_no_error_and_no_file_gets_their_numbers(closed: str, tmp_path: Path) -> None:
    code = f"""
import os, subprocess, sys, glint.__main__, glint.flows.cli.main

def command():
    with open({str(tmp_path / "result")!r}, "w") as file:
        print("for a reader")
        print("for a person", file=sys.stderr)
        subprocess.run(["sh", "-c", "echo from a child; echo too >&2"], check=True)
        file.write(str(file.fileno() > 2))

glint.flows.cli.main.main = command
glint.__main__.main()
"""
    done = subprocess.run(
        ["sh", "-c", f'exec "$0" -c "$1" {closed}', sys.executable, code], cwd=ROOT, capture_output=True, timeout=100
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "result").read_text() == "True"


def test_an_uncaught_error_has_its_traceback() -> None:
    code = """
import glint.__main__, glint.flows.cli.main

def command():
    raise RuntimeError("nobody catches it")

glint.flows.cli.main.main = command
glint.__main__.main()
"""
    done = ended(code)
    assert done.returncode == 1
    assert done.stderr.endswith("RuntimeError: nobody catches it\n")


def test_what_others_do_at_the_end_is_done_and_a_fork_ends_in_its_own_way() -> None:
    code = """
import atexit, os, sys, glint.__main__, glint.flows.cli.main

def command():
    atexit.register(print, "last words")
    child = os.fork()
    if child == 0:
        sys.exit(7)
    print("fork", os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))

glint.flows.cli.main.main = command
glint.__main__.main()
"""
    done = ended(code)
    assert done.returncode == 0
    assert done.stdout.splitlines() == ["last words", "fork 7", "last words"]
