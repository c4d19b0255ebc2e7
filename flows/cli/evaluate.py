"""`glint evaluate`: run the captures, judge them against their truth, write the table, the JSON and the pictures."""

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from glint.flows.pipeline.run import run
from glint.flows.reporting.console import open_console
from glint.flows.reporting.events import Event, Message
from glint.storage.export.image_files import write_png
from glint.storage.locations.location import Location

if TYPE_CHECKING:
    from glint.flows.results import RunResult
    from glint.tasks.engine.capture_context import Workspace
    from glint.tasks.evaluation.captures import Evaluation
    from glint.tasks.evaluation.models import ModelEvaluation

QUICK_SCALE, QUICK_FRAMES = 0.5, 500
"""Size and length of the presets with --quick."""


def evaluate_catalogue(
    file: str | Path | None,
    quick: bool,
    out: Path,
    store: str | None,
    only: Sequence[str],
    as_json: bool,
    *,
    degraded: bool = False,
    ablation: bool = False,
) -> int:
    """Evaluate a catalogue's captures that have truth; the command's exit status.

    degraded: careless captures instead of the presets; ablation: also with each ingredient of the labelling off.
    """
    out.mkdir(parents=True, exist_ok=True)
    place = Location.parse(store or str(out / "store")).uri
    with open_console(as_json) as display:
        if file is None and degraded:
            from glint.flows.cli.degraded import simulate_degraded

            file = simulate_degraded(out / "degraded", quick, display)
        elif file is None:
            from glint.flows.cli.simulate import simulate_presets

            folder = out / ("quick" if quick else "presets")
            scale, frames = (QUICK_SCALE, QUICK_FRAMES) if quick else (1.0, None)
            file = simulate_presets(folder, scale, frames, display)
        summary = run(file, place, display, only=only)
        from glint.tasks.evaluation import model_report
        from glint.tasks.evaluation import report as evaluation_report

        evaluations = evaluations_of(str(file), place, summary.result, display.emit)
        models = models_of(str(file), place, summary.result)
        ablations = ablations_of(str(file), place, summary.result, display.emit) if ablation else {}
    if evaluations:
        table = evaluation_report.markdown(evaluations)
        if models:
            table += model_report.markdown(models)
        if ablations:
            table += evaluation_report.ablation_table(ablations)
        (out / "evaluation.md").write_text(table, encoding="utf-8")
        facts = evaluation_report.as_json(evaluations) + model_report.as_json(models)
        (out / "evaluation.json").write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
        write_png(out / "evaluation.png", evaluation_report.picture_sheet(evaluations))
        write_png(out / "reliability.png", evaluation_report.reliability_picture(evaluations))
        if as_json:
            typer.echo(json.dumps({"kind": "evaluation", "captures": facts}))
        else:
            typer.echo(table)
            typer.echo(f"written: {out / 'evaluation.md'}, evaluation.json, evaluation.png, reliability.png")
    for failure in summary.result.failed:
        typer.secho(f"{failure.name} failed: {failure.error}\n  -> {failure.remedy}", fg="red", err=True)
    return 1 if summary.result.failed else 0


def evaluations_of(
    catalogue: str, store: str, result: "RunResult", show: Callable[[Event], None]
) -> "list[Evaluation]":
    """Judge what a run gave against the truth, where there is one."""
    from glint.tasks.evaluation.captures import evaluate
    from glint.tasks.pipeline import STAGES

    evaluations = []
    for work in _workspaces(catalogue, store, result):
        found = evaluate(work, tuple(stage.name for stage in STAGES))
        if found is None:
            show(Message("no true normals: not judged", work.name))
        else:
            evaluations.append(found)
    return evaluations


def models_of(catalogue: str, store: str, result: "RunResult") -> "list[ModelEvaluation]":
    """Judge the models of objects whose true surface is known."""
    from itertools import groupby

    from glint.tasks.engine.references import load_catalogue
    from glint.tasks.evaluation.models import evaluate_model

    entries, found = load_catalogue(catalogue), []
    for object_id, works in groupby(_workspaces(catalogue, store, result), lambda work: work.object_id):
        judged = evaluate_model(entries.object(object_id), list(works))
        if judged is not None:
            found.append(judged)
    return found


def ablations_of(
    catalogue: str, store: str, result: "RunResult", show: Callable[[Event], None]
) -> dict[str, dict[str, tuple[float, float]]]:
    """Errors with each ingredient of the labelling switched off, by capture, where there is a truth."""
    from glint.tasks.evaluation.ablation import ablate

    ablations = {}
    for work in _workspaces(catalogue, store, result):
        show(Message("ablation", work.name))
        found = ablate(work)
        if found is not None:
            ablations[work.name] = found
    return ablations


def _workspaces(catalogue: str, store: str, result: "RunResult") -> "Iterator[Workspace]":
    from glint.storage.catalogue.models import MODEL
    from glint.tasks.engine.references import CaptureReference

    address = Location.parse(catalogue).uri
    for each in result.captures:
        if not each.error and each.capture_id != MODEL:
            yield CaptureReference(address, each.object_id, each.capture_id, store, result.run).workspace()
