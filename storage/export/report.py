"""A capture's report: its figures as plain JSON.

Records of stages may hold, each under its name: `parameters`, `seconds`, `counts`, `versions`, `inputs` (digests),
`warnings` ({message, cause, cost_deg}), `region` {x, y, width, height}, `frame_size` [width, height], `unit` and
`pixel_size` of depth, `coverage`, `reasons` (words of the lights' codes) and `provenance` (names of the codes of labels
and depth). All are optional; the whole records are kept under `stages` too. `page` shows the report.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from glint.storage.export.stored_capture import ARRAYS
from glint.storage.versions.stage_results import StageResult

DEPTH_DIRECTION = "towards the camera"
CAMERA_FRAME = (
    "x right, y up, z towards the camera; unit normals; pixel (0, 0) is the centre of the top-left pixel, y down"
)


def code_names(codes: Any) -> dict[int, str]:
    """Return names by code, from a record's sequence of names or mapping with codes as text."""
    if isinstance(codes, Mapping):
        return {int(code): str(name) for code, name in codes.items()}
    return {code: str(name) for code, name in enumerate(codes or ())}


def report_arrays(stages: Mapping[str, StageResult]) -> dict[str, np.ndarray]:
    """Read the arrays of a capture's report: its mask and, as far as they exist, those that `capture_report` names.

    Raises:
        StoreError: one is damaged.
    """
    arrays = {"mask": stages["mask"].read("mask")}
    for name in ("confidence", "provenance", "depth", "depth_provenance", "reason"):
        stage, array = ARRAYS[name]
        if stage in stages and array in stages[stage].arrays:
            arrays[name] = stages[stage].read(array)
    arrays["observed"] = np.zeros_like(arrays["mask"])
    if "clusters" in stages and "observations" in stages["clusters"].arrays:
        arrays["observed"] = (stages["clusters"].read("observations") > 0) & arrays["mask"]
    return arrays


def capture_report(
    object_id: str,
    capture: str,
    version: Mapping[str, Any],
    results: Mapping[str, StageResult],
    arrays: Mapping[str, Any],
) -> dict[str, Any]:
    """Return all figures of a capture as plain JSON.

    version: name, snapshot, time and metadata of the version.
    arrays: mask and observed (H, W) bool, and as far as they exist depth, confidence (H, W) float32, provenance,
    depth_provenance (H, W) uint8 and reason (T,) uint8.
    """
    records = {stage: result.record for stage, result in results.items()}
    unit = _first(records, "unit") or "pixels"
    depth, mask = arrays.get("depth"), arrays["mask"]
    return {
        "object": object_id,
        "capture": capture,
        "catalogue": _catalogue(version.get("metadata", {}), capture),
        "edits": _recorded(version.get("metadata", {}), capture).get("edits"),
        "version": version,
        "region": _first(records, "region") or {"x": None, "y": None, "width": mask.shape[1], "height": mask.shape[0]},
        "frame_size": _first(records, "frame_size"),
        "axes": CAMERA_FRAME,
        "depth": {
            "unit": unit,
            "direction": DEPTH_DIRECTION,
            "pixel_size_mm": _first(records, "pixel_size"),
            "range": depth_range(depth),
            "offset": "free for each connected component",
        },
        "counts": _counts(arrays, records) | _merged(records, "counts"),
        "coverage": _first(records, "coverage"),
        "seconds": {stage: record["seconds"] for stage, record in records.items() if record.get("seconds") is not None},
        "warnings": _by_cost(warning for stage, record in records.items() for warning in _warnings(stage, record)),
        "parameters": {stage: record["parameters"] for stage, record in records.items() if "parameters" in record},
        "fingerprints": {stage: result.key for stage, result in results.items()},
        "inputs": _merged(records, "inputs"),
        "versions": _merged(records, "versions"),
        "stages": records,
    }


def _catalogue(metadata: Mapping[str, Any], capture: str) -> str | None:
    """Return the address of the catalogue from which a capture was computed, None where that is not recorded."""
    address: str | None = _recorded(metadata, capture).get("catalogue") or metadata.get("catalogue")
    return address


def _recorded(metadata: Mapping[str, Any], capture: str) -> Mapping[str, Any]:
    """Return what a version records of a capture: its catalogue and entry, and what a person has edited of it."""
    recorded: Mapping[str, Any] = metadata.get("captures", {}).get(capture, {})
    return recorded


def _counts(arrays: Mapping[str, Any], records: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    mask = arrays["mask"]
    counts: dict[str, Any] = {"pixels": int(mask.sum()), "observed_pixels": int(arrays["observed"].sum())}
    for stage, name in (("labels", "provenance"), ("depth", "depth_provenance")):
        if name in arrays:
            names = code_names(records.get(stage, {}).get("provenance"))
            codes, numbers = np.unique(arrays[name][mask], return_counts=True)
            pairs = zip(codes.tolist(), numbers.tolist(), strict=True)
            counts[name] = {names.get(code, f"code {code}"): number for code, number in pairs}
    if "reason" in arrays:
        names = code_names(records.get("lights", {}).get("reasons"))
        codes, numbers = np.unique(arrays["reason"], return_counts=True)
        frames = list(zip(codes.tolist(), numbers.tolist(), strict=True))
        counts["frames"] = len(arrays["reason"])
        counts["accepted_frames"] = sum(number for code, number in frames if code == 0)
        counts["rejected_frames"] = {names.get(code, f"code {code}"): number for code, number in frames if code != 0}
    if "confidence" in arrays and np.isfinite(arrays["confidence"][mask]).any():
        counts["median_confidence"] = round(float(np.nanmedian(arrays["confidence"][mask])), 4)
    return counts


def _warnings(stage: str, record: Mapping[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "stage": stage,
            "message": str(warning["message"]),
            "cause": str(warning["cause"]),
            "cost_deg": float(warning["cost_deg"]),
        }
        for warning in record.get("warnings") or ()
    ]


def _by_cost(warnings: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    return sorted(warnings, key=lambda warning: -float(warning["cost_deg"]))


def _first(records: Mapping[str, Mapping[str, Any]], name: str) -> Any:
    return next((record[name] for record in records.values() if record.get(name) is not None), None)


def _merged(records: Mapping[str, Mapping[str, Any]], name: str) -> dict[str, Any]:
    parts = [record[name] for record in records.values() if isinstance(record.get(name), Mapping)]
    return {key: value for part in parts for key, value in part.items()}


def depth_range(depth: np.ndarray | None) -> list[float] | None:
    """Return the least and the greatest finite depth, or None where there is none."""
    if depth is None or not np.isfinite(depth).any():
        return None
    return [float(np.nanmin(depth)), float(np.nanmax(depth))]
