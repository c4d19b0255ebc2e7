"""`glint evaluate`: run captures, compare them with their ground truth, write a table, JSON and pictures."""

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from glint.flows.cli.options import Json, Only
from glint.flows.cli.output import echo

if TYPE_CHECKING:
    from glint.flows.reporting.events import Sink
    from glint.flows.results import RunResult
    from glint.storage.errors import InputError
    from glint.tasks.robustness.cells import Cell
    from glint.tasks.robustness.matrix import CaptureVariants

QUICK_SCALE, QUICK_FRAMES = 0.5, 500
"""Size and length of the presets with --quick."""
PERTURBED_SHAPES: Sequence[str] = ("hemisphere", "fish", "wine-glass")
PERTURBED_QUICK_SHAPES: Sequence[str] = ("hemisphere",)
PERTURBED_OPTIONS = {"scale": 0.5, "frames": 600, "seed": 3}
PERTURBED_QUICK_OPTIONS = {"scale": 0.4, "frames": 400, "seed": 3, "rays": 1}
"""Shapes of perturbed captures and their options, at full size and with --quick."""


def evaluate(
    file: Annotated[
        str | None,
        typer.Argument(
            metavar="CATALOGUE",
            help="Catalogue of captures with ground truth (default: the presets, simulated).",
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Simulate smaller and shorter captures; takes about a minute.")
    ] = False,
    degraded: Annotated[
        bool, typer.Option("--degraded", help="Simulate degraded captures instead of the presets.")
    ] = False,
    perturbed: Annotated[
        bool,
        typer.Option("--perturbed", help="Perturb each input of the captures: errors, confidence, what warnings say."),
    ] = False,
    ablation: Annotated[
        bool, typer.Option("--ablation", help="Evaluate also with each ingredient of the labelling switched off.")
    ] = False,
    questions: Annotated[
        int,
        typer.Option(
            "--questions",
            metavar="N",
            min=0,
            help="Ask N questions of each capture, answered from the truth, and measure what the answers are worth.",
        ),
    ] = 0,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the table, the JSON and the pictures.")
    ] = Path("glint-evaluation"),
    store: Annotated[
        str | None, typer.Option("--store", metavar="URI", help="The store of the runs (default: `store` in --out).")
    ] = None,
    only: Only = None,
    as_json: Json = False,
) -> None:
    """Measure errors against the ground truth, beside baselines: the paper's Tables 2 and 3."""
    from glint.flows.pipeline.run import run
    from glint.flows.reporting.console import open_console
    from glint.storage.locations.location import Location
    from glint.tasks.engine.references import check_truth

    simulations = _given({"--quick": quick, "--degraded": degraded})
    if file is not None and not perturbed and simulations:
        raise typer.BadParameter(f"{simulations} is for simulated captures: leave it out, or CATALOGUE")
    excluded = _given({"--degraded": degraded, "--ablation": ablation, "--questions": questions > 0})
    if perturbed and excluded:
        raise typer.BadParameter(f"--perturbed and {excluded} exclude each other: leave one out")
    out.mkdir(parents=True, exist_ok=True)
    address = Location.parse(store or str(out / "store")).uri
    if perturbed:
        _evaluate_perturbed(file, quick, out, address, only or (), as_json)
        return
    with open_console(as_json) as console:
        if file is not None:
            check_truth(file, only or ())
        path = file or _simulated(out, quick, degraded, only or (), console)
        summary = run(path, address, console, only=only or ())
        table, faults = _write_evaluation(path, address, summary.result, out, ablation, questions, console)
    if table and as_json:
        captures = json.loads((out / "evaluation.json").read_text(encoding="utf-8"))
        echo(json.dumps({"kind": "evaluation", "captures": captures}))
    elif table:
        echo(table)
        echo(f"written: {out / 'evaluation.md'}, evaluation.json, evaluation.png, reliability.png")
    for failure in summary.result.failed:
        echo(f"{failure.name} failed: {failure.error}\n  -> {failure.remedy}", colour="red", err=True)
    for name, fault in faults.items():
        echo(f"{name} is not evaluated: {fault.message}\n  -> {fault.remedy}", colour="red", err=True)
    sys.exit(1 if summary.result.failed or faults else 0)


def _given(options: Mapping[str, bool]) -> str:
    """Return the names of those options that were given, as a text."""
    return ", ".join(name for name, given in options.items() if given)


def _simulated(out: Path, quick: bool, degraded: bool, only: Sequence[str], console: "Sink") -> Path:
    """Simulate the chosen presets, or all degraded captures; return the path of their catalogue.

    Raises:
        InputError: there is no such preset.
    """
    from glint.flows.cli.simulate import simulate_degraded, simulate_presets
    from glint.storage.errors import InputError
    from glint.tasks.simulation.simulate import PRESETS

    if degraded:
        return simulate_degraded(out / "degraded", quick, console)
    chosen = {name.partition("/")[0] for name in only} or set(PRESETS)
    if unknown := sorted(chosen - set(PRESETS)):
        raise InputError(f"--only {unknown[0]} is not a preset", f"name one of {', '.join(PRESETS)}")
    shapes = [shape for shape in PRESETS if shape in chosen]
    if quick:
        return simulate_presets(out / "quick", shapes, QUICK_SCALE, QUICK_FRAMES, console)
    return simulate_presets(out / "presets", shapes, 1.0, None, console)


def _write_evaluation(
    catalogue: str | Path,
    store: str,
    result: "RunResult",
    out: Path,
    ablation: bool,
    questions: int,
    console: "Sink",
) -> "tuple[str, Mapping[str, InputError]]":
    """Evaluate what succeeded, and write it to the folder.

    Returns: the table, empty if nothing has a ground truth; and by capture or model why its ground truth cannot be
    used.
    """
    from glint.flows.reporting.events import Message
    from glint.storage.export.image_files import write_png
    from glint.tasks.engine.references import load_catalogue
    from glint.tasks.evaluation import evaluate_run, report
    from glint.tasks.evaluation.evaluation_sheet import evaluation_sheet, reliability_diagram
    from glint.tasks.evaluation.questions_report import questions_as_json, questions_table

    def message(capture: str, text: str) -> None:
        console.emit(Message(text, capture))

    done: Sequence[tuple[str, str]] = [(item.object_id, item.capture_id) for item in result.captures if not item.error]
    contexts = evaluate_run.contexts_of(str(catalogue), store, result.run, done)
    evaluations, faults = evaluate_run.evaluate_captures(contexts, message)
    contexts = [context for context in contexts if context.name not in faults]
    models, model_faults = evaluate_run.evaluate_models(contexts, load_catalogue(catalogue))
    faults |= model_faults
    ablations = evaluate_run.ablate_captures(contexts, message) if ablation else {}
    answered = evaluate_run.question_captures(contexts, questions, message) if questions else []
    if not evaluations:
        return "", faults
    table = report.capture_tables(evaluations)
    if models:
        table += report.model_table(models)
    if ablations:
        table += report.ablation_table(ablations)
    if answered:
        table += questions_table(answered)
    (out / "evaluation.md").write_text(table, encoding="utf-8")
    captures = report.captures_as_json(evaluations) + report.models_as_json(models)
    worth = questions_as_json(answered)
    captures = [capture | worth.get(capture["name"], {}) for capture in captures]
    (out / "evaluation.json").write_text(json.dumps(captures, indent=2) + "\n", encoding="utf-8")
    write_png(out / "evaluation.png", evaluation_sheet(evaluations))
    write_png(out / "reliability.png", reliability_diagram(evaluations))
    return table, faults


def _evaluate_perturbed(
    file: str | None, quick: bool, out: Path, store: str, only: Sequence[str], as_json: bool
) -> None:
    """Measure the robustness matrix of a catalogue, else of simulated captures, and print it.

    only: OBJECT or OBJECT/PERTURBATION.
    """
    from glint.flows.pipeline.dispatch import scatter_map
    from glint.flows.reporting.console import open_console
    from glint.flows.reporting.events import StageProgress
    from glint.flows.runtime.dask_cluster import Cluster
    from glint.storage.catalogue.loading import write
    from glint.tasks.robustness.cells import measure_cell
    from glint.tasks.robustness.matrix import matrix_tasks, perturbed_catalogue
    from glint.tasks.robustness.matrix_report import matrix_as_json, matrix_table

    folder = out.absolute() / "perturbed"
    with open_console(as_json) as console, Cluster(modules=("glint.tasks.pipeline",)) as cluster:
        captures = _perturbed_captures(file, quick, out, console)
        tasks = matrix_tasks(captures, folder, store, quick, only)
        cells: list[Cell] = []
        results = scatter_map(cluster.client, "matrix", "cells", measure_cell, tasks, None)
        for number, cell in enumerate(results, 1):
            cells += [] if cell is None else [cell]
            console.emit(StageProgress("matrix", "cells", number, len(tasks), unit="cells"))
    table, matrix = matrix_table(cells), matrix_as_json(cells)
    (out / "perturbed.md").write_text(table, encoding="utf-8")
    (out / "perturbed.json").write_text(json.dumps(matrix, indent=1) + "\n", encoding="utf-8")
    write(perturbed_catalogue(cells), folder / "catalogue.yaml")
    if as_json:
        echo(json.dumps({"kind": "perturbed", "matrix": matrix}))
    else:
        echo(table)
        echo(f"written: {out / 'perturbed.md'}, perturbed.json; the perturbed captures: {folder}/catalogue.yaml")


def _perturbed_captures(file: str | None, quick: bool, out: Path, console: "Sink") -> "Mapping[str, CaptureVariants]":
    """Return the captures to perturb: those of a catalogue, else simulated ones."""
    from glint.flows.cli.simulate import simulate_variants
    from glint.tasks.engine.references import load_catalogue
    from glint.tasks.robustness.matrix import recorded_captures, simulated_captures, simulated_variants

    if file is not None:
        return recorded_captures(load_catalogue(file))
    shapes = PERTURBED_QUICK_SHAPES if quick else PERTURBED_SHAPES
    usual = PERTURBED_QUICK_OPTIONS if quick else PERTURBED_OPTIONS
    variants = simulated_variants(quick)
    path = simulate_variants(out / "simulated", shapes, variants, usual, console)
    return simulated_captures(load_catalogue(path), shapes, variants)
