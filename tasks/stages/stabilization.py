"""A camera that was shaken: measured on a few frames in the survey, undone while the frames are decoded."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from glint.storage.footage.source import Footage
from glint.storage.versions.stage_results import StageResult
from glint.tasks.algorithms.frames.stabilization import (
    TranslationEstimator,
    downsample,
    register,
    shake_amplitude,
    translate,
)
from glint.tasks.engine.stage_warning import StageWarning

SAMPLED_FRAMES = 12
"""Frames over the video in which the shake is measured."""
SAMPLED_PIXELS = 1 << 19
"""Pixels beyond which these are made smaller."""
MIN_FRAMES = 100
"""Frames from which on a camera may have moved: sets of photographs are steady."""
STEADY_PX = 0.6
"""Shake up to which frames are taken as they are: half of it is the codec's."""
STABILIZED_ERROR_DEG = 1.0
"""Degrees by which the mean error of simulated captures grows when a shake was corrected (docs/evaluation.md)."""
REFERENCE = "stabilization_reference"


@dataclass(frozen=True, slots=True)
class Shake:
    """How far the camera moved, as the survey saves it: the record, the reference picture where frames are to be
    stabilized, and a warning then."""

    record: Mapping[str, Any]
    arrays: Mapping[str, np.ndarray] = field(default_factory=dict)
    warnings: Sequence[StageWarning] = ()


def measure_shake(footage: Footage, to_first: bool) -> Shake:
    """Measure how far the camera moved during a video.

    to_first: move frames back to the first one rather than to the middle of all.
    """
    if 0 < footage.count < MIN_FRAMES:
        return Shake({"shake_pixels": 0.0, "applied": False})
    reduction = max(1, round((footage.height * footage.width / SAMPLED_PIXELS) ** 0.5))
    frames = np.stack([downsample(frame, reduction) for frame in footage.spread(SAMPLED_FRAMES)])
    reference, shifts = register(frames)
    shake = reduction * shake_amplitude(shifts)
    if shake <= STEADY_PX:
        return Shake({"shake_pixels": round(shake, 3), "applied": False})
    origin = shifts[0] if to_first else np.median(shifts, axis=0)
    record = {"shake_pixels": round(shake, 3), "applied": True, "origin": origin.tolist(), "reduction": reduction}
    target = "the first one" if to_first else "the middle"
    warning = (
        f"the camera moved by {shake:.1f} pixels: frames are moved back to {target}; a firm tripod gives better normals"
    )
    return Shake(record, {REFERENCE: reference}, [StageWarning(warning, "camera", STABILIZED_ERROR_DEG)])


class StabilizedFootage:
    """A video whose frames are moved back to where the survey's reference has them."""

    def __init__(self, footage: Footage, survey: StageResult) -> None:
        about = survey.record["stabilization"]
        self._footage, self._reduction = footage, int(about["reduction"])
        self._estimator, self._origin = TranslationEstimator(survey.read(REFERENCE)), np.array(about["origin"])
        self.uri, self.count, self.codec = footage.uri, footage.count, footage.codec
        self.bits, self.height, self.width, self.names = footage.bits, footage.height, footage.width, footage.names

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Do nothing: the video is closed by whoever opened it."""

    @property
    def warnings(self) -> list[str]:
        """What was wrong with the video's file."""
        return self._footage.warnings

    def frames(self, start: int = 0, step: int = 1) -> Iterator[np.ndarray]:
        """Yield the luma (H, W) of frames start, start + step, .., each moved back."""
        for frame in self._footage.frames(start, step):
            shift = self._estimator.estimate(downsample(frame, self._reduction))
            yield translate(frame, self._reduction * (self._origin - shift))

    def spread(self, count: int) -> list[np.ndarray]:
        """Return about `count` frames spread over the video, as they were recorded."""
        return self._footage.spread(count)
