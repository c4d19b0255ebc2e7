"""Programs among the tests: those that documents and docstrings name exist, and know the options named with them."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.generated_docs import ROOT, documents

COMMAND = re.compile(r"python -m (tests(?:\.\w+)+)([^`\n]*)")
FOLDERS = ("flows", "storage", "tasks", "tests")
SOURCES = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]
PROGRAMS = [path for path in SOURCES if "\nif __name__ ==" in path.read_text(encoding="utf-8")]
BENCHMARKS = [path for path in PROGRAMS if path.parent.name == "benchmarks"]


def commands(path: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield the modules of the programs that a file tells to run, and the options after them."""
    text = path.read_text(encoding="utf-8")
    # In a paragraph a command may be broken between lines, in code it ends with its line.
    flowing = re.sub(r"(`[^`]*`)", lambda span: " ".join(span[1].split()), text) if path.suffix == ".md" else text
    for match in COMMAND.finditer(flowing):
        yield match[1], re.findall(r"--[a-z][a-z0-9-]*", match[2])


def module_path(name: str) -> Path:
    return ROOT.joinpath(*name.split(".")).with_suffix(".py")


def options_of(path: Path) -> set[str]:
    """Return the options of a program: texts such as `--seed`, and the names that it gives to another one's parser."""
    options = {"--help"}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.startswith("--"):
            options.add(node.value)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id.endswith("_parser"):
            options |= {f"--{keyword.arg}" for keyword in node.keywords}
        elif isinstance(node, ast.ImportFrom) and any(name.name.endswith("_parser") for name in node.names):
            options |= options_of(module_path(str(node.module)))
    return options


def test_programs_that_are_named_exist_and_know_the_options_named() -> None:
    named = [(path, name, options) for path in (*documents(), *SOURCES) for name, options in commands(path)]
    assert len(named) > 50
    for path, name, options in named:
        program = module_path(name)
        assert program in PROGRAMS, f"{path.relative_to(ROOT)} names {name}, which is no program"
        unknown = set(options) - options_of(program)
        assert not unknown, f"{path.relative_to(ROOT)}: {name} has no {unknown}"


@pytest.mark.parametrize("path", BENCHMARKS, ids=lambda path: path.stem)
def test_a_benchmark_parses_what_follows_it(path: Path) -> None:
    """Otherwise it takes `--help` for the name of something, and begins."""
    assert "sys.argv" not in path.read_text(encoding="utf-8")
