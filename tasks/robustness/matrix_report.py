"""The robustness matrix as a table in Markdown and as JSON."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from glint.tasks.robustness.cells import Cell, baselines, named_causes, outcome

NOT_APPLICABLE = "-"


def matrix_table(cells: Sequence[Cell]) -> str:
    """Return the matrix, a row for each perturbation and a column for each capture, and what the warnings say.

    A cell holds the mean error in degrees, the share of the mask that is confident, of these the share within 5
    degrees, the causes that warnings name, and how it ends.
    """
    return "\n".join(matrix_lines(matrix_as_json(cells))) + "\n\n" + "\n".join(_messages(cells)) + "\n"


def matrix_lines(matrix: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> list[str]:
    """Return the lines of the table of a matrix as `matrix_as_json` gives it."""
    captures = list(dict.fromkeys(name for row in matrix.values() for name in row))
    lines = ["| " + " | ".join(["perturbation", *captures]) + " |", "|" + "---|" * (len(captures) + 1)]
    for name, row in matrix.items():
        texts = (_cell_text(row[capture]) if capture in row else NOT_APPLICABLE for capture in captures)
        lines.append("| " + " | ".join([name.replace("-", " "), *texts]) + " |")
    counts = Counter(cell["outcome"] for row in matrix.values() for cell in row.values())
    lines += ["", ", ".join(f"{count} {name}" for name, count in sorted(counts.items())) + "."]
    return lines


def matrix_as_json(cells: Sequence[Cell]) -> dict[str, dict[str, dict[str, Any]]]:
    """Return all figures by perturbation and capture as JSON values, rounded as in the table; None: no value."""
    usual = baselines(cells)
    matrix: dict[str, dict[str, dict[str, Any]]] = {}
    for cell in cells:
        baseline = usual.get(cell.object_id)
        matrix.setdefault(cell.perturbation, {})[cell.object_id] = {
            "error_deg": _rounded(cell.error_deg, 2),
            "confident": _rounded(cell.confident_share, 4),
            "right": _rounded(cell.right_share, 4),
            "warns_of": sorted({warning.cause for warning in cell.warnings}),
            "named": list(named_causes(cell, baseline)),
            "refused": bool(cell.refusal),
            "outcome": outcome(cell, baseline),
        }
    return matrix


def _cell_text(cell: Mapping[str, Any]) -> str:
    if cell["refused"]:
        return f"refused: {cell['outcome']}"
    right = "" if cell["right"] is None else f", {cell['right']:.0%} right"
    causes = f" ({', '.join(cell['warns_of'])})" if cell["warns_of"] else ""
    return f"{cell['error_deg']:.1f}°, {cell['confident']:.0%}{right}{causes}: {cell['outcome']}"


def _messages(cells: Sequence[Cell]) -> list[str]:
    """Return lines with the refusal or the warnings of each cell."""
    lines = []
    for cell in cells:
        name = f"{cell.object_id}/{cell.perturbation}"
        lines += [f"- {name} refused: {cell.refusal}"] if cell.refusal else []
        lines += [
            f"- {name}: {warning.message} ({warning.cause}, {warning.cost_deg:.1f}°)" for warning in cell.warnings
        ]
    return lines


def _rounded(value: float, digits: int) -> float | None:
    return round(value, digits) if np.isfinite(value) else None
