"""Documents agree with the code: commands, options, parameters, stages, messages, modules, figures, examples, links."""

import ast
import re
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import click
import pytest
import typer

from glint.flows.cli.main import app
from glint.storage.catalogue.loading import CatalogueError, load
from glint.storage.catalogue.models import Camera, Capture, Catalogue, Object, Pose, Region, Sphere
from glint.storage.inputs.markup import AnnotationEntry, read_markup
from glint.tasks.algorithms.simulation.options import SHAPES
from glint.tasks.engine.parameters import FORMER_NAMES, Parameters
from glint.tasks.pipeline import STAGES
from glint.tasks.simulation.simulate import CaptureOptions
from tests.generated_docs import BLOCK, FIGURES_FILE, ROOT, TABLES, cells, documents, figures, with_current_tables
from tests.quoted_figures import BLOCKS, written

README, DOCS = ROOT / "README.md", ROOT / "docs"
DOCUMENTS = documents()
COMMANDS: dict[str, click.Command] = typer.main.get_command(app).commands  # type: ignore[attr-defined]
CALL = re.compile(r"(?<![\w./-])(?:\.venv/bin/)?glint ([a-z][a-z-]*)([^`\n#]*)")
MAX_PICTURE_BYTES, MAX_PICTURES_BYTES = 250_000, 1_200_000
PRODUCT = ("flows", "glint", "storage", "tasks")
SHORTEST_FRAGMENT = 4
"""Characters of a quoted message's fragment that is looked for."""
TERMS_OF_THE_GLOSSARY = 40
FOREIGN_MESSAGES = ("403", "SSL", "credentials", "error sending request", "sends no heartbeats any more")
"""Quoted words of libraries and of the deployment, which no literal of the product has."""


def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def code_of(text: str) -> str:
    """Return what stands in code blocks and between backticks, also where a line ends between them."""
    fences = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
    prose = fences.sub("", text)
    blocks = fences.findall(text) + re.findall(r"^(?: {4}[^\n]*\n)+", prose, re.MULTILINE)
    return "\n".join(blocks + [" ".join(span.split()) for span in re.findall(r"`((?:[^`\n]|\n(?!\n))+)`", prose)])


def calls(path: Path) -> Iterator[tuple[str, str]]:
    """Yield the commands in the code of a document, and what follows them."""
    for match in CALL.finditer(code_of(text_of(path))):
        yield match[1], match[2]


def options_of(command: click.Command) -> set[str]:
    return {name for parameter in command.params for name in parameter.opts if name.startswith("--")} | {"--help"}


def fenced(path: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text_of(path), re.DOTALL | re.MULTILINE)


def modules() -> list[Path]:
    """Return the modules of the product; `glint` links to the other folders, which are listed once."""
    paths = (path.resolve() for folder in PRODUCT for path in sorted((ROOT / folder).rglob("*.py")))
    return list(dict.fromkeys(paths))


def literals() -> str:
    """Return the string literals of the product without docstrings, one a line; holes of f-strings become a NUL."""
    texts: list[str] = []
    for path in modules():
        tree = ast.parse(text_of(path))
        docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.JoinedStr):
                parts = (part.value if isinstance(part, ast.Constant) else "\0" for part in node.values)
                texts.append("".join(map(str, parts)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
                texts.append(node.value)
    return "\n".join(texts)


def fragments(message: str) -> list[str]:
    """Return the fixed parts of a quoted message, which has `..` where the value stands."""
    parts = (part.strip() for part in message.split(".."))
    return [part for part in parts if len(part) >= SHORTEST_FRAGMENT]


def quoted_messages(path: Path) -> list[str]:
    """Return the texts in double quotes, and the first column of tables of messages."""
    text = re.sub(r"\s+", " ", re.sub(r"^```.*?^```", "", text_of(path), flags=re.DOTALL | re.MULTILINE))
    quoted = re.findall(r'"([^"|]+)"', text)
    for block in re.findall(r"^\| message \|.*?(?=\n\n)", text_of(path), re.DOTALL | re.MULTILINE):
        quoted += [row[0] for row in cells(block)[1:]]
    return quoted


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_every_command_and_option_exists(path: Path) -> None:
    for name, rest in calls(path):
        assert name in COMMANDS, f"{path.name} names `glint {name}`"
        if name == "prefect":
            continue  # its options are Prefect's
        unknown = set(re.findall(r"--[a-z-]+", rest)) - options_of(COMMANDS[name])
        assert not unknown, f"{path.name}: `glint {name}` has no {unknown}"


def test_the_page_of_commands_has_every_command_and_option() -> None:
    page = text_of(DOCS / "commands.md")
    sections = dict(re.findall(r"^### `glint ([a-z]+)[^`\n]*`\n(.*?)(?=^##|\Z)", page, re.DOTALL | re.MULTILINE))
    assert list(sections) == list(COMMANDS)
    for name, command in COMMANDS.items():
        options = set(re.findall(r"--[a-z-]+", code_of(sections[name])))
        missing = options_of(command) - options - {"--help"}
        assert not missing, f"docs/commands.md does not explain {missing} of `glint {name}`"


def test_commands_are_found_in_text() -> None:
    matches = CALL.finditer(".venv/bin/glint run C --json # all")
    assert [match.groups() for match in matches] == [("run", " C --json ")]
    assert not CALL.search("from ./glint-store and glint.toml")
    assert (
        code_of("a `glint\nrun C` b\n\n```sh\nls `pwd`\n```\n\n    glint\n")
        == "```sh\nls `pwd`\n```\n    glint\n\nglint run C"
    )


def test_options_of_the_simulation_exist() -> None:
    names = {field.name for field in fields(CaptureOptions)}
    for path in DOCUMENTS:
        unknown = set(re.findall(r"--set ([a-z_]+)=", " ".join(text_of(path).split()))) - names
        assert not unknown, f"{path.name} sets {unknown}"


def test_the_page_of_commands_names_every_shape() -> None:
    paragraph = re.search(r"^SHAPE is (.*?)\n\n", text_of(DOCS / "commands.md"), re.DOTALL | re.MULTILINE)
    assert paragraph and set(re.findall(r"`([a-z-]+)`", paragraph[1])) == {*SHAPES, "all"}


def test_the_catalogue_example_loads(tmp_path: Path) -> None:
    (example,) = (block for block in fenced(README, "yaml") if block.startswith("schema:"))
    (tmp_path / "catalogue.yaml").write_text(example, encoding="utf-8")
    catalogue = load(tmp_path / "catalogue.yaml", Parameters)
    capture = catalogue.objects[0].captures[0]
    assert capture.frames == str(tmp_path / "front.mp4")
    assert capture.spheres[0].diameter_mm == 25.0
    (tmp_path / "catalogue.yaml").write_text(example.replace("mask:", "maks:"), encoding="utf-8")
    with pytest.raises(CatalogueError, match="mask"):
        load(tmp_path / "catalogue.yaml", Parameters)


def test_every_key_of_a_catalogue_is_explained() -> None:
    text = code_of(text_of(DOCS / "catalogue.md"))
    for model in (Catalogue, Object, Capture, Sphere, Region, Camera, Pose, AnnotationEntry):
        for name, field in model.model_fields.items():
            key = field.alias or name
            assert re.search(rf"\b{key}\b", text), f"docs/catalogue.md lacks the key {key} of {model.__name__}"


def test_examples_of_parameters_are_valid() -> None:
    from ruamel.yaml import YAML

    examples = re.findall(r"parameters: (\{[^`#\n]*\})", "\n".join(code_of(text_of(path)) for path in DOCUMENTS))
    assert examples
    for example in examples:
        values = YAML(typ="safe").load(example)
        Parameters.model_validate(values)
        former = {(stage, name) for stage, given in values.items() for name in given} & set(FORMER_NAMES)
        assert not former, f"{example} uses a former name"


def test_the_markup_example_is_read(tmp_path: Path) -> None:
    (example,) = fenced(DOCS / "catalogue.md", "json")
    (tmp_path / "markup.json").write_text(example, encoding="utf-8")
    marks = read_markup(tmp_path / "markup.json", (480, 640), 2000)
    assert {mark.kind for mark in marks} == {"true", "false"}


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_generated_tables_are_current(path: Path) -> None:
    """`python -m tests.generated_docs` rewrites them."""
    text = text_of(path)
    assert with_current_tables(text) == text
    assert text.count("<!-- generated:") == len(BLOCK.findall(text)), "a generated table has no end"


def test_every_generated_table_stands_in_one_place() -> None:
    names = [name for path in DOCUMENTS for _, name, _, _ in BLOCK.findall(text_of(path))]
    assert sorted(names) == sorted(TABLES)


@pytest.mark.parametrize(("page", "name"), [("parameters.md", "parameters"), ("architecture.md", "arrays")])
def test_every_row_has_a_meaning(page: str, name: str) -> None:
    (block,) = (content for _, title, content, _ in BLOCK.findall(text_of(DOCS / page)) if title == name)
    assert not [row for row in cells(block) if not row[-1]]


def test_readme_has_all_stages() -> None:
    _, _, stages = text_of(README).partition("| stage |")
    assert re.findall(r"^\| ([a-z]+) \|", stages.partition("\n\n")[0], re.MULTILINE) == [stage.name for stage in STAGES]


def pairs_of(value: Any) -> Iterator[tuple[float, float]]:
    """Yield all pairs of numbers in a JSON value."""
    if isinstance(value, dict):
        for item in value.values():
            yield from pairs_of(item)
    elif isinstance(value, list) and len(value) == 2 and not isinstance(value[0], str):
        yield value[0], value[1]


@pytest.mark.parametrize("path", [README, DOCS / "method.md"], ids=lambda path: path.name)
def test_squared_errors_are_those_of_the_evaluation(path: Path) -> None:
    """Every pair `observed / whole mask` is a pair of docs/evaluation.json, rounded."""
    measured = list(pairs_of(figures()))
    quoted = re.findall(r"(?<![\d.])(0\.\d+) / (0\.\d+)(?![\d.]*%)", text_of(path))
    assert quoted, f"{path.name} quotes no figure"
    for pair in quoted:
        rounded = {
            tuple(f"{value:.{len(text) - 2}f}" for value, text in zip(known, pair, strict=True)) for known in measured
        }
        assert pair in rounded, f"{path.name}: {' / '.join(pair)} is not in docs/evaluation.json"


def test_figures_are_laid_out_as_they_are_taken_over() -> None:
    text = FIGURES_FILE.read_text(encoding="utf-8")
    assert set(BLOCKS) == {"captures", "degraded", "perturbed"}
    assert all(written(part, figures()[part]) in text for part in BLOCKS)


def test_readme_promises_what_was_measured_of_confidence() -> None:
    (promise,) = re.findall(r"at least 0\.95, (\d+)% or more are within 5 degrees", " ".join(text_of(README).split()))
    captures = figures()["captures"].values()
    assert min(capture["confident"]["percent_within_5deg"] for capture in captures) >= float(promise)


@pytest.mark.long
def test_quoted_messages_exist() -> None:
    messages = quoted_messages(DOCS / "troubleshooting.md")
    assert len(messages) > 20
    text = literals()
    for message in messages:
        assert fragments(message), f"{message!r} has no fixed part"
        for fragment in fragments(message):
            assert fragment in text, f"docs/troubleshooting.md quotes {fragment!r}, which no message has"


@pytest.mark.long
def test_messages_in_the_table_of_failures_exist() -> None:
    _, _, table = text_of(DOCS / "operations.md").partition("## What each failure looks like")
    quoted = [message for row in cells(table.strip()) for message in re.findall(r'"([^"]+)"', row[0])]
    messages = [message for message in quoted if message not in FOREIGN_MESSAGES]
    assert len(messages) >= 5
    text = literals()
    for fragment in (fragment for message in messages for fragment in fragments(message)):
        assert fragment in text, f"docs/operations.md quotes {fragment!r}, which no message has"


@pytest.mark.long
def test_named_errors_exist() -> None:
    _, _, errors = text_of(DOCS / "troubleshooting.md").partition("| error |")
    names = set(re.findall(r"^\| ([A-Z]\w+) \|", errors.partition("\n\n")[0], re.MULTILINE))
    trees = (ast.walk(ast.parse(text_of(path))) for path in modules())
    classes = {node.name for nodes in trees for node in nodes if isinstance(node, ast.ClassDef)}
    assert names
    assert names <= classes


def test_named_modules_exist() -> None:
    """References such as `labelling/graph_cut` or `tasks/pipeline.py`."""
    roots = [ROOT, *(ROOT / folder for folder in PRODUCT), ROOT / "tasks" / "algorithms"]
    folders = {path.name for root in roots for path in root.iterdir() if path.is_dir()}
    for path in DOCUMENTS:
        for reference in re.findall(r"`((?:[a-z_]+/)+[a-z0-9_][a-z0-9_.]*)`", text_of(path)):
            if reference.partition("/")[0] in folders:
                candidates = [root / f"{reference}{suffix}" for root in roots for suffix in ("", ".py")]
                assert any(candidate.exists() for candidate in candidates), f"{path.name}: there is no {reference}"


def test_named_programs_exist() -> None:
    """Commands such as `python -m tests.benchmarks.sizing`."""
    for path in DOCUMENTS:
        for name in re.findall(r"python -m\s+(tests(?:\.\w+)+)", text_of(path)):
            assert (ROOT / f"{name.replace('.', '/')}.py").exists(), f"{path.name}: there is no {name}"


def test_architecture_lists_all_packages() -> None:
    layout = text_of(DOCS / "architecture.md").partition("\n\n")[2].partition("\n\n")[0]
    names = re.findall(r"(?<![\w/])([a-z_]+)/(?=\s)", layout)
    folders = (ROOT / "flows", ROOT / "storage", ROOT / "tasks", ROOT / "tasks" / "algorithms")
    packages = [path.parent.name for folder in folders for path in folder.glob("*/__init__.py")]
    assert sorted(names) == sorted([*packages, *PRODUCT])


def test_the_glossary_has_one_line_for_each_term() -> None:
    terms = re.findall(r"^- \*\*([^*]+)\*\*", text_of(DOCS / "glossary.md"), re.MULTILINE)
    assert len(terms) >= TERMS_OF_THE_GLOSSARY
    assert len(set(terms)) == len(terms)


def test_decisions_are_numbered() -> None:
    pages = sorted((DOCS / "decisions").glob("*.md"))
    numbers = [int(path.name.partition("-")[0]) for path in pages]
    assert numbers == list(range(1, len(pages) + 1))
    for path, number in zip(pages, numbers, strict=True):
        assert text_of(path).startswith(f"# {number} "), path.name


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", text_of(path)):
        if "://" not in target:
            name, _, heading = target.partition("#")
            file = (path.parent / name).resolve() if name else path
            assert file.exists(), f"{path.name} links to {target}"
            if heading:
                assert heading in headings(file), f"{path.name} links to {target}"


def headings(path: Path) -> set[str]:
    """Return the headings of a document as links name them."""
    titles = re.findall(r"^#+ (.*)$", text_of(path), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def test_every_page_is_reached_from_the_readme() -> None:
    reached, waiting = set[Path](), [README]
    while waiting:
        path = waiting.pop()
        if path in reached:
            continue
        reached.add(path)
        if path.suffix == ".md":
            waiting += [
                (path.parent / target.partition("#")[0]).resolve()
                for target in re.findall(r"\]\(([^)\s#]+)[^)]*\)", text_of(path))
                if "://" not in target
            ]
    assert set(DOCUMENTS) <= reached, f"nothing links to {set(DOCUMENTS) - reached}"


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_documents_hold_no_address_of_a_machine(path: Path) -> None:
    text = text_of(path)
    assert not re.search(r"(?<![\w.~])/(?:home|root|work|tmp|Users|mnt)/", text)
    hosts = set(re.findall(r"https?://([^/\s)`>]+)", text))
    assert not any(re.search(r"pypi|index|registry|artifactory|nexus|mirror|proxy", host) for host in hosts), hosts


def test_pictures_are_small_and_shown() -> None:
    pictures = sorted((ROOT / "docs" / "pictures").iterdir())
    shown = "\n".join(text_of(path) for path in DOCUMENTS)
    assert pictures
    for picture in pictures:
        assert picture.read_bytes().startswith(b"\x89PNG"), picture.name
        assert picture.stat().st_size < MAX_PICTURE_BYTES, picture.name
        assert f"pictures/{picture.name}" in shown, f"no document shows {picture.name}"
    assert sum(picture.stat().st_size for picture in pictures) < MAX_PICTURES_BYTES
