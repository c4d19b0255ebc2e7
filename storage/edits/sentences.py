"""Describe in one sentence what changed between two states of a capture's edits."""

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from glint.storage.catalogue.models import Sphere
from glint.storage.edits.models import MAX_LINE_CHARACTERS, EditedFields


def sentence_of(before: EditedFields, after: EditedFields, fields: Iterable[str], note: str | None) -> str:
    """Return what changed in these fields, and the beginning of a note, in at most MAX_LINE_CHARACTERS."""
    parts = [_change(field, getattr(before, field), getattr(after, field)) for field in fields]
    if note is not None:
        parts.append(f"note: {' '.join(note.split())}")
    text = "; ".join(parts)
    return text if len(text) <= MAX_LINE_CHARACTERS else f"{text[: MAX_LINE_CHARACTERS - 2]}.."


def _change(field: str, before: Any, after: Any) -> str:
    if after is None:
        return f"{field} as in the catalogue again"
    return f"{field}: {_WORDS[field](before, after)}"


def _spheres(before: Any, after: Any) -> str:
    if not after:
        return "to be found"
    if before is not None and len(before) == len(after):
        pairs = enumerate(zip(before, after, strict=True), 1)
        return ", ".join(f"{number} {_sphere(old, new)}" for number, (old, new) in pairs if old != new)
    return f"{len(after)} drawn"


def _sphere(old: Sphere, new: Sphere) -> str:
    parts = list[str]()
    if (old.x, old.y, old.radius) != (new.x, new.y, new.radius):
        parts.append(f"by ({new.x - old.x:+.1f}, {new.y - old.y:+.1f}) pixels, radius {new.radius - old.radius:+.1f}")
    if old.diameter_mm != new.diameter_mm:
        parts.append("without a diameter" if new.diameter_mm is None else f"with a diameter of {new.diameter_mm:g} mm")
    return ", ".join(parts)


def _region(before: Any, after: Any) -> str:
    return f"{after.width} x {after.height} pixels at ({after.x}, {after.y})"


def _pose(before: Any, after: Any) -> str:
    return "a matrix" if after.turntable is None else f"{after.turntable:g} degrees"


def _mask(before: Any, after: Any) -> str:
    if before is None or before.shape != after.shape:
        return f"{int(after.sum()):,} pixels"
    added, removed = int((after & ~before).sum()), int((before & ~after).sum())
    return f"{added:,} pixels added, {removed:,} removed"


def _marks(before: Any, after: Any) -> str:
    true = sum(mark.kind == "true" for mark in after)
    return f"{true} true, {len(after) - true} false" + ("" if before is None else f" (was {len(before)} in all)")


_WORDS: Mapping[str, Callable[[Any, Any], str]] = MappingProxyType(
    {
        "spheres": _spheres,
        "region": _region,
        "camera": lambda before, after: f"focal length {np.sqrt(after.matrix[0][0] * after.matrix[1][1]):.0f} pixels",
        "pixel_size": lambda before, after: f"{after:.4g} mm",
        "pose": _pose,
        "mask": _mask,
        "marks": _marks,
        "verdict": lambda before, after: str(after),
    }
)
"""Functions of the values before and after, by field."""
