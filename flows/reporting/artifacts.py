"""What the dashboard shows of a run: a page of pictures and figures for each capture, a table of the catalogue."""

import base64
import html
import re
from collections.abc import Mapping, Sequence
from itertools import batched
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from prefect.artifacts import create_markdown_artifact, create_table_artifact

from glint.storage.export.image_files import colour_codes, colour_normals, colour_values, encode_png
from glint.storage.export.report import PALETTE, code_names
from glint.storage.locations.location import Location
from glint.storage.versions.stage_results import FileInfo, StageResult
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.stage import Record

if TYPE_CHECKING:
    from glint.flows.results import CaptureResult, ObjectResult, RunResult

LARGEST_PAGE = 300_000
"""Characters of a page, pictures included: the dashboard fetches it whole."""
ALL_PAGES = 100_000_000
"""Characters of the pages of all captures of a run: the pictures of large catalogues are smaller."""
MOST_ROWS = 500
"""Rows of a run's table, and entries of its list of problems."""

_STORED = {
    "relit_left.png": "Relit from the left",
    "relit_right.png": "Relit from the right",
    "relit_surface.png": "The surface from another side",
    "coverage.png": "Coverage: where on the hemisphere the lamp has been",
}
"""Pictures that the surface stage stores, and their captions."""

_WIDEST = 320
_SMALLEST = 40


def capture_artifact(work: Workspace, records: Sequence[Record], captures: int = 1) -> None:
    """Put the page of a capture whose stages are all done beside its flow run; `captures` may get pages in this run."""
    labels, surface, mask = work.load("labels"), work.load("surface"), work.load("mask").read("mask")
    provenance = np.where(mask, labels.read("provenance"), 0)
    pictures = _drawn(labels, provenance) | _stored(surface)
    legend = _legend(provenance[mask], code_names(labels.record.get("provenance")))
    files, largest = file_lines(work.location, work.object_id, surface.files), min(LARGEST_PAGE, ALL_PAGES // captures)
    page = capture_page(work.name, pictures, records, files, legend, largest)
    create_markdown_artifact(page, key=artifact_key(work.name), description=work.name)


def catalogue_artifact(name: str, result: "RunResult") -> None:
    """Put the table of a catalogue's captures beside its flow run, and the problems of those that failed."""
    order = {"failed": 0, "done": 1, "unchanged": 2}
    table = sorted((row for each in result.objects for row in _rows(each)), key=lambda row: order[row["state"]])
    left_out = f", {len(table) - MOST_ROWS:,} more captures not shown" if len(table) > MOST_ROWS else ""
    create_table_artifact(
        table[:MOST_ROWS], key=artifact_key(f"catalogue {name}"), description=plain(f"{name}{left_out}")
    )
    if result.failed:
        create_markdown_artifact(problems_page(result.failed), key=artifact_key(f"problems {name}"))


def problems_page(failed: "Sequence[CaptureResult]") -> str:
    """Markdown of what is wrong with captures and what to do about it."""
    lines = [f"- **{plain(each.name)}**: {plain(each.error)}: {plain(each.remedy)}" for each in failed[:MOST_ROWS]]
    lines += [f"- and {len(failed) - MOST_ROWS:,} more"] * (len(failed) > MOST_ROWS)
    return "\n".join(["# Captures without a result", "", *lines, ""])


def capture_page(
    title: str,
    pictures: Mapping[str, np.ndarray],
    records: Sequence[Record],
    files: Sequence[str] = (),
    legend: str = "",
    largest: int = LARGEST_PAGE,
    widest: int = _WIDEST,
) -> str:
    """Markdown of a capture: warnings, pictures and their legend, stages, lines about its files.

    `pictures` by caption, uint8 (H, W, 3), have at most `widest` pixels a side and are made smaller until the page has
    at most `largest` characters.
    """
    head = "\n".join([f"# {plain(title)}", "", *_warnings(records)])
    text = "\n".join([*([plain(legend), ""] if legend else []), "## Stages", "", *_stages(records), "", *files])
    edge = widest
    while True:
        page = f"{head}\n\n{_gallery(pictures, edge)}\n\n{text}\n"
        if len(page) <= largest or edge <= _SMALLEST:
            return page
        edge = edge * 3 // 4


def artifact_key(name: str) -> str:
    """The key of an artifact: lower-case letters, digits and dashes."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-") or "capture"


def plain(text: str) -> str:
    """Any text as one line of markdown that shows it as it is."""
    one_line = html.escape(" ".join(text.split()), quote=False)
    return re.sub(r"([\\`*_{}\[\]()#+!|~:-])", r"\\\1", one_line)


def _legend(provenance: np.ndarray, names: Mapping[int, str]) -> str:
    """Where the normals of the object's pixels (N,) come from, in words."""
    shares = [f"{names.get(code, code)} {_share(provenance == code)}" for code in np.unique(provenance)]
    return "Where normals come from: " + ", ".join(shares)


def _drawn(labels: StageResult, provenance: np.ndarray) -> dict[str, np.ndarray]:
    """Pictures of the labels by their captions; provenance (H, W), 0 outside the object."""
    return {
        "Normals: x red, y green, z towards the camera blue": colour_normals(labels.read("normals")),
        "Where they come from": colour_codes(provenance, PALETTE),
        "Confidence that the error is below 5°: 0 blue, 1 yellow": colour_values(labels.read("confidence"), 0, 1),
    }


def _stored(surface: StageResult) -> dict[str, np.ndarray]:
    """Pictures that the surface stage has stored, by their captions."""
    pictures = {}
    for name, caption in _STORED.items():
        if name in surface.files:
            data = np.frombuffer(surface.read_file(name), np.uint8)
            picture = cv2.imdecode(data, cv2.IMREAD_COLOR_RGB)
            assert picture is not None, f"the surface stage stored no picture under {name}"
            pictures[caption] = picture
    return pictures


def file_lines(location: Location, object_id: str, files: Mapping[str, FileInfo]) -> list[str]:
    """Return the table of an object's files and the command that exports them."""
    rows = [f"| {plain(name)} | {info.size / 1e3:,.0f} kB |" for name, info in sorted(files.items())]
    command = f"glint export {object_id} --out {object_id} --store {location.uri}"
    lines = ["## Files", "", "| file | size |", "|---|---:|", *rows, ""]
    return [
        *lines,
        "To export all files, with normals, depth, confidence, lights and reports, once the object has a version:",
        "",
        f"    {command}",
    ]


def _rows(result: "ObjectResult") -> list[dict[str, Any]]:
    version = result.version.name if result.version is not None else "none"
    return [
        {
            "capture": each.name,
            "state": "failed" if each.error else "unchanged" if each.cached else "done",
            "version": version,
            "seconds": round(each.seconds, 2),
            "frames": each.count("frames", "frames"),
            "frames with a light": each.count("lights", "accepted"),
            "observed pixels": each.count("clusters", "observed pixels"),
            "warnings": len(each.warnings),
        }
        for each in result.captures
    ]


def _gallery(pictures: Mapping[str, np.ndarray], edge: int) -> str:
    """Two pictures a row, each under its caption."""
    cells = []
    for caption, picture in pictures.items():
        data = base64.b64encode(encode_png(_within(picture, edge))).decode()
        cells.append((plain(caption), f"![{plain(caption)}](data:image/png;base64,{data})"))
    tables = []
    for pair in batched(cells, 2):
        captions, shown = zip(*pair, strict=True)
        tables.append(f"| {' | '.join(captions)} |\n|{'---|' * len(pair)}\n| {' | '.join(shown)} |")
    return "\n\n".join(tables)


def _stages(records: Sequence[Record]) -> list[str]:
    lines = ["| stage | seconds | counts |", "|---|---:|---|"]
    for record in records:
        seconds = "unchanged" if record.cached else f"{record.seconds:.2f}"
        counts = ", ".join(f"{name} {value:,.10g}" for name, value in record.counts.items())
        lines.append(f"| {plain(record.stage)} | {seconds} | {plain(counts)} |")
    return [*lines, f"| all | {sum(0 if each.cached else each.seconds for each in records):.2f} | |"]


def _warnings(records: Sequence[Record]) -> list[str]:
    lines = [f"- **{plain(record.stage)}**: {plain(warning)}" for record in records for warning in record.warnings]
    return ["## Warnings", "", *lines, ""] if lines else []


def _within(picture: np.ndarray, edge: int) -> np.ndarray:
    longest = max(picture.shape[:2])
    if longest <= edge:
        return picture
    size = tuple(max(1, round(side * edge / longest)) for side in picture.shape[1::-1])
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def _share(which: np.ndarray) -> str:
    return f"{which.mean():.0%}" if which.size else "none"
