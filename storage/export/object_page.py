"""The page of an object or of one capture, built from what a version holds."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from glint.storage.errors import StoreError
from glint.storage.export.page.capture_data import CaptureData, Detail, capture_data
from glint.storage.export.page.model_data import model_data
from glint.storage.export.page.page import MAX_DATA_BYTES, PageContent, page
from glint.storage.export.report import capture_report, report_arrays
from glint.storage.export.stored_capture import entry_of, ordered_stages
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository, Version
from glint.storage.versions.stage_results import WHOLE_OBJECT, StageResult

MODEL_TRIANGLES = 300_000
"""Triangles of a model on a page: smooth on a screen of 2,000 pixels."""
SHARED_PAGE_FRAMES = 12
"""Photographs of each capture on a page of several, before their detail is reduced."""
MIN_SCALE = 0.05
"""Scale of the arrays' sides to which the detail is not reduced: nothing could be recognized there."""
ADDRESS = re.compile(r"(/|[a-z0-9]+://)[^\n]+")
"""A path or an address, as versions record those of inputs."""
MODEL_FIGURES = {
    "volume": "Volume",
    "area": "Area",
    "seen": "Share of the surface known",
    "unseen": "Share seen by no view",
}
"""Quantities of a model's record that the page shows, and their names."""


@dataclass(frozen=True, slots=True)
class PageCapture:
    """A capture of a page: its stages in the order in which they ran, the arrays of its report, and the report."""

    name: str
    stages: Mapping[str, StageResult]
    arrays: Mapping[str, np.ndarray]
    report: Mapping[str, Any]


def capture_page_of(location: Location, version: Version, capture: PageCapture) -> str:
    """Return the page of one capture.

    Raises:
        StoreError: a result is damaged.
    """
    report = capture.report
    still, coverage = _pictures(capture.stages)
    return page(
        PageContent(
            title=f"{report['object']} / {capture.name}",
            version=report["version"],
            catalogue=report["catalogue"],
            reports=[report],
            captures=_fitted(location, version, [capture], 0),
            still=still,
            coverage=coverage,
        )
    )


def object_page(repository: ObjectRepository, version: Version) -> str:
    """Return the page of an object: its captures, and its model where it has one.

    It is for others to read: it names files without their folders, which tell of people, projects and machines.

    Raises:
        StoreError: a result is missing or damaged.
    """
    captures = [page_capture(repository, version, name) for name in sorted(version.captures)]
    model, rows = None, []
    if WHOLE_OBJECT in version.stages:
        merged = repository.load(WHOLE_OBJECT, "model", version.snapshot)
        model, rows = model_data(merged, MODEL_TRIANGLES), _model_figures(merged.record)
    still, coverage = _pictures(captures[0].stages) if captures else (None, None)
    return page(
        PageContent(
            title=repository.object_id,
            version=_without_folders(version_facts(version)),
            catalogue=_without_folders(version.metadata.get("catalogue")),
            reports=[_without_folders(capture.report) for capture in captures],
            captures=_fitted(repository.location, version, captures, model.size if model else 0),
            model=model,
            model_figures=rows,
            still=still,
            coverage=coverage,
        )
    )


def page_capture(repository: ObjectRepository, version: Version, name: str) -> PageCapture:
    """Load what the page of a capture needs.

    Raises:
        StoreError: a result is missing or damaged.
    """
    results = repository.load_capture(name, version.snapshot)
    stages = {stage: results[stage] for stage in ordered_stages(results, version)}
    for stage in ("mask", "labels"):
        if stage not in stages:
            raise StoreError(f"{repository.object_id}/{name} has no {stage} in {version.name}", "run the object again")
    arrays = report_arrays(stages)
    report = capture_report(repository.object_id, name, version_facts(version), stages, arrays)
    return PageCapture(name, stages, arrays, report)


def version_facts(version: Version) -> dict[str, Any]:
    """Return what reports say of a version."""
    facts = {"name": version.name, "snapshot": version.snapshot, "time": version.time.isoformat(timespec="seconds")}
    return facts | {"metadata": version.metadata}


def _without_folders(content: Any) -> Any:
    """Return JSON values in which paths and addresses of files are the names of the files."""
    if isinstance(content, Mapping):
        return {key: _without_folders(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_without_folders(value) for value in content]
    if isinstance(content, str) and ADDRESS.match(content):
        return content.rstrip("/").rpartition("/")[2]
    return content


def _fitted(location: Location, version: Version, captures: Sequence[PageCapture], taken: int) -> list[CaptureData]:
    """Return the captures' data with as much detail as a page has room for, beside `taken` bytes of a model.

    Raises:
        StoreError: it has no room for so many captures.
    """
    detail = Detail() if len(captures) == 1 else Detail(frames=SHARED_PAGE_FRAMES)
    while detail.scale > MIN_SCALE:
        shown: list[CaptureData] = []
        for capture in captures:
            entry = entry_of(version, capture.name)
            shown.append(capture_data(location, capture.name, capture.stages, entry, detail))
            if sum(data.size for data in shown) + taken > MAX_DATA_BYTES:
                break
        else:
            return shown
        detail = detail.reduced()
    raise StoreError(f"no page holds {len(captures)} captures", "export the files instead, without --page")


def _pictures(stages: Mapping[str, StageResult]) -> tuple[bytes | None, bytes | None]:
    """Return the stored pictures for readers without a viewer: relit, and coverage of the lights."""
    if "surface" not in stages:
        return None, None
    surface = stages["surface"]
    relit, coverage = (
        surface.read_file(name) if name in surface.files else None for name in ("relit_left.png", "coverage.png")
    )
    return relit, coverage


def _model_figures(record: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return quantity and value of what a model's record says."""
    unit = record.get("unit") or "pixels"
    units = {"volume": f" {unit}³", "area": f" {unit}²"}
    rows = []
    for name, label in MODEL_FIGURES.items():
        value = record.get(name)
        if isinstance(value, int | float):
            rows.append((label, f"{value:,.4g}{units[name]}" if name in units else f"{value:.0%}"))
    views = record.get("views") or []
    rows.append(("Views", ", ".join(f"{view['capture']} ({view.get('pose')})" for view in views) or "none recorded"))
    left_out = [str(view["name"]) for view in record.get("left_out") or []]
    return rows + ([("Views left out", ", ".join(left_out))] if left_out else [])
