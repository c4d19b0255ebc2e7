"""`glint demo`: two simulated objects from video to surface, and where to look."""

import json
from pathlib import Path

import typer

from glint.flows.pipeline.run import run
from glint.flows.reporting.console import open_console
from glint.flows.reporting.events import Message

SHAPES = ("hemisphere", "bird")
FRAMES, SCALE = 1500, 0.8


def run_demo(folder: Path, as_json: bool) -> int:
    """Simulate, run, export; the command's exit status."""
    from glint.flows.runtime.prefect_server import start_server

    start_server()
    from glint.storage.export.export import export
    from glint.storage.locations.location import Location
    from glint.tasks.simulation.simulate import CaptureOptions, simulate

    captures, store = folder / "captures", Location.parse(folder / "store")
    with open_console(as_json) as display:
        for shape in SHAPES:
            if not (captures / shape / "front" / "video.mp4").exists():
                display.emit(Message(f"simulating a video of {FRAMES:,} frames", shape))
                simulate(shape, captures, CaptureOptions(frames=FRAMES, scale=SCALE))
        summary = run(captures / "catalogue.yaml", store.uri, display)
    from glint.flows.cli.tables import run_table, show, summary_json

    reports = []
    for each in summary.result.objects:
        if each.version is not None:
            made = export(store, each.object_id, folder / "export" / each.object_id)
            reports += [str(Path(made.out) / capture / "report.html") for capture in made.captures]
    if as_json:
        typer.echo(json.dumps(summary_json(summary) | {"reports": reports}))
    else:
        show(run_table(summary))
        typer.echo("look at the results:")
        for report in reports:
            typer.echo(f"  {report}")
        typer.echo(f"  {summary.page}  (dashboard; `glint dashboard --stop` ends its server)")
        typer.echo(f"errors against the known truth: glint evaluate {captures / 'catalogue.yaml'}")
    return 1 if summary.result.failed else 0
