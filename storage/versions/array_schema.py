"""Which arrays the stages leave, of what shape, and where they must be finite: what a version is checked against."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glint.storage.versions.stage_results import StageResult


@dataclass(frozen=True, slots=True)
class ArrayLayout:
    """Axes by letter (T frames, K clusters, H and W the region, N marks) or length; kind of dtype as numpy's; `finite`:
    the place where every value must be finite ("mask", "accepted" frames, "all") or empty."""

    axes: str
    kind: str
    finite: str = ""
    required: bool = True


LAYOUT: dict[str, dict[str, ArrayLayout]] = {
    "lights": {
        "half_vectors": ArrayLayout("T3", "f", "accepted"),
        "lights": ArrayLayout("T3", "f", "accepted"),
        "reason": ArrayLayout("T", "u"),
    },
    "mask": {"mask": ArrayLayout("HW", "b")},
    "clusters": {
        "normals": ArrayLayout("KHW3", "f"),
        "weight": ArrayLayout("KHW", "f"),
        "spread": ArrayLayout("KHW", "f"),
        "count": ArrayLayout("KHW", "i"),
        "observations": ArrayLayout("HW", "i"),
        "winner": ArrayLayout("HW3", "f", required=False),
    },
    "markup": {
        "pixels": ArrayLayout("N2", "i"),
        "half_vectors": ArrayLayout("N3", "f", "all"),
        "kind": ArrayLayout("N", "i"),
    },
    "silhouette": {"rim": ArrayLayout("HW", "b"), "initial": ArrayLayout("HW3", "f", "mask")},
    "labels": {
        "labels": ArrayLayout("KHW", "u"),
        "normals": ArrayLayout("HW3", "f", "mask"),
        "provenance": ArrayLayout("HW", "u"),
        "confidence": ArrayLayout("HW", "f", "mask"),
    },
    "depth": {"depth": ArrayLayout("HW", "f", "mask")},
    "surface": {},
}
"""Arrays by stage. Stages and arrays beyond these may be saved too and are not looked into."""

REQUIRED_STAGES = ("lights", "mask", "clusters", "silhouette", "labels", "depth", "surface")
"""What a capture must have before it can be part of a version."""


def problems(results: Mapping[str, StageResult], stages: Sequence[str] = REQUIRED_STAGES) -> list[str]:
    """What keeps one capture's results from being a version: one line each; none when they are complete."""
    found = [f"stage {stage} is missing" for stage in stages if stage not in results]
    sizes: dict[str, tuple[int, str]] = {}
    for stage, result in results.items():
        for name, layout in LAYOUT.get(stage, {}).items():
            if name in result.arrays:
                found += _array_problems(results, result, name, layout, sizes)
            elif layout.required:
                found.append(f"{stage} has no array {name}")
    return found


def _array_problems(
    results: Mapping[str, StageResult],
    result: StageResult,
    name: str,
    layout: ArrayLayout,
    sizes: dict[str, tuple[int, str]],
) -> list[str]:
    array, label = result.arrays[name], f"{result.stage}/{name}"
    if array.dtype.kind != layout.kind:
        return [f"{label} is {array.dtype}, not of kind {layout.kind!r}"]
    if array.ndim != len(layout.axes):
        return [f"{label} has shape {array.shape}, not ({', '.join(layout.axes)})"]
    for axis, length in zip(layout.axes, array.shape, strict=True):
        expected, source = (int(axis), "its layout") if axis.isdigit() else sizes.setdefault(axis, (length, label))
        if length != expected:
            return [f"{label} has shape {array.shape}: {axis} is {expected} after {source}"]
    place = _place(results, layout.finite)
    values = result.read(name) if layout.finite and place is not None else None
    if values is None or place is None:
        return []
    if place.shape != values.shape[: place.ndim]:
        return [f"{label} has shape {array.shape}, which does not fit {place.shape}"]
    bad = int(np.count_nonzero(~np.isfinite(values[place])))
    return [f"{label} has {bad:,} values that are not finite"] if bad else []


def _place(results: Mapping[str, StageResult], finite: str) -> np.ndarray | None:
    """Where values must be finite; None where the stage that tells is missing itself."""
    if finite == "all":
        return np.ones((), bool)
    stage, array = {"mask": ("mask", "mask"), "accepted": ("lights", "reason")}.get(finite, ("", ""))
    if stage not in results or array not in results[stage].arrays:
        return None
    values = results[stage].read(array)
    return values if finite == "mask" else values == 0
