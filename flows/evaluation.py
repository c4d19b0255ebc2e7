"""`glint evaluate`: run the captures, judge them against their truth, write the table, the JSON and the pictures."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from flows.progress import Event, open_display
from flows.run import run
from storage.location import Location
from storage.pictures import write_png

if TYPE_CHECKING:
    from flows.outcomes import RunResult
    from tasks.evaluate import Evaluation

QUICK_SCALE, QUICK_FRAMES = 0.5, 500
"""Size and length of the presets with --quick."""


def evaluate_catalogue(
    file: str | Path | None, quick: bool, out: Path, store: str | None, only: Sequence[str], as_json: bool
) -> int:
    """Evaluate a catalogue's captures that have truth; the command's exit status."""
    out.mkdir(parents=True, exist_ok=True)
    place = Location.parse(store or str(out / "store")).uri
    with open_display(as_json) as display:
        if file is None:
            from flows.simulation import simulate_presets

            folder = out / ("quick" if quick else "presets")
            scale, frames = (QUICK_SCALE, QUICK_FRAMES) if quick else (1.0, None)
            file = simulate_presets(folder, scale, frames, display)
        summary = run(file, place, display, only=only)
        from tasks import evaluation_report

        evaluations = evaluations_of(str(file), place, summary.result, display.show)
    if evaluations:
        table = evaluation_report.markdown(evaluations)
        (out / "evaluation.md").write_text(table, encoding="utf-8")
        facts = evaluation_report.as_json(evaluations)
        (out / "evaluation.json").write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
        write_png(out / "evaluation.png", evaluation_report.picture_sheet(evaluations))
        if as_json:
            typer.echo(json.dumps({"kind": "evaluation", "captures": facts}))
        else:
            typer.echo(table)
            typer.echo(f"written: {out / 'evaluation.md'}, evaluation.json, evaluation.png")
    for failure in summary.result.failed:
        typer.secho(f"{failure.name} failed: {failure.error}\n  -> {failure.remedy}", fg="red", err=True)
    return 1 if summary.result.failed else 0


def evaluations_of(
    catalogue: str, store: str, result: "RunResult", show: Callable[[Event], None]
) -> "list[Evaluation]":
    """Judge what a run gave against the truth, where there is one."""
    from tasks.evaluate import evaluate
    from tasks.references import CaptureReference
    from tasks.stages import STAGES

    evaluations, address = [], Location.parse(catalogue).uri
    for each in result.captures:
        if each.error:
            continue
        reference = CaptureReference(address, each.object_id, each.capture_id, store, result.run)
        found = evaluate(reference.workspace(), tuple(stage.name for stage in STAGES))
        if found is None:
            show(Event("message", each.name, text="no true normals: not judged"))
        else:
            evaluations.append(found)
    return evaluations
