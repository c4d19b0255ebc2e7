"""`glint diff`: compare two versions of an object, in figures, changes and maps."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from glint.flows.cli.options import Json, ObjectId, Store, chosen_store
from glint.flows.cli.output import echo


def diff(
    object_id: ObjectId,
    before: Annotated[str, typer.Argument(metavar="A", help="The earlier version, such as v1.")],
    after: Annotated[str, typer.Argument(metavar="B", help="The later version, such as v2.")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder for maps of the differences (default: no maps).")
    ] = None,
    store: Store = None,
    as_json: Json = False,
) -> None:
    """Compare two versions of an object: angles between normals, depths, parameters, inputs."""
    from glint.storage.locations.location import Location
    from glint.storage.versions.repository import ObjectRepository
    from glint.tasks.figures.diff_maps import draw_diff_maps
    from glint.tasks.version_diff import captures_of_both, compare

    repository = ObjectRepository.open(Location.parse(chosen_store(store)), object_id, create=False)
    common, removed, added = captures_of_both(repository, before, after)
    figures, changes = list[dict[str, Any]](), list[dict[str, Any]]()
    for capture in common:
        difference = compare(repository, capture, before, after)
        name = f"{object_id}/{capture}"
        figures.append({"capture": name, **difference.figures, "unit of depth": difference.unit})
        changes += [
            {"capture": name, "stage": stage, "changed": changed, "before": old, "after": new}
            for stage, changed, old, new in difference.changes
        ]
        if out is not None:
            draw_diff_maps(difference, out / capture)
    report = {
        "kind": "diff",
        "object": object_id,
        "before": before,
        "after": after,
        "captures": figures,
        "changes": changes,
        "removed": [f"{object_id}/{capture}" for capture in removed],
        "added": [f"{object_id}/{capture}" for capture in added],
    }
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        (out / "diff.json").write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    if as_json:
        echo(json.dumps(report))
    else:
        _print_report(report, out)


def diff_row(figures: Mapping[str, Any]) -> dict[str, Any]:
    """Return a capture's row of the table from its figures in JSON: angles in degrees, shares in percent."""
    changed, rms = figures["moved beyond 5°"], figures["depth, root mean square"]
    return {
        "capture": figures["capture"],
        "pixels": figures["pixels"],
        "mean angle": _in_degrees(figures["mean angle"]),
        "95% below": _in_degrees(figures["angle of 95%"]),
        "largest": _in_degrees(figures["largest angle"]),
        "beyond 5°": "" if changed is None else f"{changed:.1%}",
        "depth, RMS": "" if rms is None else f"{rms:.3g} {figures['unit of depth']}",
    }


def _in_degrees(angle: float | None) -> str:
    return "" if angle is None else f"{angle:.2f}°"


def in_yaml(value: Any) -> Any:
    """Return a value as a catalogue gives it: null, true and false; others, such as text and numbers, unchanged."""
    return json.dumps(value) if value is None or isinstance(value, bool) else value


def _print_report(report: dict[str, Any], out: Path | None) -> None:
    from glint.flows.cli.tables import show, table_of
    from glint.tasks.figures.diff_maps import MAX_ANGLE_DEG

    before, after = report["before"], report["after"]
    rows = [diff_row(figures) for figures in report["captures"]]
    show(table_of(rows, f"{before} and {after} share no capture"))
    echo()
    headings = {"before": before, "after": after}
    changes = [{headings.get(key, key): in_yaml(value) for key, value in row.items()} for row in report["changes"]]
    show(table_of(changes, "parameters, inputs and code are the same"))
    for captures, version in ((report["removed"], before), (report["added"], after)):
        if captures:
            echo(f"only in {version}: {', '.join(captures)}")
    if out is not None:
        echo(f"maps of normals (0 to {MAX_ANGLE_DEG:g} degrees) and depths, and diff.json: {out}")
