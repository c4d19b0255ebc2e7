"""Verdicts follow from warnings, coverage and observed share."""

import pytest

from glint.storage.errors import InputError
from glint.tasks.algorithms.errors import UnusableCapture, UnusableFrames, UnusableSphere
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.stage_warning import Cause, StageWarning
from glint.tasks.verdict import failure_verdict, verdict

GAP = StageWarning("no light from the left, 30-90 degrees: record again with the light there too", "coverage", 11.0)
GIVEN = [Sphere(203.4, 94.4, 30.0)]
UNSEEN = StageWarning("its contour is not seen: compare it with the frame", "sphere", 1.9)


def _warning(cause: Cause, cost: float) -> StageWarning:
    return StageWarning(f"the {cause} is wrong by 3: correct it", cause, cost)


def test_a_capture_without_fault_is_good() -> None:
    judged = verdict([], 0.98, 0.85, 2000)
    assert (str(judged), judged.picture) == ("good", "overview")


@pytest.mark.parametrize(
    ("cause", "word"),
    [
        ("sphere", "needs a sphere"),
        ("mask", "needs a mask"),
        ("camera", "needs the camera's matrix"),
        ("light", "record again"),
        ("video", "record again"),
        ("highlights", "record again"),
    ],
)
def test_what_costs_more_than_the_tolerance_is_to_be_corrected(cause: Cause, word: str) -> None:
    assert str(verdict([_warning(cause, 6.0)], 0.98, 0.85, 2000)) == f"{word}: the {cause} is wrong by 3"
    assert verdict([_warning(cause, 3.0)], 0.98, 0.85, 2000).word == "usable"
    assert verdict([_warning(cause, 0.5)], 0.98, 0.85, 2000).word == "good"


def test_the_dearest_warning_decides() -> None:
    judged = verdict([_warning("mask", 6.0), GAP, _warning("sphere", 9.0)], 0.98, 0.2, 2000)
    assert judged.word == "needs a sphere"


@pytest.mark.parametrize(("observed", "word"), [(0.2, "record again"), (0.5, "usable"), (0.8, "good")])
def test_a_sweep_is_judged_by_what_was_observed(observed: float, word: str) -> None:
    judged = verdict([], 0.9, observed, 2000)
    assert judged.word == word
    assert word == "good" or (f"{observed:.0%}" in judged.reason and judged.picture == "coverage")


def test_a_scale_that_is_wrong_is_to_be_corrected_whatever_the_normals_are_worth() -> None:
    scale = StageWarning("`pixel_size` 3 makes the object 1 km large: give millimetres", "scale")
    assert str(verdict([scale], 0.98, 0.85, 2000)).startswith("correct the catalogue: `pixel_size` 3 makes")
    assert verdict([scale, _warning("mask", 3.0)], 0.98, 0.85, 2000).word == "correct the catalogue"
    assert verdict([scale, _warning("mask", 6.0)], 0.98, 0.85, 2000).word == "needs a mask"
    assert verdict([scale], 0.98, 0.2, 2000).word == "record again"


def test_a_gap_leaves_a_capture_usable() -> None:
    judged = verdict([GAP], 0.8, 0.7, 2000)
    assert (judged.word, judged.reason, judged.picture) == (
        "usable",
        "no light from the left, 30-90 degrees",
        "coverage",
    )


def test_twelve_photographs_are_no_failed_sweep() -> None:
    assert verdict([], 0.3, 0.1, 12).word == "usable"


@pytest.mark.parametrize(
    ("stage", "kind", "word"),
    [
        ("survey", UnusableSphere, "needs a sphere"),
        ("survey", UnusableFrames, "record again"),
        ("survey", UnusableCapture, "needs a mask"),
        ("mask", UnusableCapture, "needs a mask"),
        ("lights", UnusableCapture, "record again"),
        ("lights", UnusableSphere, "record again"),
        ("thresholds", UnusableCapture, "record again"),
    ],
)
def test_a_failed_stage_says_what_is_missing(stage: str, kind: type[UnusableCapture], word: str) -> None:
    judged = failure_verdict(stage, kind("nothing in 600 frames", "do something"))
    assert (judged.word, judged.reason) == (word, "nothing in 600 frames")


@pytest.mark.parametrize(
    ("warnings", "observed", "reason"),
    [
        ([UNSEEN], 0.17, "highlights on 17% of the object"),
        ([UNSEEN, _warning("light", 6.0)], 0.8, "the light is wrong"),
    ],
)
def test_a_doubted_given_sphere_is_corrected_before_recording_again(
    warnings: list[StageWarning], observed: float, reason: str
) -> None:
    judged = verdict(warnings, None, observed, 2000, GIVEN)
    assert (judged.word, judged.picture) == ("needs a sphere", "overview")
    assert judged.reason.startswith("the sphere given at (203.4, 94.4) with radius 30.0 may be misplaced: ")
    assert reason in judged.reason
    assert verdict(warnings, None, observed, 2000).word == "record again", "no sphere was given"
    sure = [warning for warning in warnings if warning is not UNSEEN]
    assert verdict([*sure, _warning("sphere", 0.5)], None, observed, 2000, GIVEN).word == "record again"


def test_a_failure_beside_a_doubted_given_sphere_names_the_sphere() -> None:
    error = UnusableCapture("no moving light in any of 300 frames", "keep the light on")
    judged = failure_verdict("lights", error, [UNSEEN], GIVEN)
    assert judged.word == "needs a sphere" and "(203.4, 94.4)" in judged.reason and error.message in judged.reason
    assert failure_verdict("lights", error, [], GIVEN).word == "record again"


def test_an_unusable_file_is_to_be_corrected() -> None:
    assert failure_verdict("", InputError("lights.lp:3: 'x' is not a light", "write")).word == "correct the catalogue"
