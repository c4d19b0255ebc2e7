"""`glint demo`: two simulated objects from video to surface."""

import json
import sys
from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from glint.flows.cli.options import Json
from glint.flows.cli.output import echo

DEMO_SHAPES = ("hemisphere", "bird")
FRAMES, SCALE = 1500, 0.8
SPHERE_RADIUS_PX = 40.0
"""The middle of what the guide asks for: 60 to 100 pixels across."""


def demo(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder for the catalogue, the store and the export.")
    ] = Path("glint-demo"),
    as_json: Json = False,
) -> None:
    """Simulate a small catalogue, run it, export it, and print where the results are."""
    from glint.flows.pipeline.run import run
    from glint.flows.reporting.console import open_console
    from glint.flows.reporting.events import Message
    from glint.flows.runtime.prefect_server import start_server

    start_server()
    from glint.storage.export.export import export
    from glint.storage.locations.location import Location
    from glint.tasks.simulation.simulate import CaptureOptions, simulate

    options = CaptureOptions(frames=FRAMES, scale=SCALE, sphere_radius=SPHERE_RADIUS_PX)
    captures, store = folder / "captures", Location.parse(folder / "store")
    with open_console(as_json) as console:
        for shape in DEMO_SHAPES:
            if not (captures / shape / "front" / "video.mp4").exists():
                console.emit(Message(f"simulating a video of {FRAMES:,} frames", shape))
                simulate(shape, captures, options)
        summary = run(captures / "catalogue.yaml", store.uri, console)
    from glint.flows.cli.tables import run_table, show, summary_json

    reports = []
    for item in summary.result.objects:
        if item.version is not None:
            written = export(store, item.object_id, folder / "export" / item.object_id)
            reports += [str(Path(written.out) / capture / "report.html") for capture in written.captures]
    if as_json:
        echo(json.dumps(summary_json(summary) | {"reports": reports}))
    else:
        show(run_table(summary))
        echo("reports:")
        for report in reports:
            echo(f"  {report}")
        echo(f"dashboard: {summary.page} (`glint dashboard --stop` stops its server)")
        echo(f"next: glint evaluate {quote(str(captures / 'catalogue.yaml'))} (errors against the ground truth)")
    sys.exit(1 if summary.result.failed else 0)
