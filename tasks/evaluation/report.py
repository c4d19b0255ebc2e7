"""An evaluation as a table in Markdown, as JSON, and as a sheet of pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import cv2
import numpy as np

from glint.storage.export.image_files import colour_normals, colour_values
from glint.tasks.algorithms.evaluation.metrics import ANGLE_LIMITS_DEG
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.evaluation.captures import METHODS, Evaluation

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
    parts += ["", "Depth (offset fitted per component), confidence and labels of the stored result.", ""]
    rows = []
    for each in evaluations:
        depth = ["", "", ""]
        if each.depth is not None:
            depth = [f"{each.depth.mean:.2f}", f"{each.depth.rms:.2f}", f"{each.depth.relative:.2%}"]
        labels = [f"{each.labels.precision:.1%}", f"{each.labels.recall:.1%}"]
        rows.append([each.name, *depth, f"{each.trusted[0]:.0%}", f"{each.trusted[1]:.1%}", *labels])
    heads = ["depth, mean px", "RMS px", "mean of diagonal", "confidence >= 0.95", "of these within 5°"]
    parts += _table(["capture", *heads, "labels' precision", "recall"], rows)
    told = [f"- {each.name}: {warning}" for each in evaluations for warning in each.warnings]
    if told:
        parts += ["", "Warnings.", "", *told]
    parts += ["", "Seconds by stage, and frames per second of all together.", ""]
    stages = list(dict.fromkeys(stage for each in evaluations for stage in each.seconds))
    rows = []
    for each in evaluations:
        total = sum(each.seconds.values())
        by_stage = (f"{each.seconds.get(stage, 0.0):.2f}" for stage in stages)
        rows.append([each.name, *by_stage, f"{total:.1f}", f"{each.frames / max(total, 1e-9):.0f}"])
    parts += _table(["capture", *stages, "all", "frames/s"], rows)
    return "\n".join(parts) + "\n"


def ablation_table(ablations: Mapping[str, Mapping[str, tuple[float, float]]]) -> str:
    """Errors (data / whole) of captures, by name, with each ingredient of the labelling switched off."""
    names = list(dict.fromkeys(name for each in ablations.values() for name in each))
    rows = []
    for name in names:
        pairs = [each.get(name) for each in ablations.values()]
        rows.append([name, *("" if pair is None else f"{pair[0]:.4f} / {pair[1]:.4f}" for pair in pairs)])
    title = "Each ingredient of the labelling switched off: squared error, data region / whole mask."
    return "\n".join(["", title, "", *_table(["labelling", *ablations], rows)]) + "\n"


def as_json(evaluations: Sequence[Evaluation]) -> list[dict[str, Any]]:
    """All figures; no arrays."""
    skipped = ("normals", "truth", "confidence")
    return [
        {each.name: _plain(getattr(one, each.name)) for each in fields(one) if each.name not in skipped}
        | {"degrees_within": list(ANGLE_LIMITS_DEG)}
        for one in evaluations
    ]


def picture_sheet(evaluations: Sequence[Evaluation]) -> np.ndarray:
    """RGB picture: a row for each capture: truth, each method's normals, and under them where they err."""
    rows = []
    for each in evaluations:
        upper = [_cell(colour_normals(each.truth), f"{each.name}: truth")]
        lower = [_cell(colour_values(each.confidence, 0.0, 1.0), f"confidence; errors to {WORST:.0f} degrees:")]
        for name in METHODS:
            errors = each.method(name)
            upper.append(_cell(colour_normals(each.normals[name]), name))
            error = angles(each.normals[name], each.truth)
            title = f"{errors.data.squared:.4f} / {errors.whole.squared:.4f}"
            lower.append(_cell(colour_values(error, 0.0, WORST), title))
        rows += [np.hstack(upper), np.hstack(lower)]
    return np.vstack(rows)


def reliability_picture(evaluations: Sequence[Evaluation], size: int = 420) -> np.ndarray:
    """RGB picture: share of pixels within 5 degrees over confidence, all captures together; areas tell the pixels."""
    picture = np.full((size + 60, size + 60, 3), 255, np.uint8)

    def place(confidence: float, right: float) -> tuple[int, int]:
        return 44 + round(confidence * size), 16 + round((1.0 - right) * size)

    for tick in np.linspace(0.0, 1.0, 6):
        for ends in ((place(tick, 0.0), place(tick, 1.0)), (place(0.0, tick), place(1.0, tick))):
            cv2.line(picture, *ends, (225, 225, 225), 1, cv2.LINE_AA)
        _write(picture, f"{tick:.1f}", (place(tick, 0.0)[0] - 10, size + 32))
        _write(picture, f"{tick:.1f}", (12, place(0.0, tick)[1] + 4))
    _write(picture, "confidence (areas: pixels); upwards: share within 5 degrees", (44, size + 52))
    cv2.line(picture, place(0.0, 0.0), place(1.0, 1.0), (150, 150, 150), 1, cv2.LINE_AA)
    bins = [each for evaluation in evaluations for each in evaluation.reliability]
    total = max(sum(each.pixels for each in bins), 1)
    points = []
    for low in sorted({each.low for each in bins}):
        alike = [each for each in bins if each.low == low]
        pixels = np.array([each.pixels for each in alike], float)
        means = [
            np.average([getattr(each, name) for each in alike], weights=pixels) for name in ("confidence", "right")
        ]
        points.append(place(*map(float, means)))
        cv2.circle(picture, points[-1], 3 + round(40.0 * float(np.sqrt(pixels.sum() / total))), (60, 120, 190), 1)
    cv2.polylines(picture, [np.array(points, np.int32)], False, (60, 120, 190), 2, cv2.LINE_AA)
    return picture


def _write(picture: np.ndarray, text: str, place: tuple[int, int]) -> None:
    cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.4, (30, 30, 30), 1, cv2.LINE_AA)


def _cell(picture: np.ndarray, title: str) -> np.ndarray:
    scale = min((CELL - 4) / picture.shape[1], (CELL - 4) / picture.shape[0])
    size = max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_NEAREST)
    cell = np.full((CELL + 22, CELL, 3), 255, np.uint8)
    left, top = (CELL - size[0]) // 2, 22 + (CELL - size[1]) // 2
    cell[top : top + size[1], left : left + size[0]] = small
    _write(cell, title, (4, 15))
    return cell


def _table(heads: Sequence[str], rows: Sequence[Sequence[object]]) -> list[str]:
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    return lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows]


def _plain(value: Any) -> Any:
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    if hasattr(value, "__dataclass_fields__"):
        return {each.name: _plain(getattr(value, each.name)) for each in fields(value)}
    return value
