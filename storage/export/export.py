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
from glint.storage.export.object_page import PageCapture, capture_page_of, object_page, page_capture
from glint.storage.export.replaced_folder import merge_into, output_errors, temporary_folder_for
from glint.storage.export.report import code_names
from glint.storage.export.stored_capture import entry_of, model_result
from glint.storage.inputs.lp_file import write_lights
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository, Version
from glint.storage.versions.stage_results import WHOLE_OBJECT, StageResult
from glint.storage.versions.stages.names import check_file_name, check_name

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
    with output_errors(out, object_id), temporary_folder_for(out) as content:
        facts = {"object": object_id, "version": chosen.name}
        for name in chosen.stages:
            if name == WHOLE_OBJECT:
                _write_files(_read_files(repository.load_capture(name, chosen.snapshot), facts), content, object_id)
                continue
            folder = content / check_name(name, "capture")
            folder.mkdir(exist_ok=True)
            capture = page_capture(repository, chosen, name)
            files = _read_files(capture.stages, facts | {"capture": name})
            _write_capture(location, chosen, capture, folder)
            camera = camera_of(capture.stages, entry_of(chosen, name), model.record if model else None)
            if camera is not None:
                _write_json(folder / "camera.json", camera_facts(camera))
            _write_files(files, folder, f"{object_id}/{name}")
        sizes = [path.stat().st_size for path in content.rglob("*") if path.is_file()]
        merge_into(content, out, object_id, REPORT_FILE)
    return ExportRecord(object_id, chosen.name, chosen.snapshot, str(out), chosen.captures, len(sizes), sum(sizes))


def _write_capture(location: Location, version: Version, capture: PageCapture, folder: Path) -> None:
    stages, arrays = capture.stages, capture.arrays
    _write_normals(stages["labels"].read("normals"), folder)
    write_png(folder / "mask.png", arrays["mask"])
    write_png(folder / "observed.png", arrays["observed"])
    for stage, name in (("labels", "provenance"), ("depth", "depth_provenance")):
        if name in arrays:
            names = code_names(stages[stage].record.get("provenance"))
            write_png(folder / f"{name}.png", arrays[name])
            _write_json(folder / f"{name}.json", {str(code): text for code, text in sorted(names.items())})
    if "confidence" in arrays:
        np.save(folder / "confidence.npy", arrays["confidence"])
    if "silhouette" in stages and "initial" in stages["silhouette"].arrays:
        np.save(folder / "initial_normals.npy", stages["silhouette"].read("initial"))
    if "depth" in arrays:
        np.save(folder / "depth.npy", arrays["depth"])
        write_tiff(folder / "depth.tiff", arrays["depth"])
    if "lights" in stages:
        _write_lights(stages["lights"], arrays["reason"], folder)
    _write_json(folder / REPORT_FILE, capture.report)
    (folder / "report.html").write_text(capture_page_of(location, version, capture), encoding="utf-8")


def _write_normals(normals: np.ndarray, folder: Path) -> None:
    np.save(folder / "normals.npy", normals)
    write_png(folder / "normals.png", encode_normals(normals))
    write_exr(folder / "normals.exr", normals)


def _write_lights(lights: StageResult, reason: np.ndarray, folder: Path) -> None:
    """Write half_vectors.npy, lights.lp and frames.csv; reason: the frames' codes (T,)."""
    directions = lights.read("lights")
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


def _read_files(stages: Mapping[str, StageResult], facts: Mapping[str, str]) -> dict[str, bytes]:
    """Return the content of the stages' files by name; a GLB names the object, version and capture in `facts`."""
    files: dict[str, bytes] = {}
    for result in stages.values():
        for name in result.files:
            if check_file_name(name, result.name) in files:
                raise _duplicate_error(result.name, name)
            data = result.read_file(name)
            files[name] = with_asset_facts(data, facts) if name.endswith(".glb") else data
    return files


def _write_files(files: Mapping[str, bytes], folder: Path, owner: str) -> None:
    for name, data in files.items():
        if (folder / name).exists():
            raise _duplicate_error(owner, name)
        (folder / name).write_bytes(data)


def _duplicate_error(owner: str, name: str) -> StoreError:
    return StoreError(f"{owner} names a file {name!r} twice", "run the object again")


def export_page(location: Location, object_id: str, out: Path, version: str | None = None) -> ExportRecord:
    """Write the page of a version (the newest by default): one HTML file, `out`, or OBJECT.html in the folder `out`.

    Raises:
        StoreError: no such object or version, or a result is missing or damaged; OutputError: it cannot be written.
    """
    repository = ObjectRepository.open(location, object_id, create=False)
    chosen = repository.version(version)
    html = object_page(repository, chosen).encode()
    path = out if out.suffix == ".html" else out / f"{object_id}.html"
    with output_errors(out, object_id), temporary_folder_for(path) as folder:
        (folder / path.name).write_bytes(html)
        (folder / path.name).replace(path)
    return ExportRecord(object_id, chosen.name, chosen.snapshot, str(path), chosen.captures, 1, len(html))


def _write_json(path: Path, content: Any) -> None:
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
