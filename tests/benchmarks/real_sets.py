"""The stages on photographs of real objects: error, share confident, share of these within 5 degrees, warnings.

    python -m tests.benchmarks.real_sets [--data FOLDER] [--store FOLDER] [--only SET ..]

The sets and their truth: `tests/real_sets.py`.
"""

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.results import CONFIDENT
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.references import load_catalogue
from glint.tasks.engine.stage import perform, stage_keys
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.pipeline import STAGES
from tests.real_sets import RealSet, real_sets, write_catalogue


@dataclass(frozen=True, slots=True)
class Outcome:
    """What the stages make of a set: median error in degrees over the mask, share of the mask that is confident, share
    of the confident pixels with truth that are within 5 degrees (NaN if there is none), warnings or the refusal."""

    median: float
    confident: float
    right: float
    warnings: tuple[StageWarning, ...]
    refusal: str = ""

    @property
    def holds(self) -> bool:
        """Whether hardly anything is confident, or nine tenths of what is are right."""
        return bool(self.refusal) or self.confident < 0.05 or self.right >= 0.9

    @property
    def is_reported_matte(self) -> bool:
        return "matte" in self.refusal or any("matte" in warning.message for warning in self.warnings)


def evaluate(real: RealSet, folder: Path, parameters: dict[str, Any] | None = None) -> Outcome:
    """Run the stages until the labels and compare."""
    catalogue = load_catalogue(write_catalogue(real, folder))
    context = CaptureContext.of(catalogue, real.name, "front", str(folder / "store"))
    if parameters:
        context = CaptureContext(
            context.store, context.object_id, context.capture, type(context.parameters).model_validate(parameters), "x"
        )
    keys = stage_keys(context, STAGES)
    warnings: list[StageWarning] = []
    try:
        for stage in STAGES[: [stage.name for stage in STAGES].index("labels") + 1]:
            warnings += perform(context, stage, keys[stage.name]).warnings
    except UnusableCapture as refusal:
        return Outcome(np.nan, 0.0, np.nan, tuple(warnings), str(refusal))
    region = context.load("survey").record["region"]
    window = np.s_[region["y"] : region["y"] + region["height"], region["x"] : region["x"] + region["width"]]
    mask, labels = context.load("mask").read("mask"), context.load("labels")
    confident = mask & (labels.read("confidence") >= CONFIDENT)
    error = np.full(mask.shape, np.nan)
    if real.truth is not None:
        error = np.where(mask, angles(labels.read("normals"), real.truth[window]), np.nan)
    judged = error[confident & np.isfinite(error)]
    return Outcome(
        float(np.nanmedian(error)) if np.isfinite(error).any() else np.nan,
        float(confident.sum() / mask.sum()),
        float((judged < 5.0).mean()) if len(judged) else np.nan,
        tuple(warnings),
    )


def main() -> None:
    """Print a line per set and its warnings below it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[2].parent / "shared" / "data")
    parser.add_argument("--store", type=Path)
    parser.add_argument("--only", nargs="*")
    options = parser.parse_args()
    folder = options.store or Path(tempfile.mkdtemp(prefix="real-sets-"))
    print(f"{'set':14s} {'surface':8s} {'median':>7s} {'confident':>9s} {'right':>6s}  bar")
    for name, make in real_sets(options.data).items():
        if options.only and name not in options.only:
            continue
        real = make()
        outcome = evaluate(real, folder / name)
        holds = outcome.holds and (real.surface != "matte" or outcome.is_reported_matte)
        print(
            f"{name:14s} {real.surface:8s} {outcome.median:7.1f} {outcome.confident:9.1%} {outcome.right:6.0%}"
            f"  {'holds' if holds else 'FAILS'}",
            flush=True,
        )
        for line in [*outcome.warnings, *([outcome.refusal] if outcome.refusal else [])]:
            print(f"    {line}", flush=True)


if __name__ == "__main__":
    main()
