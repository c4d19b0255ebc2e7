"""Everything of one version as files that other programs read: a folder per capture, the object's model beside them."""

import csv
import json
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from glint.storage.errors import StoreError
from glint.storage.export.camera import camera_facts, camera_of
from glint.storage.export.image_files import encode_normals, write_exr, write_png, write_tiff
from glint.storage.export.report import capture_report, code_names, report_page, report_pictures
from glint.storage.export.stored_capture import entry_of, model_result, ordered_stages
from glint.storage.inputs.lp_file import write_lights
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository, Version
from glint.storage.versions.stage_results import WHOLE_OBJECT, StageResult, check_file_name, check_name

REPORT = "report.json"


@dataclass(frozen=True, slots=True)
class ExportRecord:
    """What was written where: `files` their number, `size` their bytes together."""

    object_id: str
    version: str
    snapshot: str
    out: str
    captures: tuple[str, ...]
    files: int
    size: int


def export(location: Location, object_id: str, out: Path, version: str | None = None) -> ExportRecord:
    """Write a version (the newest by default) to the folder `out`.

    Files appear whole or not at all. An earlier export of the same object there is replaced; anything else is left
    alone.

    Raises:
        StoreError: no such object or version, a result or file is missing or damaged, `out` cannot be written or holds
            something else in a capture's place.
    """
    repository = ObjectRepository.open(location, object_id, create=False)
    chosen = repository.version(version)
    model = model_result(repository, chosen)
    with store_errors(str(out), f"exporting {object_id}"), _beside(out) as content:
        for capture in chosen.stages:
            folder = content if capture == WHOLE_OBJECT else content / check_name(capture, "capture")
            folder.mkdir(exist_ok=True)
            results = repository.load_capture(capture, chosen.snapshot)
            stages = {stage: results[stage] for stage in ordered_stages(results, chosen)}
            stored = _read_files(stages)
            if capture != WHOLE_OBJECT:
                _write_capture(object_id, capture, chosen, stages, stored, folder)
                camera = camera_of(stages, entry_of(chosen, capture), model.record if model else None)
                if camera is not None:
                    _write_json(folder / "camera.json", camera_facts(camera))
            _write_files(stored, folder, f"{object_id}/{capture}")
        files = [path for path in content.rglob("*") if path.is_file()]
        size = sum(path.stat().st_size for path in files)
        _move(content, out, object_id)
    captures = tuple(capture for capture in chosen.stages if capture != WHOLE_OBJECT)
    return ExportRecord(object_id, chosen.name, chosen.snapshot, str(out), captures, len(files), size)


def _write_capture(
    object_id: str,
    capture: str,
    version: Version,
    stages: Mapping[str, StageResult],
    stored: Mapping[str, bytes],
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
    about = {"name": version.name, "snapshot": version.snapshot, "time": version.time.isoformat(timespec="seconds")}
    report = capture_report(object_id, capture, about | {"metadata": version.metadata}, stages, arrays)
    _write_json(folder / REPORT, report)
    pictures = report_pictures(arrays, _drawn(stored), report["depth"]["unit"], names)
    (folder / "report.html").write_text(report_page(report, pictures), encoding="utf-8")


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
    """half_vectors.npy, lights.lp and frames.csv; the frames' reason codes (T,)."""
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
    """Pixels of the object at which the lamp was seen to glint at least once."""
    if not _has(stages, "clusters", "observations"):
        return np.zeros_like(mask)
    return np.asarray((stages["clusters"].read("observations") > 0) & mask)


def _read_files(stages: Mapping[str, StageResult]) -> dict[str, bytes]:
    """Return the content of the stages' files by name."""
    files: dict[str, bytes] = {}
    for result in stages.values():
        for name in result.files:
            if check_file_name(name, result.name) in files:
                raise _twice(result.name, name)
            files[name] = result.read_file(name)
    return files


def _write_files(files: Mapping[str, bytes], folder: Path, owner: str) -> None:
    for name, data in files.items():
        if (folder / name).exists():
            raise _twice(owner, name)
        (folder / name).write_bytes(data)


def _twice(owner: str, name: str) -> StoreError:
    return StoreError(f"{owner} names a file {name!r} twice", "run the object again")


def _drawn(files: Mapping[str, bytes]) -> Iterator[tuple[str, bytes]]:
    """Yield the relit pictures, then the picture of the coverage, by their file names."""
    names = [name for name in files if re.fullmatch(r"(relit_.*|coverage)\.png", name)]
    for name in sorted(names, key=lambda name: (name == "coverage.png", name)):
        yield name, files[name]


def _has(stages: Mapping[str, StageResult], stage: str, array: str) -> bool:
    return stage in stages and array in stages[stage].arrays


def _write_json(path: Path, content: Any) -> None:
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")


@contextmanager
def _beside(out: Path) -> Iterator[Path]:
    """An empty folder on the same file system as `out`, gone afterwards."""
    out.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.resolve().parent))
    try:
        content = temporary / "content"
        content.mkdir()
        yield content
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _move(content: Path, out: Path, object_id: str) -> None:
    """Put what was written into place: all at once where `out` is new, else entry by entry."""
    if not out.exists():
        content.rename(out)
        return
    for entry in content.iterdir():
        if entry.is_dir() and (out / entry.name).exists() and _exported_object(out / entry.name) != object_id:
            raise StoreError(f"{out / entry.name} is not an export of {object_id}", "name another folder with --out")
    old = content.with_name("old")
    old.mkdir()
    stale = [path for path in out.iterdir() if path.is_dir() and _exported_object(path) == object_id]
    for path in stale:
        if not (content / path.name).exists():
            path.rename(old / path.name)
    for entry in sorted(content.iterdir()):
        target = out / entry.name
        if target.is_dir():
            target.rename(old / entry.name)
        entry.replace(target)


def _exported_object(folder: Path) -> str | None:
    """Whose export a folder is."""
    try:
        return str(json.loads((folder / REPORT).read_text(encoding="utf-8"))["object"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
