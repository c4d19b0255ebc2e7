"""One vocabulary: words in help texts, README and error messages; identifiers, constants and docstrings in the code.

Benchmarks are read like the product, but for constants: each is a program of its own.
"""

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
import typer

from glint.flows.cli.main import app

ROOT = Path(__file__).parents[1]
FOLDERS = ("flows", "glint", "storage", "tasks")
COMMANDS: dict[str, click.Command] = typer.main.get_command(app).commands  # type: ignore[attr-defined]

BANNED_WORDS = {
    r"lamps?": "light (lamp only for the thing in the hand)",
    r"balls?": "sphere, chrome sphere",
    r"film(s|ed|ing)?": "video (noun), record (verb)",
    r"footage": "video, frames",
    r"mend(s|ed|ing)?": "fix",
    r"tells?|told|telling": "report, print, show",
    r"glints|glinted|could glint": "highlights, observed, observable",
    r"outlines?": "silhouette, contour",
    r"careless": "degraded",
    r"(is|are) passed": "skipped, up to date",
    r"so long": "at least DAYS, ..",
}
"""Regular expressions of words that users must not meet, and what to write instead."""

ALLOWED_PHRASES = ("chrome sphere (calibration ball)",)
LAMP_SECTION = "## Photograph your own object"
"""The section of README where the lamp is the thing in the hand."""

BANNED_IDENTIFIERS = frozenset(
    re.findall(
        r"\w+",
        "each every here there told tell found said seen one both others towards away apart nobody somebody whoever"
        " what meanwhile",
    )
)
PROTOCOL_NAMES = {"storage/footage/remote_file.py": {"tell"}}
"""Identifiers that a protocol of the language prescribes."""
BANNED_FIRST_WORDS = frozenset(
    re.findall(
        r"\w+",
        "What Whether Where Of How The A An All No As By In On For With Every Each Who Whatever Nothing Nobody",
    )
)
CONSTANT = re.compile(r"_?[A-Z][A-Z0-9_]*")

Function = ast.FunctionDef | ast.AsyncFunctionDef


def modules() -> list[Path]:
    """Return all modules of the product; `glint` links to the other folders, which are listed once."""
    paths = (path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py")))
    return list(dict.fromkeys(path.resolve() for path in paths))


def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


MODULES = modules()
NAMES = [path.relative_to(ROOT).as_posix() for path in MODULES]
BENCHMARKS = sorted((ROOT / "tests" / "benchmarks").glob("*.py"))
READ = pytest.mark.parametrize("path", [*MODULES, *BENCHMARKS], ids=lambda path: path.relative_to(ROOT).as_posix())


def banned_words(text: str) -> list[str]:
    """Return the banned words of a text with what to write instead."""
    text = re.sub(r"\s+", " ", text)
    for phrase in ALLOWED_PHRASES:
        text = text.replace(phrase, "", 1)
    return [
        f"{match[0]!r} in {text[max(0, match.start() - 30) : match.end() + 30]!r}: {instead}"
        for pattern, instead in BANNED_WORDS.items()
        for match in re.finditer(rf"(?<![\w-])({pattern})(?![\w-])", text, re.IGNORECASE)
    ]


def error_classes() -> set[str]:
    """Return the names of all classes of the product that derive from an exception."""
    bases = {
        node.name: {ast.unparse(base).rpartition(".")[2] for base in node.bases}
        for path in modules()
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.ClassDef)
    }
    errors, size = {"Exception"}, 0
    while len(errors) > size:
        size = len(errors)
        errors |= {name for name, parents in bases.items() if parents & errors or name.endswith("Error")}
    return errors - {"Exception"}


def messages(tree: ast.Module, classes: set[str]) -> Iterator[str]:
    """Yield the string literals that are passed to these classes, and those of the variables that are."""
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] in classes:
            for argument in (*node.args, *(keyword.value for keyword in node.keywords)):
                yield literals(argument)
                names |= {part.id for part in ast.walk(argument) if isinstance(part, ast.Name)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and names & {ast.unparse(target) for target in node.targets}:
            yield literals(node.value)


def literals(expression: ast.expr) -> str:
    """Return the string literals of an expression, joined."""
    values = (part.value for part in ast.walk(expression) if isinstance(part, ast.Constant))
    return " .. ".join(text for text in values if isinstance(text, str))


def identifiers(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield line and name of all variables, parameters, attributes, functions and classes that a module defines."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.id if isinstance(node, ast.Name) else node.attr
        elif isinstance(node, ast.arg):
            yield node.lineno, node.arg
        elif isinstance(node, Function | ast.ClassDef):
            yield node.lineno, node.name
        elif isinstance(node, ast.alias) and node.asname:
            yield node.lineno, node.asname
        elif isinstance(node, ast.ExceptHandler | ast.MatchAs | ast.MatchStar) and node.name:
            yield node.lineno, node.name


def constants(tree: ast.Module) -> Iterator[tuple[str, ast.expr]]:
    """Yield name and value of a module's constants."""
    for node in tree.body:
        if isinstance(node, ast.Assign):
            for target in node.targets:
                pair = (target, node.value)
                if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                    pairs = list(zip(target.elts, node.value.elts, strict=True))
                else:
                    pairs = [pair]
                yield from ((name.id, value) for name, value in pairs if isinstance(name, ast.Name))
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None:
            yield node.target.id, node.value


def is_property(node: Function) -> bool:
    decorators = {ast.unparse(decorator).rpartition(".")[2] for decorator in node.decorator_list}
    return bool(decorators & {"property", "cached_property", "setter"})


@pytest.mark.parametrize("name", ["glint", *COMMANDS])
def test_help_uses_the_vocabulary(name: str) -> None:
    if name == "glint":
        texts = [app.info.help, app.info.epilog]
    else:
        command = COMMANDS[name]
        texts = [command.help, *(getattr(parameter, "help", None) for parameter in command.params)]
    assert all(texts), "a help text is missing"
    for text in texts:
        assert banned_words(str(text)) == []


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_help_is_made_of_sentences(name: str) -> None:
    command = COMMANDS[name]
    for text in (command.help, *(getattr(parameter, "help", None) for parameter in command.params)):
        assert text and re.match(r"[A-Z]|hemisphere", text), text
        assert re.search(r"(\.|\.\.|\))$", text), f"{text!r} ends without a full stop"
        assert text.split()[0] not in BANNED_FIRST_WORDS - {"The", "All"}, text


def test_readme_uses_the_vocabulary() -> None:
    sections = re.split(r"^(?=## )", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    for section in sections:
        text = re.sub(r"\blamps?\b", "", section, flags=re.IGNORECASE) if section.startswith(LAMP_SECTION) else section
        assert banned_words(text) == []


@READ
def test_errors_and_warnings_use_the_vocabulary(path: Path) -> None:
    assert [word for text in messages(parsed(path), ERRORS | {"StageWarning"}) for word in banned_words(text)] == []


@READ
def test_identifiers_are_nouns(path: Path) -> None:
    allowed = PROTOCOL_NAMES.get(path.relative_to(ROOT).as_posix(), set())
    names = [(line, name) for line, name in identifiers(parsed(path)) if name not in allowed]
    assert [f"line {line}: {name}" for line, name in names if name in BANNED_IDENTIFIERS] == []


def test_a_constant_has_the_same_value_everywhere() -> None:
    values: dict[str, dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
    for path, module in zip(MODULES, NAMES, strict=True):
        for name, value in constants(parsed(path)):
            if CONSTANT.fullmatch(name):
                values[name][ast.dump(value)].append(module)
    assert {name: list(modules.values()) for name, modules in values.items() if len(modules) > 1} == {}


@READ
def test_docstrings_of_functions_begin_with_a_verb(path: Path) -> None:
    functions = (node for node in ast.walk(parsed(path)) if isinstance(node, Function) and not is_property(node))
    docstrings = ((node, ast.get_docstring(node) or "") for node in functions)
    first_words = ((node, re.match(r"\w*", text)) for node, text in docstrings)
    banned = [(node, word[0]) for node, word in first_words if word and word[0] in BANNED_FIRST_WORDS]
    assert [f"line {node.lineno}: {node.name}: {word} .." for node, word in banned] == []


def test_the_rules_find_what_they_should() -> None:
    assert len(banned_words("A lamp told the ball: mend it.")) == 4
    assert banned_words("glint-demo, frames, a chrome sphere (calibration ball), the highlight") == []
    code = "for each in []:\n  def f(there, *, told=1): self.found = X = 1\nraise StoreError(f'a {x}', 'mend it')"
    tree = ast.parse(code)
    assert {name for _, name in identifiers(tree)} & BANNED_IDENTIFIERS == {"each", "there", "told", "found"}
    assert list(messages(tree, {"StoreError"})) == ["a ", "mend it"]
    warning = ast.parse("text = f'Film {x}'\nother = 'lamp'\nraise StageWarning(text)")
    assert list(messages(warning, {"StageWarning"})) == ["", "Film "]
    assert {"GlintError", "StoreError", "UnusableCapture", "ServerError"} <= ERRORS
    assert dict(constants(ast.parse("A, B = 1, 2\nC: int = 3"))).keys() == {"A", "B", "C"}
    assert {"flows/cli/main.py", "storage/errors.py"} <= set(NAMES) and len(BENCHMARKS) > 30


ERRORS = error_classes()
