"""Two versions of an object beside each other: how far its surface moved, and what was changed to move it."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import WHOLE_OBJECT

QUANTILE = 0.95
"""Of the angles between two versions' normals: a surface moved when more than a twentieth of it did."""


@dataclass(frozen=True, slots=True)
class Drift:
    """A capture whose normals moved: the 95th percentile of the angle in degrees, between which versions."""

    object_id: str
    capture_id: str
    degrees: float
    before: str
    after: str

    def __str__(self) -> str:
        """In words."""
        return (
            f"{self.object_id}/{self.capture_id}: a twentieth of the normals moved by {self.degrees:.1f} degrees or"
            f" more from {self.before} to {self.after}"
        )


@dataclass(frozen=True, slots=True)
class Difference:
    """What differs between two versions of a capture.

    angles (H, W) degrees between the normals, depths (H, W) after minus before, less its median, in `unit`; both NaN
    where not both versions have a value, on the smallest region of the frame that holds those of both. `changes` say
    what is different in parameters, inputs and code: stage, what, before, after.
    """

    capture: str
    angles: np.ndarray
    depths: np.ndarray
    unit: str
    changes: tuple[tuple[str, str, Any, Any], ...]

    @property
    def figures(self) -> dict[str, float | int | None]:
        """Angles in degrees, depths in `unit`; None where the versions share no pixel."""
        angles, depths = self.angles[np.isfinite(self.angles)], self.depths[np.isfinite(self.depths)]
        return {
            "pixels": int(angles.size),
            "mean angle": _rounded(angles.mean() if angles.size else None),
            "angle of 95%": _rounded(np.quantile(angles, QUANTILE) if angles.size else None),
            "largest angle": _rounded(angles.max() if angles.size else None),
            "moved beyond 5°": _rounded((angles > 5.0).mean() if angles.size else None),
            "depth, root mean square": _rounded(np.sqrt((depths**2).mean()) if depths.size else None),
        }


def captures_of_both(repository: ObjectRepository, before: str, after: str) -> tuple[list[str], list[str], list[str]]:
    """Captures that both versions hold, those that only `before` and those that only `after` holds.

    Raises:
        StoreError: one of the versions is not there.
    """
    old, new = repository.version(before).stages.keys(), repository.version(after).stages.keys()
    names = (sorted(old & new), sorted(old - new), sorted(new - old))
    both, gone, added = ([name for name in each if name != WHOLE_OBJECT] for each in names)
    return both, gone, added


def compare(repository: ObjectRepository, capture: str, before: str, after: str) -> Difference:
    """The difference of a capture between two versions.

    Raises:
        StoreError: a version is not there or has no such capture.
    """
    (old_normals, old_depth), (new_normals, new_depth) = _placed(repository, capture, (before, after))
    depths = new_depth - old_depth
    known = np.isfinite(depths)
    if known.any():
        depths -= np.median(depths[known])
    return Difference(
        capture,
        angles_between(old_normals, new_normals),
        depths,
        str(repository.load(capture, "depth", after).record.get("unit", "pixels")),
        tuple(_changes(repository, capture, before, after)),
    )


def drifts(repository: ObjectRepository, before: str, after: str, degrees: float) -> list[Drift]:
    """Captures whose normals moved by more than `degrees` (95th percentile) between two versions."""
    found = []
    for capture in captures_of_both(repository, before, after)[0]:
        if repository.version(before).stages[capture] == repository.version(after).stages[capture]:
            continue
        (old, _), (new, _) = _placed(repository, capture, (before, after))
        angles = angles_between(old, new)
        known = angles[np.isfinite(angles)]
        moved = float(np.quantile(known, QUANTILE)) if known.size else 180.0
        if moved > degrees:
            found.append(Drift(repository.object_id, capture, moved, before, after))
    return found


def angles_between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Degrees (H, W) float32 between unit vectors (H, W, 3), NaN where one is; exact for small angles too."""
    chord = np.linalg.norm(first.astype(np.float64) - second, axis=-1)
    return np.degrees(2.0 * np.arcsin(np.clip(chord / 2.0, 0.0, 1.0))).astype(np.float32)


def _placed(
    repository: ObjectRepository, capture: str, versions: tuple[str, str]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Normals (H, W, 3) and depth (H, W) of both versions on the rectangle around both regions, NaN elsewhere."""
    regions = [repository.load(capture, "survey", version).record["region"] for version in versions]
    left, top = (min(region[name] for region in regions) for name in ("x", "y"))
    width = max(region["x"] + region["width"] for region in regions) - left
    height = max(region["y"] + region["height"] for region in regions) - top
    placed = []
    for version, region in zip(versions, regions, strict=True):
        normals = np.full((height, width, 3), np.nan, np.float32)
        depth = np.full((height, width), np.nan, np.float32)
        rows = slice(region["y"] - top, region["y"] - top + region["height"])
        columns = slice(region["x"] - left, region["x"] - left + region["width"])
        normals[rows, columns] = repository.load(capture, "labels", version).read("normals")
        depth[rows, columns] = repository.load(capture, "depth", version).read("depth")
        placed.append((normals, depth))
    return placed


def _changes(
    repository: ObjectRepository, capture: str, before: str, after: str
) -> Iterator[tuple[str, str, Any, Any]]:
    """Parameters, inputs and versions of stages that differ."""
    old, new = repository.version(before).stages[capture], repository.version(after).stages[capture]
    for stage in sorted(old.keys() | new.keys()):
        if stage not in old or stage not in new:
            yield stage, "stage", "there" if stage in old else "absent", "there" if stage in new else "absent"
            continue
        if old[stage] == new[stage]:
            continue
        records = [repository.load(capture, stage, version).record for version in (before, after)]
        for group in ("parameters", "inputs", "versions"):
            was, now = (record.get(group, {}) for record in records)
            for name in sorted(was.keys() | now.keys()):
                if was.get(name) != now.get(name):
                    what = name if group == "parameters" else f"{group.removesuffix('s')} {name}"
                    yield stage, what, was.get(name), now.get(name)


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(float(value), 4)
