"""Difference of two versions of an object: of its normals and depths, and of parameters, inputs and code."""

from collections.abc import Container, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.tasks.algorithms.geometry import vectors

DRIFT_QUANTILE = 0.95
"""Quantile of the angles between two versions' normals by which a surface counts as changed."""
CHANGED_ANGLE_DEG = 5.0
"""Degrees from which a pixel's normal counts as changed in the figures."""
ENTRY = "inputs"
"""What stands for the stage where values of a capture's entry differ."""
ENTRY_KEYS = ("spheres", "region", "pixel_size", "camera", "pose")
"""Keys of an entry from which stages are computed; of files the digests are compared."""
INCOMPARABLE_DEG = 180.0
"""Drift of a capture whose versions share no pixel."""


@dataclass(frozen=True, slots=True)
class Drift:
    """A capture whose normals changed between two versions; degrees: the 95th percentile of the angle."""

    object_id: str
    capture_id: str
    degrees: float
    before: str
    after: str

    def __str__(self) -> str:
        """Describe the drift in a sentence."""
        return (
            f"{self.object_id}/{self.capture_id}: a twentieth of the normals moved by {self.degrees:.1f} degrees or"
            f" more from {self.before} to {self.after}"
        )


@dataclass(frozen=True, slots=True)
class Difference:
    """Difference between two versions of a capture.

    angles (H, W) float32: degrees between the normals; depths (H, W) float32: after minus before, less the median, in
    `unit`. Both cover the smallest rectangle of the frame that contains both versions' regions, and are NaN where one
    of the versions has no value. changes: (stage, name, before, after) of parameters, inputs and versions of code;
    ENTRY is the stage of the entry's values.
    """

    capture: str
    angles: np.ndarray
    depths: np.ndarray
    unit: str
    changes: tuple[tuple[str, str, Any, Any], ...]

    @property
    def figures(self) -> dict[str, float | int | None]:
        """Summary of angles in degrees and depths in `unit`; None where the versions share no pixel."""
        angles, depths = self.angles[np.isfinite(self.angles)], self.depths[np.isfinite(self.depths)]
        return {
            "pixels": int(angles.size),
            "mean angle": _rounded(angles.mean() if angles.size else None),
            "angle of 95%": _rounded(np.quantile(angles, DRIFT_QUANTILE) if angles.size else None),
            "largest angle": _rounded(angles.max() if angles.size else None),
            "moved beyond 5°": _rounded((angles > CHANGED_ANGLE_DEG).mean() if angles.size else None),
            "depth, root mean square": _rounded(np.sqrt((depths**2).mean()) if depths.size else None),
        }


def captures_of_both(repository: ObjectRepository, before: str, after: str) -> tuple[list[str], list[str], list[str]]:
    """Return the captures that both versions hold, those that only `before` and those that only `after` holds.

    Raises:
        StoreError: one of the versions does not exist.
    """
    old, new = repository.version(before).stages.keys(), repository.version(after).stages.keys()
    shared, gone, added = (
        [name for name in sorted(names) if name != WHOLE_OBJECT] for names in (old & new, old - new, new - old)
    )
    return shared, gone, added


def compare(repository: ObjectRepository, capture: str, before: str, after: str) -> Difference:
    """Compare a capture in two versions.

    Raises:
        StoreError: a version does not exist or has no such capture.
    """
    (old_normals, old_depth), (new_normals, new_depth) = on_common_region(repository, capture, (before, after))
    depths = new_depth - old_depth
    known = np.isfinite(depths)
    if known.any():
        # A common offset of depth is unknowable from one view and means nothing.
        depths -= np.median(depths[known])
    return Difference(
        capture,
        _angles(old_normals, new_normals),
        depths,
        str(repository.load(capture, "depth", after).record.get("unit", "pixels")),
        tuple(_changes(repository, capture, before, after)),
    )


def drifts(repository: ObjectRepository, before: str, after: str, degrees: float) -> list[Drift]:
    """Return the captures whose normals changed by more than `degrees` (95th percentile) between two versions."""
    changed = []
    for capture in captures_of_both(repository, before, after)[0]:
        if repository.version(before).stages[capture] == repository.version(after).stages[capture]:
            continue
        (old, _), (new, _) = on_common_region(repository, capture, (before, after))
        angles = _angles(old, new)
        known = angles[np.isfinite(angles)]
        percentile = float(np.quantile(known, DRIFT_QUANTILE)) if known.size else INCOMPARABLE_DEG
        if percentile > degrees:
            changed.append(Drift(repository.object_id, capture, percentile, before, after))
    return changed


def _angles(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return degrees (H, W) float32 between unit normals (H, W, 3), NaN where one is NaN."""
    return vectors.angles(first.astype(np.float64), second).astype(np.float32)


def on_common_region(
    repository: ObjectRepository, capture: str, versions: tuple[str, str]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return normals (H, W, 3) and depth (H, W) of both versions on the rectangle around both regions, NaN outside."""
    regions = [repository.load(capture, "survey", version).record["region"] for version in versions]
    left, top = (min(region[name] for region in regions) for name in ("x", "y"))
    width = max(region["x"] + region["width"] for region in regions) - left
    height = max(region["y"] + region["height"] for region in regions) - top
    arrays = []
    for version, region in zip(versions, regions, strict=True):
        normals = np.full((height, width, 3), np.nan, np.float32)
        depth = np.full((height, width), np.nan, np.float32)
        rows = slice(region["y"] - top, region["y"] - top + region["height"])
        columns = slice(region["x"] - left, region["x"] - left + region["width"])
        normals[rows, columns] = repository.load(capture, "labels", version).read("normals")
        depth[rows, columns] = repository.load(capture, "depth", version).read("depth")
        arrays.append((normals, depth))
    return arrays


def _changes(
    repository: ObjectRepository, capture: str, before: str, after: str
) -> Iterator[tuple[str, str, Any, Any]]:
    """Yield (stage, name, before, after) of what differs: values of the entry, then, stage by stage, parameters, files
    and versions of code."""
    entries = [_entry(repository, capture, version) for version in (before, after)]
    for key in ENTRY_KEYS:
        if entries[0].get(key) != entries[1].get(key):
            yield ENTRY, key, entries[0].get(key), entries[1].get(key)
    old, new = repository.version(before).stages[capture], repository.version(after).stages[capture]
    for stage in sorted(old.keys() | new.keys()):
        if stage not in old or stage not in new:
            yield stage, "stage", _presence(stage, old), _presence(stage, new)
            continue
        if old[stage] == new[stage]:
            continue
        records = [repository.load(capture, stage, version).record for version in (before, after)]
        for group in ("parameters", "inputs", "versions"):
            old_values, new_values = (record.get(group, {}) for record in records)
            for name in sorted(old_values.keys() | new_values.keys()):
                if old_values.get(name) != new_values.get(name):
                    label = name if group == "parameters" else f"{group.removesuffix('s')} {name}"
                    yield stage, label, old_values.get(name), new_values.get(name)


def _entry(repository: ObjectRepository, capture: str, version: str) -> dict[str, Any]:
    """Return the entry with which a version was made, edits included, as JSON values."""
    entry: dict[str, Any] = repository.version(version).metadata.get("captures", {}).get(capture, {}).get("entry", {})
    return entry


def _presence(stage: str, stages: Container[str]) -> str:
    return "present" if stage in stages else "absent"


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(float(value), 4)
