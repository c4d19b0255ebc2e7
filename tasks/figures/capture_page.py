"""The page of a capture: pictures of its result, warnings, stages and files, as markdown."""

import base64
from collections.abc import Mapping, Sequence
from itertools import batched
from shlex import quote

import cv2
import numpy as np

from glint.storage.export.image_files import (
    PROVENANCE_PALETTE,
    colour_codes,
    colour_normals,
    colour_values,
    encode_png,
)
from glint.storage.export.report import code_names
from glint.storage.locations.location import Location
from glint.storage.versions.stage_results import FileInfo, StageResult
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.stage import StageRecord
from glint.tasks.engine.stage_warning import by_cost
from glint.tasks.figures.markdown import plain

MAX_PAGE_CHARS = 300_000
"""Characters of a page, pictures included: the dashboard fetches it whole."""
MAX_RUN_CHARS = 100_000_000
"""Characters of the pages of all captures of a run: the pictures of large catalogues are smaller."""
MAX_EDGE_PX, MIN_EDGE_PX = 320, 40
"""Longer side of a picture: the first, and the least to which it is reduced to fit the page."""

STORED_PICTURES = {
    "relit_left.png": "Relit from the left",
    "relit_right.png": "Relit from the right",
    "relit_surface.png": "The surface from another side",
    "coverage.png": "Coverage: directions of the light on the hemisphere",
}
"""Pictures that the surface stage stores, and their captions."""


def capture_page(context: CaptureContext, records: Sequence[StageRecord], n_captures: int = 1) -> str:
    """Return the page of a capture whose stages have all ended; `n_captures` may get pages in this run."""
    labels, surface, mask = context.load("labels"), context.load("surface"), context.load("mask").read("mask")
    provenance = np.where(mask, labels.read("provenance"), 0)
    pictures = _label_pictures(labels, provenance) | _stored_pictures(surface)
    legend = _legend(provenance[mask], code_names(labels.record.get("provenance")))
    if context.edits is not None:
        legend += f". Edited by a person: {context.edits} (edit {context.edits.revision})"
    files = file_lines(context.location, context.object_id, surface.files)
    max_chars = min(MAX_PAGE_CHARS, MAX_RUN_CHARS // n_captures)
    return picture_page(context.name, pictures, records, files, legend, max_chars)


def picture_page(
    title: str,
    pictures: Mapping[str, np.ndarray],
    records: Sequence[StageRecord],
    files: Sequence[str] = (),
    legend: str = "",
    max_chars: int = MAX_PAGE_CHARS,
    max_edge_px: int = MAX_EDGE_PX,
) -> str:
    """Return a page of warnings, pictures with a legend, stages and lines about files.

    pictures: uint8 (H, W, 3) RGB by caption; reduced to `max_edge_px` pixels a side, and further until the page has at
    most `max_chars` characters.
    """
    head = "\n".join([f"# {plain(title)}", "", *_warnings(records)])
    text = "\n".join([*([plain(legend), ""] if legend else []), "## Stages", "", *_stages(records), "", *files])
    edge = max_edge_px
    while True:
        page = f"{head}\n\n{_gallery(pictures, edge)}\n\n{text}\n"
        if len(page) <= max_chars or edge <= MIN_EDGE_PX:
            return page
        edge = edge * 3 // 4


def file_lines(location: Location, object_id: str, files: Mapping[str, FileInfo]) -> list[str]:
    """Return the table of an object's files and the command that exports them."""
    rows = [f"| {plain(name)} | {file.size / 1e3:,.0f} kB |" for name, file in sorted(files.items())]
    command = f"glint export {object_id} --out {object_id}-export --store {quote(location.uri)}"
    lines = ["## Files", "", "| file | size |", "|---|---:|", *rows, ""]
    return [
        *lines,
        "To export all files, with normals, depth, confidence, lights and reports, once the object has a version:",
        "",
        f"    {command}",
    ]


def _legend(provenance: np.ndarray, names: Mapping[int, str]) -> str:
    """Return the origins of the normals of the object's pixels (N,) in words."""
    shares = [f"{names.get(code, code)} {_share(provenance == code)}" for code in np.unique(provenance)]
    return "Origin of the normals: " + ", ".join(shares)


def _label_pictures(labels: StageResult, provenance: np.ndarray) -> dict[str, np.ndarray]:
    """Return pictures of the labels by caption; provenance (H, W) is 0 outside the object."""
    return {
        "Normals: x red, y green, z towards the camera blue": colour_normals(labels.read("normals")),
        "Origin of the normals": colour_codes(provenance, PROVENANCE_PALETTE),
        "Confidence that the error is below 5°: 0 blue, 1 yellow": colour_values(labels.read("confidence"), 0, 1),
    }


def _stored_pictures(surface: StageResult) -> dict[str, np.ndarray]:
    """Return pictures that the surface stage has stored, by caption."""
    pictures = {}
    for name, caption in STORED_PICTURES.items():
        if name in surface.files:
            data = np.frombuffer(surface.read_file(name), np.uint8)
            picture = cv2.imdecode(data, cv2.IMREAD_COLOR_RGB)
            assert picture is not None, f"the surface stage stored no picture under {name}"
            pictures[caption] = picture
    return pictures


def _gallery(pictures: Mapping[str, np.ndarray], edge: int) -> str:
    """Return two pictures a row, each under its caption."""
    cells = []
    for caption, picture in pictures.items():
        data = base64.b64encode(encode_png(_within(picture, edge))).decode()
        cells.append((plain(caption), f"![{plain(caption)}](data:image/png;base64,{data})"))
    tables = []
    for pair in batched(cells, 2):
        captions, shown = zip(*pair, strict=True)
        tables.append(f"| {' | '.join(captions)} |\n|{'---|' * len(pair)}\n| {' | '.join(shown)} |")
    return "\n\n".join(tables)


def _stages(records: Sequence[StageRecord]) -> list[str]:
    lines = ["| stage | seconds | counts |", "|---|---:|---|"]
    for record in records:
        seconds = "up to date" if record.cached else f"{record.seconds:.2f}"
        counts = ", ".join(f"{name} {value:,.10g}" for name, value in record.counts.items())
        lines.append(f"| {plain(record.stage)} | {seconds} | {plain(counts)} |")
    return [*lines, f"| all | {sum(0 if record.cached else record.seconds for record in records):.2f} | |"]


def _warnings(records: Sequence[StageRecord]) -> list[str]:
    warnings = by_cost(warning for record in records for warning in record.warnings)
    lines = [f"- **{plain(warning.cause)}**: {plain(warning.message)}" for warning in warnings]
    return ["## Warnings", "", *lines, ""] if lines else []


def _within(picture: np.ndarray, edge: int) -> np.ndarray:
    longest = max(picture.shape[:2])
    if longest <= edge:
        return picture
    size = tuple(max(1, round(side * edge / longest)) for side in picture.shape[1::-1])
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def _share(selected: np.ndarray) -> str:
    return f"{selected.mean():.0%}" if selected.size else "none"
