"""A capture in one row: what its stages recorded, judged; without arrays."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.stage_warning import StageWarning, by_cost
from glint.tasks.pipeline import STAGES
from glint.tasks.verdict import GOOD, USABLE, Verdict, verdict

Records = Mapping[str, tuple[str, Mapping[str, Any]]]
"""Key and record of a capture's stages by name, as `ObjectRepository.records` returns them."""


@dataclass(frozen=True, slots=True)
class CaptureSummary:
    """verdict: None before the clusters are known; warnings: the most costly first; confident, observed: shares of the
    object, None before they are known; stage: the last one that has a result."""

    verdict: Verdict | None
    warnings: tuple[StageWarning, ...]
    confident: float | None
    observed: float | None
    stage: str

    @property
    def is_doubtful(self) -> bool:
        """True if the verdict asks a person to do something."""
        return self.verdict is not None and self.verdict.word not in (GOOD, USABLE)


def summary_of(records: Records) -> CaptureSummary:
    """Summarise the records of a capture's stages."""
    present = [stage.name for stage in STAGES if stage.name in records]
    warnings = by_cost(
        StageWarning.from_json(warning) for stage in present for warning in records[stage][1].get("warnings") or ()
    )
    pixels, observed = _count(records, "mask", "object pixels"), _count(records, "clusters", "observed pixels")
    share = None if observed is None or not pixels else min(observed / pixels, 1.0)
    frames = _count(records, "frames", "frames") or 0.0
    given = records["survey"][1].get("given_spheres") or () if "survey" in records else ()
    spheres = [Sphere(sphere["x"], sphere["y"], sphere["radius"]) for sphere in given]
    return CaptureSummary(
        None if share is None else verdict(warnings, None, share, int(frames), spheres),
        tuple(warnings),
        _count(records, "labels", "confident share"),
        share,
        present[-1] if present else "",
    )


def _count(records: Records, stage: str, name: str) -> float | None:
    if stage not in records:
        return None
    value = (records[stage][1].get("counts") or {}).get(name)
    return None if value is None else float(value)
