"""`glint diff`: two versions of an object beside each other, as figures, changes and maps."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import typer

from glint.flows.cli.tables import show, table_of
from glint.storage.errors import StoreError
from glint.storage.export.image_files import colour_values, write_png
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from glint.tasks.version_diff import Difference, captures_of_both, compare

WIDEST_ANGLE = 20.0
"""Degrees that the map of angles shows in its last colour."""


def diff_object(store: str, object_id: str, before: str, after: str, out: Path | None, as_json: bool) -> int:
    """Compare two versions of an object, and draw maps of what moved into `out`; the command's exit status."""
    repository = ObjectRepository.open(Location.parse(store), object_id, create=False)
    both, gone, added = captures_of_both(repository, before, after)
    rows, changes = list[dict[str, Any]](), list[dict[str, Any]]()
    for capture in both:
        found = compare(repository, capture, before, after)
        rows.append({"capture": capture, **found.figures, "unit of depth": found.unit})
        changes += [
            {"capture": capture, "stage": stage, "what": what, before: was, after: now}
            for stage, what, was, now in found.changes
        ]
        if out is not None:
            draw(found, out / capture)
    facts = {"kind": "diff", "object": object_id, "before": before, "after": after, "captures": rows,
             "changes": changes, "gone": gone, "added": added}  # fmt: skip
    if out is not None:
        (out / "diff.json").write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
    if as_json:
        typer.echo(json.dumps(facts))
        return 0
    show(table_of(rows, f"{before} and {after} share no capture"))
    show(table_of(changes, "no parameter, input or version of code changed"))
    for names, version in ((gone, before), (added, after)):
        if names:
            typer.echo(f"only in {version}: {', '.join(names)}")
    if out is not None:
        typer.echo(f"maps (angles from 0 to {WIDEST_ANGLE:g} degrees, depths, figures): {out}")
    return 0


def draw(found: Difference, folder: Path) -> None:
    """Write `normals_difference.png` (0 to 20 degrees) and `depth_difference.png` (less to more), colour from dark
    blue to yellow, white where the versions cannot be compared.

    Raises:
        StoreError: the folder cannot be written.
    """
    known = np.abs(found.depths[np.isfinite(found.depths)])
    widest = max(float(np.quantile(known, 0.99)) if known.size else 0.0, 1e-6)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_png(folder / "normals_difference.png", colour_values(found.angles, 0.0, WIDEST_ANGLE))
        write_png(folder / "depth_difference.png", colour_values(found.depths, -widest, widest))
    except OSError as error:
        raise StoreError(f"{folder} cannot be written ({error.strerror})", "name another folder with --out") from error
