"""The formats in which a version can be exported: Glint's own files, a BOP dataset, PCD point clouds."""

import json
from pathlib import Path

from glint.storage.errors import StoreError
from glint.storage.export.bop import write_bop
from glint.storage.export.camera import camera_facts
from glint.storage.export.export import ExportRecord, export
from glint.storage.export.pcd import optical_cloud, write_pcd
from glint.storage.export.point_cloud import point_cloud_of
from glint.storage.export.replaced_folder import output_errors, replaced_folder
from glint.storage.export.stored_capture import ExportedCapture, exported_captures, mesh_of, model_result
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository

FORMATS = ("files", "bop", "pcd")


def export_as(
    format_name: str, location: Location, object_id: str, out: Path, version: str | None = None
) -> ExportRecord:
    """Write a version (the newest by default) to the folder `out` in one of FORMATS.

    files: everything, see `export`. bop: a BOP dataset, see `storage.export.bop`. pcd: CAPTURE/cloud.pcd and
    CAPTURE/camera.json. Folders of `bop` and `pcd` are replaced whole.

    Raises:
        StoreError: no such format, object or version, a result is missing or damaged, the format cannot hold it, or
            `out` holds something else; OutputError: `out` cannot be written.
    """
    if format_name == "files":
        return export(location, object_id, out, version)
    if format_name not in FORMATS:
        raise StoreError(f"no export format {format_name!r}", f"use one of {', '.join(FORMATS)}")
    repository = ObjectRepository.open(location, object_id, create=False)
    chosen = repository.version(version)
    model = model_result(repository, chosen)
    captures = list(exported_captures(repository, chosen, model))
    facts = {"object": object_id, "format": format_name, "version": chosen.name, "snapshot": chosen.snapshot}
    with output_errors(out, object_id), replaced_folder(out, facts) as folder:
        if format_name == "bop":
            merged = None if model is None else mesh_of(model, "model.ply")
            write_bop(folder, object_id, chosen.name, captures, merged)
        else:
            for capture in captures:
                _write_cloud(folder / capture.name, capture)
    files = [path for path in out.rglob("*") if path.is_file()]
    size = sum(path.stat().st_size for path in files)
    names = tuple(capture.name for capture in captures)
    return ExportRecord(object_id, chosen.name, chosen.snapshot, str(out), names, len(files), size)


def _write_cloud(folder: Path, capture: ExportedCapture) -> None:
    folder.mkdir()
    cloud = point_cloud_of(capture.camera, capture.depth, capture.normals, capture.confidence)
    open_value = "offset along z" if capture.camera.matrix is None else "distance from the camera, and so the scale,"
    write_pcd(folder / "cloud.pcd", optical_cloud(cloud), open_value)
    camera = json.dumps(camera_facts(capture.camera), indent=2, allow_nan=False)
    (folder / "camera.json").write_text(camera + "\n", encoding="utf-8")
