"""Export of a version as files that other programs read: a folder per capture, the object's model beside them."""

import csv
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from glint.storage.errors import StoreError
from glint.storage.export.camera import camera_facts, camera_of
from glint.storage.export.image_files import encode_normals, write_exr, write_png, write_tiff
from glint.storage.export.mesh_files import with_asset_facts
from glint.storage.export.object_page import PageCapture, capture_page_of, object_page, version_facts
from glint.storage.export.replaced_folder import merge_into, output_errors, temporary_folder_beside
from glint.storage.export.report import capture_report, code_names
from glint.storage.export.stored_capture import entry_of, model_result, ordered_stages
from glint.storage.inputs.lp_file import write_lights
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository, Version
from glint.storage.versions.stage_results import WHOLE_OBJECT, StageResult, check_file_name, check_name

REPORT_FILE = "report.json"
"""File of a capture's folder that names the object, by which a later export recognizes the folder."""


@dataclass(frozen=True, slots=True)
class ExportRecord:
    """A finished export: `files` is their number, `size` their bytes together."""

    object_id: str
    version: str
    snapshot: str
    out: str
    captures: tuple[str, ...]
    files: int
    size: int


def export(location: Location, object_id: str, out: Path, version: str | None = None) -> ExportRecord:
    """Write a version (the newest by default) to the folder `out`.

    Files appear whole or not at all. An earlier export of the same object is replaced; other files in `out` stay.

    Raises:
        StoreError: no such object or version, a result or file is missing or damaged, or `out` holds another folder
            with a capture's name; OutputError: `out` cannot be written.
    """
    repository = ObjectRepository.open(location, object_id, create=False)
    chosen = repository.version(version)
    model = model_result(repository, chosen)
    with output_errors(out, object_id), temporary_folder_beside(out) as content:
        for capture in chosen.stages:
            folder = content if capture == WHOLE_OBJECT else content / check_name(capture, "capture")
            folder.mkdir(exist_ok=True)
            results = repository.load_capture(capture, chosen.snapshot)
            stages = {stage: results[stage] for stage in ordered_stages(results, chosen)}
            facts = {"object": object_id, "version": chosen.name}
            if capture != WHOLE_OBJECT:
                facts["capture"] = capture
            stored = {
                name: with_asset_facts(data, facts) if name.endswith(".glb") else data
                for name, data in _read_files(stages).items()
            }
            if capture != WHOLE_OBJECT:
                _write_capture(location, object_id, capture, chosen, stages, folder)
                camera = camera_of(stages, entry_of(chosen, capture), model.record if model else None)
                if camera is not None:
                    _write_json(folder / "camera.json", camera_facts(camera))
            _write_files(stored, folder, f"{object_id}/{capture}")
        files = [path for path in content.rglob("*") if path.is_file()]
        size = sum(path.stat().st_size for path in files)
        merge_into(content, out, object_id, REPORT_FILE)
    captures = tuple(capture for capture in chosen.stages if capture != WHOLE_OBJECT)
    return ExportRecord(object_id, chosen.name, chosen.snapshot, str(out), captures, len(files), size)


def _write_capture(
    location: Location,
    object_id: str,
    capture: str,
    version: Version,
    stages: Mapping[str, StageResult],
    folder: Path,
) -> None:
    for stage in ("mask", "labels"):
        if stage not in stages:
            raise StoreError(f"{object_id}/{capture} has no {stage} in {version.name}", "run the object again")
    arrays: dict[str, Any] = {"mask": stages["mask"].read("mask"), "normals": stages["labels"].read("normals")}
    _write_normals(arrays["normals"], folder)
    write_png(folder / "mask.png", arrays["mask"])
    arrays["observed"] = _observed(stages, arrays["mask"])
    write_png(folder / "observed.png", arrays["observed"])
    names = code_names(stages["labels"].record.get("provenance"))
    _write_labels(stages["labels"], names, arrays, folder)
    if _has(stages, "silhouette", "initial"):
        np.save(folder / "initial_normals.npy", stages["silhouette"].read("initial"))
    if _has(stages, "depth", "depth"):
        arrays["depth"] = stages["depth"].read("depth")
        np.save(folder / "depth.npy", arrays["depth"])
        write_tiff(folder / "depth.tiff", arrays["depth"])
    if "lights" in stages:
        arrays["reason"] = _write_lights(stages["lights"], folder)
    report = capture_report(object_id, capture, version_facts(version), stages, arrays)
    _write_json(folder / REPORT_FILE, report)
    html = capture_page_of(location, version, PageCapture(capture, stages, report))
    (folder / "report.html").write_text(html, encoding="utf-8")


def _write_normals(normals: np.ndarray, folder: Path) -> None:
    np.save(folder / "normals.npy", normals)
    write_png(folder / "normals.png", encode_normals(normals))
    write_exr(folder / "normals.exr", normals)


def _write_labels(labels: StageResult, names: dict[int, str], arrays: dict[str, Any], folder: Path) -> None:
    for name in ("provenance", "confidence"):
        if name in labels.arrays:
            arrays[name] = labels.read(name)
    if "provenance" in arrays:
        write_png(folder / "provenance.png", arrays["provenance"])
        _write_json(folder / "provenance.json", {str(code): name for code, name in sorted(names.items())})
    if "confidence" in arrays:
        np.save(folder / "confidence.npy", arrays["confidence"])


def _write_lights(lights: StageResult, folder: Path) -> np.ndarray:
    """Write half_vectors.npy, lights.lp and frames.csv; return the frames' reason codes (T,)."""
    reason, directions = lights.read("reason"), lights.read("lights")
    np.save(folder / "half_vectors.npy", lights.read("half_vectors"))
    accepted = np.flatnonzero(reason == 0)
    digits = max(6, len(str(len(reason) - 1)))
    write_lights(folder / "lights.lp", directions[accepted], [f"{frame:0{digits}d}" for frame in accepted])
    names = code_names(lights.record.get("reasons"))
    with (folder / "frames.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("frame", "accepted", "reason"))
        for frame, code in enumerate(reason.tolist()):
            table.writerow(
                (frame, "true" if code == 0 else "false", "" if code == 0 else names.get(code, f"code {code}"))
            )
    return reason


def _observed(stages: Mapping[str, StageResult], mask: np.ndarray) -> np.ndarray:
    """Return the object's pixels (H, W) at which a highlight was observed at least once."""
    if not _has(stages, "clusters", "observations"):
        return np.zeros_like(mask)
    return np.asarray((stages["clusters"].read("observations") > 0) & mask)


def _read_files(stages: Mapping[str, StageResult]) -> dict[str, bytes]:
    """Return the content of the stages' files by name."""
    files: dict[str, bytes] = {}
    for result in stages.values():
        for name in result.files:
            if check_file_name(name, result.name) in files:
                raise _duplicate_error(result.name, name)
            files[name] = result.read_file(name)
    return files


def _write_files(files: Mapping[str, bytes], folder: Path, owner: str) -> None:
    for name, data in files.items():
        if (folder / name).exists():
            raise _duplicate_error(owner, name)
        (folder / name).write_bytes(data)


def _duplicate_error(owner: str, name: str) -> StoreError:
    return StoreError(f"{owner} names a file {name!r} twice", "run the object again")


def _has(stages: Mapping[str, StageResult], stage: str, array: str) -> bool:
    return stage in stages and array in stages[stage].arrays


def export_page(location: Location, object_id: str, out: Path, version: str | None = None) -> ExportRecord:
    """Write the page of a version (the newest by default): one HTML file, `out`, or OBJECT.html in the folder `out`.

    Raises:
        StoreError: no such object or version, or a result is missing or damaged; OutputError: it cannot be written.
    """
    repository = ObjectRepository.open(location, object_id, create=False)
    chosen = repository.version(version)
    html = object_page(repository, chosen).encode()
    path = out if out.suffix == ".html" else out / f"{object_id}.html"
    with output_errors(out, object_id), temporary_folder_beside(path) as folder:
        (folder / path.name).write_bytes(html)
        (folder / path.name).replace(path)
    captures = tuple(capture for capture in chosen.stages if capture != WHOLE_OBJECT)
    return ExportRecord(object_id, chosen.name, chosen.snapshot, str(path), captures, 1, len(html))


def _write_json(path: Path, content: Any) -> None:
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
