"""What the documents say is what the code does: commands, options, parameters, the catalogue's example, links."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest
import typer

from glint.flows.cli.main import app
from glint.storage.catalogue.loading import CatalogueError, load
from glint.storage.catalogue.models import Camera, Capture, Catalogue, Object, Pose, Region, Sphere
from glint.storage.inputs.masks_and_truth import read_markup
from glint.tasks.engine.parameters import Parameters
from glint.tasks.pipeline import STAGES

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
DOCUMENTS = [README, ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
COMMANDS: dict[str, click.Command] = typer.main.get_command(app).commands  # type: ignore[attr-defined]
CALL = re.compile(r"(?<![\w./-])(?:\.venv/bin/)?glint ([a-z][a-z-]*)([^`\n#]*)")
LARGEST_PICTURE, ALL_PICTURES = 250_000, 1_200_000


def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def code_of(text: str) -> str:
    """What stands in code blocks and between backticks."""
    blocks = re.findall(r"^```.*?^```|^(?: {4}[^\n]*\n)+", text, re.DOTALL | re.MULTILINE)
    return "\n".join(blocks + re.findall(r"`([^`\n]+)`", text))


def calls(path: Path) -> Iterator[tuple[str, str]]:
    """Commands and what follows them in the code of a document."""
    for found in CALL.finditer(code_of(text_of(path))):
        yield found[1], found[2]


def options_of(command: click.Command) -> set[str]:
    return {name for each in command.params for name in each.opts if name.startswith("--")} | {"--help"}


def fenced(path: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text_of(path), re.DOTALL | re.MULTILINE)


def limits_of(schema: dict[str, Any]) -> str:
    """A parameter's type and range in words."""
    if "enum" in schema:
        return ", ".join(schema["enum"])
    if "anyOf" in schema:
        return ", or ".join("null" if each["type"] == "null" else limits_of(each) for each in schema["anyOf"])
    low = [f"from {schema['minimum']:g}"] if "minimum" in schema else []
    low += [f"above {schema['exclusiveMinimum']:g}"] if "exclusiveMinimum" in schema else []
    high = [f"to {schema['maximum']:g}"] if "maximum" in schema else []
    high += [f"below {schema['exclusiveMaximum']:g}"] if "exclusiveMaximum" in schema else []
    kind = {"integer": "whole number", "number": "number", "boolean": "true or false"}[schema["type"]]
    return " ".join([kind, *low, *high])


def parameter_rows() -> list[tuple[str, str, str, str]]:
    """Stage, name, default and range of every parameter, as the table of docs/parameters.md has them."""
    rows = []
    for stage, model in Parameters.model_fields.items():
        for name, schema in model.annotation.model_json_schema().get("properties", {}).items():
            default = schema["default"]
            said = default if isinstance(default, str) else json.dumps(default)
            rows.append((stage, name, said, limits_of(schema)))
    return rows


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_every_command_and_option_exists(path: Path) -> None:
    for name, rest in calls(path):
        assert name in COMMANDS, f"{path.name} names `glint {name}`"
        unknown = set(re.findall(r"--[a-z-]+", rest)) - options_of(COMMANDS[name])
        assert not unknown, f"{path.name}: `glint {name}` has no {unknown}"


def test_readme_tells_of_every_command_and_option() -> None:
    told = {name for name, _ in calls(README)}
    assert set(COMMANDS) <= told, f"README says nothing of {set(COMMANDS) - told}"
    code = code_of(text_of(README))
    every = {option for command in COMMANDS.values() for option in options_of(command)}
    missing = {option for option in every if not re.search(rf"{option}(?![a-z-])", code)}
    assert not missing, f"README says nothing of {missing}"


def test_commands_are_found_in_text() -> None:
    assert [found.groups() for found in CALL.finditer(".venv/bin/glint run C --json # all")] == [("run", " C --json ")]
    assert not CALL.search("from ./glint-store and glint.toml")


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
    text = code_of(text_of(README))
    for model in (Catalogue, Object, Capture, Sphere, Region, Camera, Pose):
        for name, field in model.model_fields.items():
            key = field.alias or name
            assert re.search(rf"\b{key}\b", text), f"README does not explain the key {key} of {model.__name__}"


def test_examples_of_parameters_are_valid() -> None:
    from ruamel.yaml import YAML

    examples = re.findall(r"parameters: (\{[^`#\n]*\})", "\n".join(text_of(path) for path in DOCUMENTS))
    assert examples
    for example in examples:
        Parameters.model_validate(YAML(typ="safe").load(example))


def test_the_markup_example_is_read(tmp_path: Path) -> None:
    (example,) = fenced(README, "json")
    (tmp_path / "markup.json").write_text(example, encoding="utf-8")
    marks = read_markup(tmp_path / "markup.json", (480, 640), 2000)
    assert {mark.kind for mark in marks} == {"true", "false"}


def test_the_table_of_parameters_is_current() -> None:
    lines = text_of(ROOT / "docs" / "parameters.md").splitlines()
    rows = [tuple(cell.strip() for cell in line.strip("|").split("|")) for line in lines if line.startswith("| ")]
    head, *told = rows
    assert head[:4] == ("stage", "parameter", "default", "values")
    assert [row[:4] for row in told] == parameter_rows()
    assert all(len(row) == 5 and row[4] for row in told), "a parameter's meaning is missing"


def test_all_stages_are_told() -> None:
    for path in (README, ROOT / "docs" / "architecture.md"):
        _, _, table = text_of(path).partition("| stage |")
        found = re.findall(r"^\| ([a-z]+) \|", table.partition("\n\n")[0], re.MULTILINE)
        assert found == [stage.name for stage in STAGES], path.name


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", text_of(path)):
        if "://" not in target:
            place, _, heading = target.partition("#")
            file = (path.parent / place).resolve() if place else path
            assert file.exists(), f"{path.name} links to {target}"
            if heading:
                assert heading in headings(file), f"{path.name} links to {target}"


def headings(path: Path) -> set[str]:
    """Headings of a document as links name them."""
    found = re.findall(r"^#+ (.*)$", text_of(path), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in found}


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
        assert picture.stat().st_size < LARGEST_PICTURE, picture.name
        assert f"pictures/{picture.name}" in shown, f"no document shows {picture.name}"
    assert sum(picture.stat().st_size for picture in pictures) < ALL_PICTURES
