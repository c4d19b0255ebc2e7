"""The `glint` command. Commands import what they need when they run: `glint --help` answers at once."""

import json
import os
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from glint.flows.runtime import signals

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Surfaces of transparent objects from videos of their highlights.",
    epilog="Exit status: 0 done, 1 some captures failed, 2 wrong use, an unusable catalogue or store.",
)

STORE_HELP = "The store: a folder, s3://bucket/key or az://container/key (default: $GLINT_STORE, else ./glint-store)."
EVALUATE_HELP = "Captures with truth (default: the paper's six, simulated)."
SHAPE_HELP = "hemisphere, cylinder, jug, fish, wine-glass, water-glass, bird; `all`: the paper's six."
Store = Annotated[str | None, typer.Option("--store", metavar="URI", help=STORE_HELP)]
Json = Annotated[bool, typer.Option("--json", help="For machines: JSON lines on standard output.")]
CatalogueFile = Annotated[
    str, typer.Argument(metavar="CATALOGUE", help="The catalogue's YAML file: a path, s3://.. or az://..")
]
ObjectId = Annotated[str, typer.Argument(metavar="OBJECT", help="The object's id in the catalogue.")]
Only = Annotated[
    list[str] | None, typer.Option("--only", metavar="OBJECT[/CAPTURE]", help="Only this one; may be repeated.")
]
Scheduler = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="A running Dask scheduler, tcp://host:8786 (default: a local cluster)."),
]
Workers = Annotated[
    int | None, typer.Option(min=1, help="Processes of the local cluster (default: one per processor).")
]


def main() -> None:
    """Run the command line; errors that name their remedy, and files, are told in two lines, without a trace.

    To be terminated is to be interrupted: workers end, and the dashboard is told.
    """
    signals.install()
    try:
        app()
    except Exception as error:
        message, remedy = getattr(error, "message", error), getattr(error, "remedy", None)
        if remedy is None and isinstance(error, OSError) and error.filename is not None:
            message, remedy = f"{error.filename}: {error.strerror}", "check the path and its permissions"
        if remedy is None:
            raise
        typer.secho(f"glint: {message}", fg="red", err=True)
        typer.secho(f"  -> {remedy}", err=True)
        sys.exit(2)


@app.command()
def demo(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where to put catalogue, store and export.")] = Path(
        "glint-demo"
    ),
    as_json: Json = False,
) -> None:
    """Simulate a small catalogue, run it, and show where to look."""
    from glint.flows.cli.demo import run_demo

    sys.exit(run_demo(folder, as_json))


@app.command()
def simulate(
    shape: Annotated[
        str,
        typer.Argument(
            metavar="SHAPE",
            help="hemisphere, cylinder, jug, fish, wine-glass, water-glass, bird; `all` for the paper's six.",
        ),
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of the catalogue; shapes that are there stay.")
    ],
    frames: Annotated[int | None, typer.Option(min=2, help="Frames (default: as many as in the paper).")] = None,
    seed: Annotated[int, typer.Option(help="Of the lamp's path, the noise and the room.")] = 0,
    views: Annotated[int, typer.Option(min=1, max=360, help="Views round a turntable.")] = 1,
    scale: Annotated[float, typer.Option(min=0.1, max=8.0, help="Size relative to the paper's.")] = 1.0,
    others: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Another option; see docs/evaluation.md.")
    ] = None,
) -> None:
    """Render captures of transparent objects with their truth, as a catalogue that `glint run` takes."""
    from glint.flows.cli.simulate import simulate_shapes

    simulate_shapes(shape, out, frames=frames, seed=seed, views=views, scale=scale, others=others or ())


@app.command()
def catalogue(
    folder: Annotated[
        str,
        typer.Argument(metavar="FOLDER", help="One sub-folder per object, with its footage; also s3://.. or az://.."),
    ],
    out: Annotated[str | None, typer.Option("--out", metavar="FILE", help="Default: FOLDER/catalogue.yaml.")] = None,
) -> None:
    """Write the catalogue of a folder of captures."""
    from glint.storage.catalogue.loading import from_folder, write
    from glint.storage.errors import InputError
    from glint.storage.inputs.digests import exists
    from glint.storage.locations.location import Location

    target = Location.parse(out) if out else Location.parse(folder).child("catalogue.yaml")
    if exists(target):
        raise InputError(f"{target.uri} exists already", "name another file with --out, or remove it")
    made = from_folder(folder)
    write(made, target)
    shown = out or f"{folder.rstrip('/')}/catalogue.yaml"
    typer.echo(f"{shown}: {len(made.objects)} objects, {sum(len(each.captures) for each in made.objects)} captures")
    typer.echo(f"next: glint check {shown}")


@app.command()
def check(
    file: CatalogueFile,
    only: Only = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the pictures.")] = Path("glint-check"),
    store: Store = None,
    as_json: Json = False,
) -> None:
    """Is each capture usable: spheres, lights, coverage, what to film again; before anything expensive."""
    from glint.flows.cli.check import check_catalogue

    sys.exit(check_catalogue(file, chosen_store(store), out, only or [], as_json))


@app.command()
def run(
    file: CatalogueFile,
    store: Store = None,
    only: Only = None,
    scheduler: Scheduler = None,
    workers: Workers = None,
    rehash: Annotated[
        bool, typer.Option("--rehash", help="Read all inputs again, whatever their time of change.")
    ] = False,
    drift: Annotated[
        float | None,
        typer.Option(
            metavar="DEGREES", min=0.0, help="Say so when more than a twentieth of an object's normals move further."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Work through a catalogue: every capture to a surface, every object to a version; goes on where it stopped."""
    from glint.flows.pipeline.run import run as run_all
    from glint.flows.reporting.console import open_display

    place = chosen_store(store)
    with open_display(as_json) as display:
        summary = run_all(
            file, place, display, only=only or [], scheduler=scheduler, workers=workers, rehash=rehash, drift=drift
        )
    from glint.flows.cli.tables import run_table, show, summary_json

    if as_json:
        typer.echo(json.dumps(summary_json(summary)))
    else:
        show(run_table(summary))
        for failure in summary.result.failed:
            typer.secho(f"{failure.name} failed: {failure.error}", fg="red")
            typer.echo(f"  -> {failure.remedy}")
        for moved in summary.result.drifts:
            typer.secho(f"{moved}", fg="yellow")
            typer.echo(f"  -> glint diff {moved.object_id} {moved.before} {moved.after}{_store_option(store)}")
        done = next((each for each in summary.result.objects if each.version is not None), None)
        typer.echo(f"dashboard: {summary.page}")
        if done is not None:
            typer.echo(f"next: glint export {done.object_id} --out {done.object_id}{_store_option(store)}")
    sys.exit(1 if summary.result.failed else 0)


@app.command()
def status(store: Store = None, as_json: Json = False) -> None:
    """Objects and their newest versions; what is running, and how far it is; which captures failed last, and why."""
    from glint.flows.cli.status import tell_status

    tell_status(chosen_store(store), as_json)


@app.command()
def history(object_id: ObjectId, store: Store = None, as_json: Json = False) -> None:
    """Versions of an object, oldest first."""
    from glint.flows.cli.tables import history_rows, show, table_of

    rows = history_rows(chosen_store(store), object_id)
    if as_json:
        _lines(rows)
    else:
        show(table_of(rows, "no versions yet"))


@app.command()
def diff(
    object_id: ObjectId,
    before: Annotated[str, typer.Argument(metavar="A", help="The version before, such as v1.")],
    after: Annotated[str, typer.Argument(metavar="B", help="The version after, such as v2.")],
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for the maps of what moved.")] = None,
    store: Store = None,
    as_json: Json = False,
) -> None:
    """What two versions of an object differ in: angles between normals, depths, parameters, inputs."""
    from glint.flows.cli.diff import diff_object

    sys.exit(diff_object(chosen_store(store), object_id, before, after, out, as_json))


@app.command()
def maintain(
    store: Store = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Remove nothing, tell what would be.")] = False,
    keep: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Versions of each object that stay (default: all).")
    ] = None,
    older_than: Annotated[
        float, typer.Option(metavar="DAYS", min=0.0, help="Only what nothing has needed for so long.")
    ] = 1.0,
    frames_budget: Annotated[
        str | None, typer.Option(metavar="SIZE", help="Of the cache of frames, such as 200GB (default: none).")
    ] = None,
    as_json: Json = False,
) -> None:
    """Remove what no version needs, keep the cache of frames within a budget, and warn before the disk is full."""
    from glint.flows.cli.maintain import maintain_store

    sys.exit(maintain_store(chosen_store(store), dry_run, keep, older_than, frames_budget, as_json))


@app.command()
def rollback(
    object_id: ObjectId,
    version: Annotated[str, typer.Argument(metavar="VERSION", help="v1, v2, ..")],
    store: Store = None,
) -> None:
    """Make an old version the newest one again; nothing is lost."""
    from glint.storage.locations.location import Location
    from glint.storage.versions.repository import ObjectRepository

    made = ObjectRepository.open(Location.parse(chosen_store(store)), object_id, create=False).rollback(version)
    typer.echo(
        f"{object_id} is {made.name} with the content of {version}" if made.created else f"{object_id} is {made.name}"
    )


@app.command()
def export(
    object_id: ObjectId,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder to write to; an older export there is replaced.")
    ],
    version: Annotated[str | None, typer.Option(metavar="V", help="v1, v2, .. (default: the newest).")] = None,
    format_name: Annotated[
        str,
        typer.Option(
            "--format",
            metavar="files|bop|pcd",
            help="files: everything; bop: a BOP dataset (perspective captures in mm); pcd: point clouds.",
        ),
    ] = "files",
    store: Store = None,
    as_json: Json = False,
) -> None:
    """Write a version as files: normals, depth, confidence, lights, meshes, pictures, reports; or for robots."""
    from dataclasses import asdict

    from glint.storage.export.formats import export_as
    from glint.storage.locations.location import Location

    made = export_as(format_name, Location.parse(chosen_store(store)), object_id, out, version)
    if as_json:
        _lines([asdict(made)])
        return
    typer.echo(f"{made.object_id} {made.version}: {made.files} files, {made.size / 1e6:.1f} MB in {made.out}")
    for capture in made.captures if format_name == "files" else ():
        typer.echo(f"look at {Path(made.out) / capture / 'report.html'}")


@app.command()
def evaluate(
    file: Annotated[
        str | None,
        typer.Argument(metavar="[CATALOGUE]", help="Captures with truth (default: the six presets, simulated)."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Small, short presets: about a minute.")] = False,
    degraded: Annotated[bool, typer.Option("--degraded", help="Careless captures instead of the presets.")] = False,
    ablation: Annotated[
        bool, typer.Option("--ablation", help="Also with each ingredient of the labelling switched off.")
    ] = False,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the table, the JSON and the pictures.")
    ] = Path("glint-evaluation"),
    store: Store = None,
    only: Only = None,
    as_json: Json = False,
) -> None:
    """Errors against truth, baselines beside ours, times: the paper's Tables 2 and 3."""
    from glint.flows.cli.evaluate import evaluate_catalogue

    sys.exit(evaluate_catalogue(file, quick, out, store, only or [], as_json, degraded=degraded, ablation=ablation))


@app.command()
def deploy(
    store: Store = None,
    inbox: Annotated[
        str | None, typer.Option(metavar="URI", help="A folder or prefix of sub-folders, looked into every night.")
    ] = None,
    reference: Annotated[
        str | None, typer.Option(metavar="CATALOGUE", help="Captures with truth, judged again every week.")
    ] = None,
    scheduler: Scheduler = None,
    pool: Annotated[str, typer.Option(help="The work pool; made if absent.")] = "glint",
    kind: Annotated[str, typer.Option("--type", help="Of the work pool: process, docker, kubernetes, ..")] = "process",
    image: Annotated[str | None, typer.Option(help="Of docker and kubernetes pools.")] = None,
    timezone: Annotated[str, typer.Option(help="Of the schedules, such as Europe/Berlin.")] = "UTC",
    nightly: Annotated[str, typer.Option(metavar="CRON", help="When the inbox is looked into.")] = "0 2 * * *",
    weekly: Annotated[str, typer.Option(metavar="CRON", help="Reference captures and maintenance.")] = "0 5 * * 0",
    objects: Annotated[int, typer.Option(metavar="N", min=1, help="Objects on demand that run at once.")] = 4,
    drift: Annotated[
        float, typer.Option(metavar="DEGREES", min=0.0, help="By which normals may move unannounced.")
    ] = 0.5,
    frames_budget: Annotated[str | None, typer.Option(metavar="SIZE", help="Of the cache of frames.")] = None,
    notify: Annotated[
        str | None, typer.Option(metavar="TYPE/NAME", help="Notification block told of failures and drift.")
    ] = None,
) -> None:
    """Put schedules on the Prefect server: the inbox nightly, reference and maintenance weekly, objects on demand."""
    from glint.flows.deployments.deploy import Wishes, deploy_and_tell

    wishes = Wishes(
        chosen_store(store), inbox, reference, scheduler, pool, kind, image, timezone, nightly, weekly, frames_budget,
        objects, drift, notify,
    )  # fmt: skip
    deploy_and_tell(wishes)


@app.command()
def dashboard(
    stop: Annotated[bool, typer.Option("--stop", help="End the embedded server.")] = False,
) -> None:
    """The address of the dashboard; starts the embedded server if none runs."""
    from glint.flows.runtime.prefect_server import ensure_server, stop_server

    if stop:
        typer.echo("the embedded server has ended" if stop_server() else "no embedded server was running")
    else:
        typer.echo(ensure_server().ui_url)


def chosen_store(given: str | None) -> str:
    """--store, else $GLINT_STORE, else ./glint-store."""
    return given or os.environ.get("GLINT_STORE") or "glint-store"


def _store_option(given: str | None) -> str:
    return f" --store {given}" if given else ""


def _lines(rows: list[dict[str, Any]]) -> None:
    for row in rows:
        typer.echo(json.dumps(row, default=str))
