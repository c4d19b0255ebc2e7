"""Captures of an object that hold one video are named, also where their poses make a model impossible."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.model.same_videos import same_video_warnings, with_same_videos
from tests.tasks.make_context import make_context, perform_all


@pytest.fixture(scope="module")
def works(simulated: Path, tmp_path_factory: pytest.TempPathFactory) -> list[CaptureContext]:
    """Two captures, the second one's video a copy of the first one's; surveyed."""
    folder = tmp_path_factory.mktemp("same-videos")
    first = make_context(simulated, folder / "store")
    copy = shutil.copy(first.capture.frames, folder / "copy.mp4")
    second = replace(first, capture=first.capture.model_copy(update={"id": "back", "frames": str(copy)}))
    for work in (first, second):
        perform_all(work, "survey")
    return [first, second]


def test_a_video_that_two_captures_hold_is_named(works: list[CaptureContext]) -> None:
    (warning,) = same_video_warnings(works)
    assert warning.message.startswith("front, back hold the same video: ") and warning.cause == "views"
    assert same_video_warnings(works[:1]) == []


def test_it_explains_why_views_do_not_fit_together(works: list[CaptureContext]) -> None:
    error = UnusableCapture("the silhouettes contradict each other", "check the poses")
    explained = with_same_videos(error, same_video_warnings(works))
    assert explained.message == "the silhouettes contradict each other; front, back hold the same video"
    assert explained.remedy == "name under `frames` that of each view; check the poses"
    assert with_same_videos(error, []).message == error.message
