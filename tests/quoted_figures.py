"""Take the figures of captures that the documents quote from what `glint evaluate` has measured.

    python -m tests.quoted_figures glint-evaluation/evaluation.json && python -m tests.generated_docs

Only captures that docs/evaluation.json has already are replaced; the other figures of that file are kept.
"""

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tests.generated_docs import FIGURES_FILE, METHODS

CAPTURES = re.compile(r'^ "captures": \{\n.*?^ \},\n', re.DOTALL | re.MULTILINE)


def quoted(measured: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is quoted of a capture, rounded as in the tables, of its figures by `glint evaluate`."""
    methods = {errors["method"]: errors for errors in measured["methods"]}
    depth, labels = measured["depth"], measured["labels"]
    return {
        "frames": measured["frames"],
        "pixels": measured["size"],
        "squared_error": {
            name: [round(methods[name][region]["squared"], 4) for region in ("data", "whole")] for name in METHODS
        },
        "glint_within_and_beyond_42deg": [round(measured["near"], 4), round(measured["far"], 4)],
        "degrees_whole_mask": {name: _degrees(methods[name]["whole"]) for name in METHODS},
        "depth": {
            "mean_px": round(depth["mean"], 2),
            "rms_px": round(depth["rms"], 2),
            "mean_percent_of_diagonal": round(100.0 * depth["relative"], 2),
        },
        "confident": {
            "percent_of_pixels": round(100.0 * measured["trusted"][0]),
            "percent_within_5deg": round(100.0 * measured["trusted"][1], 1),
        },
        "labels": {
            "precision_percent": round(100.0 * labels["precision"], 1),
            "recall_percent": round(100.0 * labels["recall"], 1),
        },
    }


def written(captures: Mapping[str, Any]) -> str:
    """Return the captures' part of docs/evaluation.json: a line for each figure that a table shows."""
    lines = [' "captures": {']
    for name, figures in captures.items():
        lines.append(f'  "{name}": {{')
        for key, value in figures.items():
            if key in ("squared_error", "degrees_whole_mask"):
                rows = ",\n".join(f"    {json.dumps(method)}: {json.dumps(row)}" for method, row in value.items())
                lines.append(f'   "{key}": {{\n{rows}\n   }},')
            else:
                lines.append(f'   "{key}": {json.dumps(value)},')
        lines[-1] = lines[-1].removesuffix(",")
        lines.append("  },")
    lines[-1] = "  }"
    return "\n".join([*lines, " },", ""])


def main() -> None:
    """Replace the figures."""
    if len(sys.argv) != 2:
        sys.exit("usage: python -m tests.quoted_figures EVALUATION.json")
    text = FIGURES_FILE.read_text(encoding="utf-8")
    captures = json.loads(text)["captures"]
    measured = {capture["name"]: capture for capture in json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))}
    captures |= {name: quoted(measured[name]) for name in captures if name in measured}
    FIGURES_FILE.write_text(CAPTURES.sub(lambda _: written(captures), text, count=1), encoding="utf-8")


def _degrees(errors: Mapping[str, Any]) -> dict[str, Any]:
    shares = [round(100.0 * share) for share in errors["within"]]
    return {
        "mean": round(errors["mean"], 2),
        "median": round(errors["median"], 2),
        "percent_within_5_11.25_22.5": shares,
    }


if __name__ == "__main__":
    main()
