"""The verdict on a checked capture: whether it can be processed as it is, or what it needs, and why."""

from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType

from glint.storage.errors import InputError
from glint.tasks.algorithms.errors import UnusableCapture, UnusableFrames, UnusableSphere
from glint.tasks.algorithms.lighting.coverage import MIN_SWEEP_FRAMES
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.stage_warning import Cause, StageWarning, by_cost
from glint.tasks.stages.clusters import MIN_OBSERVED_SHARE

GOOD, USABLE, RECORD_AGAIN, CORRECT = "good", "usable", "record again", "correct the catalogue"
NEEDS_SPHERE, NEEDS_MASK, NEEDS_CAMERA = "needs a sphere", "needs a mask", "needs the camera's matrix"
WORD_BY_CAUSE: MappingProxyType[Cause, str] = MappingProxyType(
    {"sphere": NEEDS_SPHERE, "mask": NEEDS_MASK, "camera": NEEDS_CAMERA, "marks": CORRECT, "views": CORRECT}
)
"""What a capture needs by the cause of a warning that is too costly; by any other cause it is to be recorded again."""
PICTURE_BY_CAUSE: MappingProxyType[Cause, str] = MappingProxyType({"coverage": "coverage", "light": "coverage"})
"""The picture of a check that shows a cause; of any other it is the overview."""
OVERVIEW = "overview"
MAX_USABLE_COST_DEG = 5.0
"""Degrees of error that a warning may cost; more, and a normal counts as wrong."""
MAX_GOOD_COST_DEG = 1.0
"""Degrees of error that a capture without fault may have: the mean error of a careful one."""
MIN_GOOD_OBSERVED_SHARE = 0.6
"""Share of the object with a highlight from which a capture is good: half of the normals are confident from there on
(docs/photographing.md, between 500 and 1,000 frames)."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """word: good, usable, or what is to be done; reason: why, empty if good; picture: name of the one to look at."""

    word: str
    reason: str = ""
    picture: str = OVERVIEW

    def __str__(self) -> str:
        """Return the verdict as shown in a table."""
        return f"{self.word}: {self.reason}" if self.reason else self.word


def verdict(
    warnings: Sequence[StageWarning],
    observable: float | None,
    observed: float,
    frames: int,
    given_spheres: Sequence[Sphere] = (),
) -> Verdict:
    """Judge a capture whose stages were performed up to the thresholds.

    A gap in the light's sweep costs only what lies in it, so coverage is judged by the share of the object that was
    observed; a set of photographs is never rejected for it.

    observable, observed: shares of the object on which a highlight could be (None: not compared), and was, seen;
    frames: their number; given_spheres: those that the catalogue or a person gave, in pixels of the full frame.
    """
    ordered = by_cost(warnings)
    faults = [warning for warning in ordered if warning.cause != "coverage"]
    if faults and faults[0].cost_deg >= MAX_USABLE_COST_DEG:
        word = WORD_BY_CAUSE.get(faults[0].cause)
        return _because(word, faults[0]) if word else _again(_because(RECORD_AGAIN, faults[0]), warnings, given_spheres)
    shown = f"highlights on {observed:.0%} of the object"
    if observable is not None:
        shown += f", {observable:.0%} could show one"
    if observed < MIN_OBSERVED_SHARE and frames >= MIN_SWEEP_FRAMES:
        return _again(Verdict(RECORD_AGAIN, shown, "coverage"), warnings, given_spheres)
    scale = [warning for warning in ordered if warning.cause == "scale"]
    if scale:
        # It costs no normal anything, but every length.
        return _because(CORRECT, scale[0])
    if faults and faults[0].cost_deg > MAX_GOOD_COST_DEG:
        return _because(USABLE, faults[0])
    gaps = [warning for warning in ordered if warning.cause == "coverage"]
    if gaps:
        return _because(USABLE, gaps[0])
    if observed < MIN_GOOD_OBSERVED_SHARE:
        return Verdict(USABLE, shown, "coverage")
    return Verdict(GOOD)


def failure_verdict(
    stage: str,
    error: InputError | UnusableCapture,
    warnings: Sequence[StageWarning] = (),
    given_spheres: Sequence[Sphere] = (),
) -> Verdict:
    """Judge a capture whose stage of this name failed, or (empty) whose files were found wrong before.

    warnings: of the stages before; given_spheres: as for `verdict`.
    """
    if isinstance(error, InputError):
        return Verdict(CORRECT, error.message)
    if stage in ("survey", "mask") and not isinstance(error, UnusableFrames):
        return Verdict(NEEDS_SPHERE if isinstance(error, UnusableSphere) else NEEDS_MASK, error.message)
    again = Verdict(RECORD_AGAIN, error.message, "coverage" if stage == "thresholds" else OVERVIEW)
    return _again(again, warnings, given_spheres)


def _again(again: Verdict, warnings: Sequence[StageWarning], given_spheres: Sequence[Sphere]) -> Verdict:
    """Return this verdict of recording again; where given spheres are doubted, that these are to be corrected.

    Lights that were measured beside the sphere look like a bad recording, and a sphere is corrected in a minute.
    """
    is_doubted = any(warning.cause == "sphere" and warning.cost_deg > MAX_GOOD_COST_DEG for warning in warnings)
    if not (given_spheres and is_doubted):
        return again
    places = " or ".join(
        f"at ({sphere.x:.1f}, {sphere.y:.1f}) with radius {sphere.radius:.1f}" for sphere in given_spheres
    )
    return Verdict(NEEDS_SPHERE, f"the sphere given {places} may be misplaced: {again.reason}")


def _because(word: str, warning: StageWarning) -> Verdict:
    """Return a verdict with what the warning states, without its remedy."""
    return Verdict(word, warning.message.partition(": ")[0], PICTURE_BY_CAUSE.get(warning.cause, OVERVIEW))
