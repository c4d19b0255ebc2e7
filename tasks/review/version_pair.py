"""Two versions of a capture side by side: normals on a common region, angles between them, what changed in words."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from glint.storage.errors import NotFoundError
from glint.storage.export.page.capture_data import CaptureData
from glint.storage.export.page.packing import NO_CONFIDENCE, Part, octahedral, pack
from glint.tasks.figures.diff_maps import MAX_ANGLE_DEG
from glint.tasks.review.stored import VersionReference
from glint.tasks.version_diff import captures_of_both, compare, on_common_region


@lru_cache(maxsize=4)
def version_pair(capture: str, before: VersionReference, after: VersionReference) -> CaptureData:
    """Return facts and parts of two versions of an object: `before_normals`, `after_normals`, their masks, `difference`
    (0 to 254).

    Raises:
        NotFoundError: a version has no such capture; StoreError: no such object or version, or a result is damaged.
    """
    repository, names = before.repository, (before.name, after.name)
    if capture not in captures_of_both(repository, *names)[0]:
        raise NotFoundError(
            f"{' and '.join(names)} of {before.object_id} do not both have a capture {capture!r}",
            f"see `glint history {before.object_id}`",
        )
    difference = compare(repository, capture, *names)
    pair = on_common_region(repository, capture, names)
    parts: dict[str, Part] = {}
    for name, (normals, _) in zip(("before", "after"), pair, strict=True):
        parts[f"{name}_normals"] = pack(octahedral(normals))
        parts[f"{name}_mask"] = pack(np.isfinite(normals).all(axis=-1).astype(np.uint8))
    known = np.isfinite(difference.angles)
    scaled = np.rint(np.clip(np.where(known, difference.angles, 0.0) / MAX_ANGLE_DEG, 0, 1) * 254)
    parts["difference"] = pack(np.where(known, scaled, NO_CONFIDENCE).astype(np.uint8))
    size = list(known.shape[::-1])
    facts: dict[str, Any] = {
        "name": capture,
        "size": size,
        "full_size": size,
        "difference": {"limit": MAX_ANGLE_DEG},
        "figures": difference.figures | {"unit of depth": difference.unit},
        "changes": [
            {"stage": stage, "name": name, "before": _words(old), "after": _words(new)}
            for stage, name, old, new in difference.changes
        ],
        "parts": {name: part.facts for name, part in parts.items()},
    }
    return CaptureData(facts, parts)


def _words(value: Any) -> str:
    """Return a value of a record as a short text."""
    if value is None:
        return "not set"
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {part}" for name, part in value.items())
    if isinstance(value, list) and value and all(isinstance(part, Mapping) for part in value):
        return "; ".join(map(_words, value))
    return str(value) if len(str(value)) <= 80 else f"{str(value)[:77]}..."
