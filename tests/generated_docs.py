"""Tables of the documents that follow from the code or from docs/evaluation.json.

A table stands between `<!-- generated: NAME -->` and `<!-- end -->`. `python -m tests.generated_docs` rewrites all of
them in place; tests/test_docs.py compares. Columns that people write (the meaning of a parameter) are kept.
"""

import ast
import inspect
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from textwrap import dedent
from typing import Any

from glint.storage.versions.array_schema import ArraySchema
from glint.tasks.algorithms.simulation.options import CaptureOptions
from glint.tasks.engine.parameters import FORMER_NAMES, Parameters
from glint.tasks.pipeline import STAGES
from glint.tasks.robustness.matrix_report import matrix_lines

ROOT = Path(__file__).parents[1]
FIGURES_FILE = ROOT / "docs" / "evaluation.json"
BLOCK = re.compile(r"(<!-- generated: ([a-z-]+) -->\n\n)(.*?)(\n<!-- end -->)", re.DOTALL)
METHODS = ("winner takes all", "silhouette only", "paper", "glint")
DEGRADED_COLUMNS = (
    ("hemisphere", "silhouette only"),
    ("hemisphere", "glint"),
    ("fish", "paper"),
    ("fish", "glint"),
    ("wine glass", "paper"),
    ("wine glass", "glint"),
)
DTYPES = {"f": "float", "u": "unsigned", "i": "signed", "b": "bool"}
"""Words for the kinds of an array's dtype."""
FINITE = {"": "", "mask": "inside the mask", "accepted": "of accepted frames", "all": "everywhere"}
"""Words for where an array's values must be finite."""

Row = Sequence[object]


def documents() -> list[Path]:
    """Return README and all pages in docs."""
    return [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]


def with_current_tables(text: str) -> str:
    """Return a document with its generated tables as they should be."""
    return BLOCK.sub(lambda match: match[1] + TABLES[match[2]](match[3]) + match[4], text)


def stages(_: str) -> str:
    """Return the table of the stages and what each of them reads and saves."""
    heads = ("stage", "reads the results of", "catalogue keys", "files", "arrays", "progress")
    rows = (
        (
            stage.name,
            ", ".join(stage.reads),
            ", ".join(stage.catalogue_keys),
            ", ".join(stage.files),
            ", ".join(stage.arrays),
            stage.progress_unit,
        )
        for stage in STAGES
    )
    return table(heads, rows)


def arrays(current: str) -> str:
    """Return the table of the stages' arrays; the meaning is kept."""
    heads = ("stage", "array", "shape", "kind", "finite", "meaning")
    meanings = {(row[0], row[1]): row[5] for row in cells(current)[1:]}
    rows = (
        (stage.name, name, _shape(schema), DTYPES[schema.kind], FINITE[schema.finite])
        for stage in STAGES
        for name, schema in stage.arrays.items()
    )
    return table(heads, ((*row, meanings.get((row[0], row[1]), "")) for row in rows))


def _shape(schema: ArraySchema) -> str:
    return f"({', '.join(schema.axes)}{',' if len(schema.axes) == 1 else ''})"


def parameters(current: str) -> str:
    """Return the table of the parameters; the meaning is kept."""
    meanings = {(row[0], row[1]): row[4] for row in cells(current)[1:]}
    heads = ("stage", "parameter", "default", "values", "meaning")
    return table(heads, ((*row, meanings.get((row[0], row[1]), "")) for row in parameter_rows()))


def parameter_rows() -> list[tuple[str, str, str, str]]:
    """Return stage, name, default and values of every parameter."""
    rows = []
    for stage, model in Parameters.model_fields.items():
        assert model.annotation is not None
        for name, schema in model.annotation.model_json_schema().get("properties", {}).items():
            default = schema["default"]
            rows.append((stage, name, default if isinstance(default, str) else json.dumps(default), values_of(schema)))
    return rows


def values_of(schema: Mapping[str, Any]) -> str:
    """Return a parameter's type and range in words."""
    if "enum" in schema:
        return ", ".join(schema["enum"])
    if "const" in schema:
        return str(schema["const"])
    if "anyOf" in schema:
        return ", or ".join("null" if kind["type"] == "null" else values_of(kind) for kind in schema["anyOf"])
    low = [f"from {schema['minimum']:g}"] if "minimum" in schema else []
    low += [f"above {schema['exclusiveMinimum']:g}"] if "exclusiveMinimum" in schema else []
    high = [f"to {schema['maximum']:g}"] if "maximum" in schema else []
    high += [f"below {schema['exclusiveMaximum']:g}"] if "exclusiveMaximum" in schema else []
    kind = {"integer": "whole number", "number": "number", "boolean": "true or false"}[schema["type"]]
    return " ".join([kind, *low, *high])


def former_names(_: str) -> str:
    """Return the table of the former names of parameters."""
    rows = ((f"`{stage}.{name}`", f"`{new_stage}.{new}`") for (stage, name), (new_stage, new) in FORMER_NAMES.items())
    return table(("former name", "present name"), rows)


def figures() -> dict[str, Any]:
    """Return the content of docs/evaluation.json."""
    content: dict[str, Any] = json.loads(FIGURES_FILE.read_text(encoding="utf-8"))
    return content


def main_errors(_: str) -> str:
    """Return README's table of squared errors."""
    heads = ("object", "frames", "winner takes all", "silhouette only", "paper", "Glint")
    rows = []
    for name, capture in figures()["captures"].items():
        pairs = [pair_text(capture["squared_error"][method], 3) for method in METHODS]
        pairs[-1] = f"**{pairs[-1]}**"
        rows.append((name.partition("/")[0].replace("-", " "), f"{capture['frames']:,}", *pairs))
    return table(heads, rows)


def squared_errors(_: str) -> str:
    """Return the evaluation's table of squared errors."""
    rows = []
    for name, capture in figures()["captures"].items():
        pairs = [pair_text(capture["squared_error"][method], 4) for method in METHODS]
        width, height = capture["pixels"]
        beyond = pair_text(capture["glint_within_and_beyond_42deg"], 4)
        rows.append((name, capture["frames"], f"{width} x {height}", *pairs, beyond))
    return table(("capture", "frames", "pixels", *METHODS, "glint within / beyond 42°"), rows)


def degrees(_: str) -> str:
    """Return the evaluation's table of angular errors."""
    rows = []
    for name, capture in figures()["captures"].items():
        row = [name]
        for method in METHODS:
            errors = capture["degrees_whole_mask"][method]
            shares = " / ".join(f"{share}%" for share in errors["percent_within_5_11.25_22.5"])
            row.append(f"{errors['mean']:.2f}, {errors['median']:.2f}, {shares}")
        rows.append(row)
    return table(("capture", *METHODS), rows)


def depth_and_confidence(_: str) -> str:
    """Return the evaluation's table of depth, confidence and labels."""
    heads = ["capture", "depth, mean px", "RMS px", "mean of diagonal", "confidence >= 0.95", "of these within 5°"]
    rows = []
    for name, capture in figures()["captures"].items():
        depth, confident, labels = capture["depth"], capture["confident"], capture["labels"]
        rows.append(
            (
                name,
                f"{depth['mean_px']:.2f}",
                f"{depth['rms_px']:.2f}",
                f"{depth['mean_percent_of_diagonal']:.2f}%",
                f"{confident['percent_of_pixels']}%",
                f"{confident['percent_within_5deg']:.1f}%",
                f"{labels['precision_percent']:.1f}%",
                f"{labels['recall_percent']:.1f}%",
            )
        )
    return table((*heads, "labels' precision", "recall"), rows)


def degraded(_: str) -> str:
    """Return the evaluation's table of degraded captures."""
    heads = (f"{shape}: {method}" for shape, method in DEGRADED_COLUMNS)
    rows = []
    for defect, shapes in figures()["degraded"].items():
        pairs = [pair_text(shapes[shape][method], 4) for shape, method in DEGRADED_COLUMNS]
        shares = (shape["confident"] for shape in shapes.values())
        rows.append((defect, *pairs, "; ".join(map(_confident_text, shares))))
    return table(("defect", *heads, "confidence >= 0.95, of these within 5°"), rows)


def _confident_text(share: dict[str, float | None]) -> str:
    """Return the share of confident pixels and, if there are any, of those within 5 degrees."""
    right = share["percent_within_5deg"]
    return f"{share['percent_of_pixels']}%" + ("" if right is None else f", {right:.1f}%")


def perturbed(_: str) -> str:
    """Return the matrix of perturbed inputs."""
    return "\n".join(matrix_lines(figures()["perturbed"])) + "\n"


def labelling(_: str) -> str:
    """Return the evaluation's table of the labelling with an ingredient switched off."""
    errors = figures()["labelling"]
    shapes = list(errors["default"])
    rows = ((name, *(pair_text(row[shape], 4) for shape in shapes)) for name, row in errors.items())
    return table(("labelling", *shapes), rows)


def sweep_length(_: str) -> str:
    """Return the table of what longer sweeps gain."""
    rows = []
    for frames, shapes in figures()["sweep_length"].items():
        values = list(shapes.values())
        rows.append(
            (
                f"{int(frames):,}",
                " / ".join(f"{value['percent_observed']}%" for value in values),
                " / ".join(f"{value['squared_error']:.3f}" for value in values),
                " / ".join(f"{value['percent_within_5deg']}%" for value in values),
                " / ".join(f"{value['percent_confident']}%" for value in values),
            )
        )
    return table(("frames", "observed", "squared error", "within 5°", "confident"), rows)


def simulation_options(_: str) -> str:
    """Return the table of the options of `glint simulate`, explained by their docstrings."""
    (tree,) = ast.parse(dedent(inspect.getsource(CaptureOptions))).body
    assert isinstance(tree, ast.ClassDef)
    rows = []
    for field, text in pairwise(tree.body):
        if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr) and field.value is not None:
            assert isinstance(field.target, ast.Name)
            assert isinstance(text.value, ast.Constant)
            rows.append((field.target.id, ast.unparse(field.value).lower(), " ".join(str(text.value.value).split())))
    return table(("option", "default", "meaning"), rows)


def pair_text(pair: Sequence[float], digits: int) -> str:
    """Return two errors as they stand in tables."""
    return " / ".join(f"{value:.{digits}f}" for value in pair)


def table(heads: Sequence[str], rows: Iterable[Row]) -> str:
    """Return a Markdown table, with a line feed at its end."""
    lines = [f"| {' | '.join(heads)} |", "|" + "---|" * len(heads)]
    lines += [re.sub(r"(?<=\|)  (?=\|)", " ", f"| {' | '.join(map(str, row))} |") for row in rows]
    return "\n".join(lines) + "\n"


def cells(text: str) -> list[tuple[str, ...]]:
    """Return the cells of a Markdown table, heads first, without the line between them and the rows."""
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    return [
        tuple(cell.strip() for cell in line.strip().removeprefix("|").removesuffix("|").split("|")) for line in lines
    ]


TABLES: Mapping[str, Callable[[str], str]] = {
    "stages": stages,
    "arrays": arrays,
    "parameters": parameters,
    "former-names": former_names,
    "main-errors": main_errors,
    "squared-errors": squared_errors,
    "degrees": degrees,
    "depth-and-confidence": depth_and_confidence,
    "degraded": degraded,
    "perturbed": perturbed,
    "labelling": labelling,
    "sweep-length": sweep_length,
    "simulation-options": simulation_options,
}
"""Functions by the name of their block, given the table that stands there."""

if __name__ == "__main__":
    for path in documents():
        before = path.read_text(encoding="utf-8")
        after = with_current_tables(before)
        if after != before:
            path.write_text(after, encoding="utf-8")
            print(f"rewritten: {path.relative_to(ROOT)}")
