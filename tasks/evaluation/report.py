"""An evaluation as tables in Markdown and as JSON: captures, models, and the ablation of the labelling."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from glint.tasks.algorithms.evaluation.metrics import ANGLE_LIMITS_DEG
from glint.tasks.evaluation.captures import METHODS, Evaluation, MethodErrors
from glint.tasks.evaluation.models import MODEL_METHODS, ModelEvaluation


def capture_tables(evaluations: Sequence[Evaluation]) -> str:
    """Return tables of squared errors (the paper's Table 3), degrees, depth and confidence, seconds (its Table 2)."""
    parts = ["# Errors against truth", ""]
    parts += ["Mean squared difference of unit normals, data region (M > 0) / whole mask.", ""]
    parts += _squared_errors(evaluations)
    parts += ["", "Degrees over the whole mask: mean, median, share within 5 / 11.25 / 22.5.", ""]
    parts += _degrees(evaluations)
    parts += ["", "Depth (offset fitted per component), confidence and labels of the stored result.", ""]
    parts += _depth_and_confidence(evaluations)
    warnings = [
        f"- {evaluation.name}: {warning.message}" for evaluation in evaluations for warning in evaluation.warnings
    ]
    if warnings:
        parts += ["", "Warnings.", "", *warnings]
    parts += ["", "Seconds by stage, and frames per second of all together.", ""]
    parts += _seconds(evaluations)
    return "\n".join(parts) + "\n"


def model_table(models: Sequence[ModelEvaluation]) -> str:
    """Return a table of the distances to the true surface, by object and method."""
    heads = ["object", "views", "left out", "method", "F 0.5% / 1%", "chamfer", "normals", "watertight"]
    rows = []
    for model in models:
        for method in filter(model.scores.__contains__, MODEL_METHODS):
            score, is_stored = model.scores[method], method == MODEL_METHODS[-1]
            rows.append(
                [
                    model.name,
                    model.views,
                    ", ".join(model.left_out) or "none",
                    method,
                    " / ".join(f"{value:.3f}" for value in score.f_scores),
                    f"{score.chamfer:.2%} ({score.accuracy:.2%}, {score.completeness:.2%})",
                    f"{score.normals:.3f}",
                    "yes" if score.watertight else "no",
                    model.triangles if is_stored else "",
                    f"{model.seconds:.1f}" if is_stored else "",
                ]
            )
    title = (
        "Models against the true surface: F-score at 0.5% / 1% of the diagonal, mean chamfer distance in % of it (from"
        " the model, from the truth), mean cosine of normals."
    )
    return "\n".join(["", title, "", *markdown_table([*heads, "triangles", "seconds"], rows)]) + "\n"


def ablation_table(ablations: Mapping[str, Mapping[str, tuple[float, float]]]) -> str:
    """Return a table of errors with each ingredient of the labelling switched off.

    ablations: by capture and ingredient, the squared errors over observed region and whole mask.
    """
    names = list(dict.fromkeys(name for errors in ablations.values() for name in errors))
    rows = []
    for name in names:
        pairs = [errors.get(name) for errors in ablations.values()]
        rows.append([name, *("" if pair is None else f"{pair[0]:.4f} / {pair[1]:.4f}" for pair in pairs)])
    title = "Each ingredient of the labelling switched off: squared error, data region / whole mask."
    return "\n".join(["", title, "", *markdown_table(["labelling", *ablations], rows)]) + "\n"


def captures_as_json(evaluations: Sequence[Evaluation]) -> list[dict[str, Any]]:
    """Return all figures of captures as JSON values; no arrays, None for values that are not finite."""
    return [_capture_as_json(evaluation) for evaluation in evaluations]


def models_as_json(models: Sequence[ModelEvaluation]) -> list[dict[str, Any]]:
    """Return all figures of models as JSON values; distances as shares of the true diagonal."""
    return [asdict(model) for model in models]


def _capture_as_json(evaluation: Evaluation) -> dict[str, Any]:
    values = {
        "name": evaluation.name,
        "frames": evaluation.frames,
        "size": evaluation.size,
        "methods": tuple(map(_method_as_json, evaluation.methods)),
        "depth": evaluation.depth,
        "trusted": (evaluation.confident_share, evaluation.confident_right_share),
        "near": evaluation.within_42deg,
        "far": evaluation.beyond_42deg,
        "labels": evaluation.labels,
        "reliability": evaluation.reliability,
        "warnings": [warning.to_json() for warning in evaluation.warnings],
        "seconds": evaluation.seconds,
    }
    return {key: _plain(value) for key, value in values.items()} | {"degrees_within": list(ANGLE_LIMITS_DEG)}


def _method_as_json(errors: MethodErrors) -> dict[str, Any]:
    return {
        "method": errors.method,
        "data": _plain(errors.observed_region),
        "whole": _plain(errors.whole_mask),
    }


def _squared_errors(evaluations: Sequence[Evaluation]) -> list[str]:
    rows = []
    for evaluation in evaluations:
        methods = [evaluation.method(name) for name in METHODS]
        row = [evaluation.name, f"{evaluation.frames}", f"{evaluation.size[0]} x {evaluation.size[1]}"]
        row += [f"{errors.observed_region.squared:.4f} / {errors.whole_mask.squared:.4f}" for errors in methods]
        rows.append([*row, f"{evaluation.within_42deg:.4f} / {evaluation.beyond_42deg:.4f}"])
    return markdown_table(["capture", "frames", "pixels", *METHODS, "glint within / beyond 42°"], rows)


def _degrees(evaluations: Sequence[Evaluation]) -> list[str]:
    rows = []
    for evaluation in evaluations:
        row = [evaluation.name]
        for name in METHODS:
            errors = evaluation.method(name).whole_mask
            shares = " / ".join(f"{share:.0%}" for share in errors.within)
            row.append(f"{errors.mean:.2f}, {errors.median:.2f}, {shares}")
        rows.append(row)
    return markdown_table(["capture", *METHODS], rows)


def _depth_and_confidence(evaluations: Sequence[Evaluation]) -> list[str]:
    rows = []
    for evaluation in evaluations:
        errors = evaluation.depth
        depth = ["", "", ""]
        if errors is not None:
            depth = [f"{errors.mean:.2f}", f"{errors.rms:.2f}", f"{errors.relative:.2%}"]
        shares = [evaluation.confident_right_share, evaluation.labels.precision, evaluation.labels.recall]
        shown = ["" if np.isnan(share) else f"{share:.1%}" for share in shares]
        rows.append([evaluation.name, *depth, f"{evaluation.confident_share:.0%}", *shown])
    heads = ["depth, mean px", "RMS px", "mean of diagonal", "confidence >= 0.95", "of these within 5°"]
    return markdown_table(["capture", *heads, "labels' precision", "recall"], rows)


def _seconds(evaluations: Sequence[Evaluation]) -> list[str]:
    stages = list(dict.fromkeys(stage for evaluation in evaluations for stage in evaluation.seconds))
    rows = []
    for evaluation in evaluations:
        total = sum(evaluation.seconds.values())
        by_stage = (f"{evaluation.seconds.get(stage, 0.0):.2f}" for stage in stages)
        rows.append([evaluation.name, *by_stage, f"{total:.1f}", f"{evaluation.frames / max(total, 1e-9):.0f}"])
    return markdown_table(["capture", *stages, "all", "frames/s"], rows)


def markdown_table(heads: Sequence[str], rows: Sequence[Sequence[object]]) -> list[str]:
    """Return the lines of a Markdown table."""
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    return lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows]


def _plain(value: Any) -> Any:
    """Return a value as JSON holds it: dataclasses as objects, tuples as lists, NaN as None."""
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    if hasattr(value, "__dataclass_fields__"):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    return value
