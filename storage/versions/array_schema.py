"""Schema of a result's arrays: shape, dtype, where they are finite; checked before storing and publishing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np


@dataclass(frozen=True, slots=True)
class ArraySchema:
    """The schema of one array.

    axes: by letter (T frames, K clusters, H and W the region, N marks) or length; an axis has one length in all results
    kind: of dtype, as numpy's (`f` floating point, `u` unsigned, `i` signed, `b` boolean)
    finite: where every value must be finite (`mask`, `accepted` frames, `all`), or empty
    """

    axes: str
    kind: str
    finite: str = ""
    required: bool = True


class ArraySource(Protocol):
    """Arrays of a stage: stored ones, or those that are about to be stored."""

    @property
    def stage(self) -> str:
        """The stage's name."""

    @property
    def arrays(self) -> Mapping[str, Any]:
        """Arrays of numpy or zarr by name."""

    def read(self, name: str) -> np.ndarray:
        """Return an array, read into memory."""


@dataclass(frozen=True, slots=True)
class ComputedArrays:
    """Arrays that a stage computed and that are not stored yet."""

    stage: str
    arrays: Mapping[str, Any]

    def read(self, name: str) -> np.ndarray:
        """Return an array, read into memory."""
        return np.asarray(self.arrays[name][...])


Schemas = Mapping[str, Mapping[str, ArraySchema]]
"""Schemas of arrays by stage. Stages and arrays beyond these may be saved too and are not checked."""
NO_SCHEMAS: Schemas = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class VersionSchema:
    """What the results of a capture must hold to be part of a version: stages, and arrays by stage."""

    stages: Sequence[str]
    arrays: Schemas


def schema_violations(results: Mapping[str, ArraySource], schemas: Schemas, required: Sequence[str] = ()) -> list[str]:
    """Return what keeps one capture's results from being a version, one line each; none when they are complete.

    required: stages that must be there.
    """
    violations = [f"stage {stage} is missing" for stage in required if stage not in results]
    sizes: dict[str, tuple[int, str]] = {}
    for stage, result in results.items():
        for name, schema in schemas.get(stage, {}).items():
            if name in result.arrays:
                violations += _array_violations(results, result, name, schema, sizes)
            elif schema.required:
                violations.append(f"{stage} has no array {name}")
    return violations


def _array_violations(
    results: Mapping[str, ArraySource],
    result: ArraySource,
    name: str,
    schema: ArraySchema,
    sizes: dict[str, tuple[int, str]],
) -> list[str]:
    array, label = result.arrays[name], f"{result.stage}/{name}"
    if array.dtype.kind != schema.kind:
        return [f"{label} is {array.dtype}, not of kind {schema.kind!r}"]
    if array.ndim != len(schema.axes):
        return [f"{label} has shape {array.shape}, not ({', '.join(schema.axes)})"]
    for axis, length in zip(schema.axes, array.shape, strict=True):
        expected, source = (int(axis), "its schema") if axis.isdigit() else sizes.setdefault(axis, (length, label))
        if length != expected:
            return [f"{label} has shape {array.shape}: {axis} is {expected} after {source}"]
    domain = _finite_domain(results, schema.finite)
    values = result.read(name) if schema.finite and domain is not None else None
    if values is None or domain is None:
        return []
    if domain.shape != values.shape[: domain.ndim]:
        return [f"{label} has shape {array.shape}, which does not fit {domain.shape}"]
    count = int(np.count_nonzero(~np.isfinite(values[domain])))
    return [f"{label} has {count:,} values that are not finite"] if count else []


def _finite_domain(results: Mapping[str, ArraySource], finite: str) -> np.ndarray | None:
    """Return where values must be finite; None where the stage that determines it is missing itself."""
    if finite == "all":
        return np.ones((), bool)
    stage, array = {"mask": ("mask", "mask"), "accepted": ("lights", "reason")}.get(finite, ("", ""))
    if stage not in results or array not in results[stage].arrays:
        return None
    values = results[stage].read(array)
    # A frame is accepted if the reason against it is 0.
    return values if finite == "mask" else values == 0
