"""An evaluation as a table in Markdown, as JSON, and as a sheet of pictures."""

from collections.abc import Sequence
from dataclasses import asdict, fields
from typing import Any

import cv2
import numpy as np

from storage.pictures import colour_normals, colour_values
from tasks.algorithms.geometry import angles
from tasks.algorithms.metrics import WITHIN
from tasks.evaluate import METHODS, Evaluation

WORST = 45.0
"""Degrees of error at which the sheet's colours end."""
CELL = 220


def markdown(evaluations: Sequence[Evaluation]) -> str:
    """Tables: squared errors (the paper's Table 2), degrees, depth and confidence, seconds (the paper's Table 3)."""
    parts = ["# Errors against truth", ""]
    parts += ["Mean squared difference of unit normals, data region (M > 0) / whole mask.", ""]
    rows = []
    for each in evaluations:
        methods = [each.method(name) for name in METHODS]
        row = [each.name, f"{each.frames}", f"{each.size[0]} x {each.size[1]}"]
        row += [f"{method.data.squared:.4f} / {method.whole.squared:.4f}" for method in methods]
        rows.append([*row, f"{each.near:.4f} / {each.far:.4f}"])
    parts += _table(["capture", "frames", "pixels", *METHODS, "glint within / beyond 42°"], rows)
    parts += ["", "Degrees over the whole mask: mean, median, share within 5 / 11.25 / 22.5.", ""]
    rows = [
        [each.name]
        + [
            f"{errors.mean:.2f}, {errors.median:.2f}, " + " / ".join(f"{share:.0%}" for share in errors.within)
            for errors in (each.method(name).whole for name in METHODS)
        ]
        for each in evaluations
    ]
    parts += _table(["capture", *METHODS], rows)
    parts += ["", "Depth (offset fitted per component) and confidence of the stored result.", ""]
    rows = []
    for each in evaluations:
        depth = ["", "", ""]
        if each.depth is not None:
            depth = [f"{each.depth.mean:.2f}", f"{each.depth.rms:.2f}", f"{each.depth.relative:.2%}"]
        rows.append([each.name, *depth, f"{each.trusted[0]:.0%}", f"{each.trusted[1]:.1%}"])
    heads = ["depth, mean px", "RMS px", "mean of diagonal", "confidence >= 0.95", "of these within 5°"]
    parts += _table(["capture", *heads], rows)
    parts += ["", "Seconds by stage, and frames per second of all together.", ""]
    stages = list(dict.fromkeys(stage for each in evaluations for stage in each.seconds))
    rows = []
    for each in evaluations:
        total = sum(each.seconds.values())
        by_stage = (f"{each.seconds.get(stage, 0.0):.2f}" for stage in stages)
        rows.append([each.name, *by_stage, f"{total:.1f}", f"{each.frames / max(total, 1e-9):.0f}"])
    parts += _table(["capture", *stages, "all", "frames/s"], rows)
    return "\n".join(parts) + "\n"


def as_json(evaluations: Sequence[Evaluation]) -> list[dict[str, Any]]:
    """All figures; no arrays."""
    skipped = ("normals", "truth")
    return [
        {each.name: _plain(getattr(one, each.name)) for each in fields(one) if each.name not in skipped}
        | {"degrees_within": list(WITHIN)}
        for one in evaluations
    ]


def picture_sheet(evaluations: Sequence[Evaluation]) -> np.ndarray:
    """RGB picture: a row for each capture: truth, each method's normals, and under them where they err."""
    rows = []
    for each in evaluations:
        upper = [_cell(colour_normals(each.truth), f"{each.name}: truth")]
        lower = [_cell(np.full((*each.truth.shape[:2], 3), 255, np.uint8), f"error, 0 to {WORST:.0f} degrees")]
        for name in METHODS:
            errors = each.method(name)
            upper.append(_cell(colour_normals(each.normals[name]), name))
            error = angles(each.normals[name], each.truth)
            title = f"{errors.data.squared:.4f} / {errors.whole.squared:.4f}"
            lower.append(_cell(colour_values(error, 0.0, WORST), title))
        rows += [np.hstack(upper), np.hstack(lower)]
    return np.vstack(rows)


def _cell(picture: np.ndarray, title: str) -> np.ndarray:
    scale = min((CELL - 4) / picture.shape[1], (CELL - 4) / picture.shape[0])
    size = max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_NEAREST)
    cell = np.full((CELL + 22, CELL, 3), 255, np.uint8)
    left, top = (CELL - size[0]) // 2, 22 + (CELL - size[1]) // 2
    cell[top : top + size[1], left : left + size[0]] = small
    cv2.putText(cell, title, (4, 15), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (30, 30, 30), 1, cv2.LINE_AA)
    return cell


def _table(heads: Sequence[str], rows: Sequence[Sequence[object]]) -> list[str]:
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    return lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows]


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return asdict(value) if hasattr(value, "__dataclass_fields__") else value
