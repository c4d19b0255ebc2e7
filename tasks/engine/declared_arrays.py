"""Arrays of a stage against its declaration, before they are stored."""

from collections.abc import Mapping, Sequence

import numpy as np

from glint.storage.errors import StoreError
from glint.storage.versions.array_schema import (
    ArraySchema,
    ArraySource,
    ComputedArrays,
    schema_violations,
)
from glint.tasks.engine.capture_context import CaptureContext

FINITE_DOMAINS = ("mask", "lights")
"""Stages whose arrays say where those of other stages must be finite."""


def check_arrays(
    context: CaptureContext,
    stage: str,
    reads: Sequence[str],
    schema: Mapping[str, ArraySchema],
    arrays: Mapping[str, np.ndarray],
) -> None:
    """Refuse arrays that a version could not hold, such as normals that are not finite inside the mask.

    reads: stages whose results the stage reads, among them the one that determines where values must be finite.

    Raises:
        StoreError: an array is not as declared.
    """
    results: dict[str, ArraySource] = {name: context.load(name) for name in reads if name in FINITE_DOMAINS}
    results[stage] = ComputedArrays(stage, arrays)
    violations = schema_violations(results, {stage: schema})
    if violations:
        raise StoreError(
            f"{context.name} cannot store {stage}: {'; '.join(violations)}",
            "report this defect with the capture; a mask painted by hand may avoid it",
        )
