"""The evaluation of models as a table in Markdown and as JSON."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from glint.tasks.evaluation.models import METHODS, ModelEvaluation


def markdown(models: Sequence[ModelEvaluation]) -> str:
    """Distances to the true surface, of each method."""
    lines = [
        "",
        "Models against the true surface: F-score at 0.5% / 1% of the diagonal, mean chamfer distance in % of it (from"
        " the model, from the truth), mean cosine of normals.",
        "",
        "| object | views | left out | method | F 0.5% / 1% | chamfer | normals | watertight | triangles | seconds |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for each in models:
        for method in METHODS:
            score = each.scores[method]
            ours = method == METHODS[-1]
            cells = [
                each.name,
                str(each.views),
                ", ".join(each.left_out) or "none",
                method,
                " / ".join(f"{value:.3f}" for value in score.f_scores),
                f"{score.chamfer:.2%} ({score.accuracy:.2%}, {score.completeness:.2%})",
                f"{score.normals:.3f}",
                "yes" if score.watertight else "no",
                str(each.triangles) if ours else "",
                f"{each.seconds:.1f}" if ours else "",
            ]
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def as_json(models: Sequence[ModelEvaluation]) -> list[dict[str, Any]]:
    """All figures; distances as shares of the true diagonal."""
    return [asdict(each) for each in models]
