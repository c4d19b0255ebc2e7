"""Views of an object that hold the same video: at most one of them can show the side that its pose names."""

from collections.abc import Sequence

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.stage_warning import StageWarning


def same_video_warnings(works: Sequence[CaptureContext]) -> list[StageWarning]:
    """Return a warning of each video that several captures of an object hold, whatever its files are called.

    works: captures whose survey is stored.
    """
    names: dict[str, list[str]] = {}
    for work in works:
        names.setdefault(work.load("survey").record["inputs"]["frames"], []).append(work.capture.id)
    return [
        StageWarning(f"{', '.join(same)} hold the same video: name under `frames` that of each view", "views")
        for same in names.values()
        if len(same) > 1
    ]


def with_same_videos(error: UnusableCapture, warnings: Sequence[StageWarning]) -> UnusableCapture:
    """Return the error of views that do not fit together, with the videos that explain it; without any, unchanged."""
    texts = [warning.message.partition(": ") for warning in warnings]
    faults, remedies = ([text[part] for text in texts] for part in (0, 2))
    return type(error)("; ".join([error.message, *faults]), "; ".join(dict.fromkeys([*remedies, error.remedy])))
