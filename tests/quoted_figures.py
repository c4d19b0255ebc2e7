"""Take the figures of captures that the documents quote from what `glint evaluate` has measured.

    python -m tests.quoted_figures glint-evaluation/evaluation.json && python -m tests.generated_docs

The presets' captures, those of `glint evaluate --degraded`, and the matrix of `--perturbed` (perturbed.json) replace
the ones that docs/evaluation.json has already; the other figures of that file are kept.
"""

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tests.generated_docs import DEGRADED_COLUMNS, FIGURES_FILE, METHODS

BLOCKS = {
    name: re.compile(rf'^ "{name}": \{{\n.*?^ \}}', re.DOTALL | re.MULTILINE)
    for name in ("captures", "degraded", "perturbed")
}
"""The parts of docs/evaluation.json that are replaced."""


def quoted_degraded(measured: Mapping[str, Any], shape: str) -> dict[str, Any]:
    """Return what is quoted of a degraded capture of a shape."""
    methods = {errors["method"]: errors for errors in measured["methods"]}
    names = [method for other, method in DEGRADED_COLUMNS if other == shape]
    return {name: _squared(methods[name]) for name in names} | {"confident": _confident(measured)}


def quoted(measured: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is quoted of a capture, rounded as in the tables, of its figures by `glint evaluate`."""
    methods = {errors["method"]: errors for errors in measured["methods"]}
    depth, labels = measured["depth"], measured["labels"]
    return {
        "frames": measured["frames"],
        "pixels": measured["size"],
        "squared_error": {name: _squared(methods[name]) for name in METHODS},
        "glint_within_and_beyond_42deg": [round(measured["near"], 4), round(measured["far"], 4)],
        "degrees_whole_mask": {name: _degrees(methods[name]["whole"]) for name in METHODS},
        "depth": {
            "mean_px": round(depth["mean"], 2),
            "rms_px": round(depth["rms"], 2),
            "mean_percent_of_diagonal": round(100.0 * depth["relative"], 2),
        },
        "confident": _confident(measured),
        "labels": {
            "precision_percent": round(100.0 * labels["precision"], 1),
            "recall_percent": round(100.0 * labels["recall"], 1),
        },
    }


def written(part: str, entries: Mapping[str, Any]) -> str:
    """Return a part of docs/evaluation.json: a line for each figure or row of figures that a table shows."""
    lines = [f' "{part}": {{']
    for name, figures in entries.items():
        lines.append(f'  "{name}": {{')
        for key, value in figures.items():
            if isinstance(value, dict) and all(isinstance(row, dict | list) for row in value.values()):
                rows = ",\n".join(f"    {json.dumps(title)}: {json.dumps(row)}" for title, row in value.items())
                lines.append(f'   "{key}": {{\n{rows}\n   }},')
            else:
                lines.append(f'   "{key}": {json.dumps(value)},')
        lines[-1] = lines[-1].removesuffix(",")
        lines.append("  },")
    lines[-1] = "  }"
    return "\n".join([*lines, " }"])


def main() -> None:
    """Replace the figures."""
    if len(sys.argv) != 2:
        sys.exit("usage: python -m tests.quoted_figures EVALUATION.json")
    text = FIGURES_FILE.read_text(encoding="utf-8")
    figures = json.loads(text)
    evaluated = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    if isinstance(evaluated, dict):
        figures["perturbed"] |= evaluated
        evaluated = []
    measured = {capture["name"]: capture for capture in evaluated}
    captures, defects = figures["captures"], figures["degraded"]
    captures |= {name: quoted(measured[name]) for name in captures if name in measured}
    for defect, shapes in defects.items():
        for shape in shapes:
            name = f"{shape}-{defect.replace(',', '')}/front".replace(" ", "-")
            if name in measured:
                shapes[shape] = quoted_degraded(measured[name], shape)
    for part, block in BLOCKS.items():
        text = written(part, figures[part]).join(block.split(text, maxsplit=1))
    FIGURES_FILE.write_text(text, encoding="utf-8")


def _squared(errors: Mapping[str, Any]) -> list[float]:
    return [round(errors[region]["squared"], 4) for region in ("data", "whole")]


def _confident(measured: Mapping[str, Any]) -> dict[str, Any]:
    share, right = measured["trusted"]
    return {
        "percent_of_pixels": round(100.0 * share),
        "percent_within_5deg": None if right is None else round(100.0 * right, 1),
    }


def _degrees(errors: Mapping[str, Any]) -> dict[str, Any]:
    shares = [round(100.0 * share) for share in errors["within"]]
    return {
        "mean": round(errors["mean"], 2),
        "median": round(errors["median"], 2),
        "percent_within_5_11.25_22.5": shares,
    }


if __name__ == "__main__":
    main()
