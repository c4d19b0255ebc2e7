"""A camera that was shaken: measured on a few frames in the survey, undone while the frames are decoded. And a scene
that was changed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np

from glint.storage.catalogue.loading import Region
from glint.storage.footage.source import Footage
from glint.storage.footage.wrapper import FootageWrapper
from glint.tasks.algorithms.frames.scene_change import scene_change
from glint.tasks.algorithms.frames.shake import is_shown_throughout, knocked_places, shake_amplitude
from glint.tasks.algorithms.frames.stabilization import (
    MIN_REFERENCE_FRAMES,
    MIN_REGISTERED,
    TranslationEstimator,
    downsample,
    register,
    translate,
)
from glint.tasks.engine.stage_warning import StageWarning

SAMPLED_FRAMES = 24
"""Frames over the video in which the shake is measured."""
SAMPLED_PIXELS = 1 << 19
"""Pixels of a frame beyond which these are made smaller."""
MIN_FRAMES = 100
"""Least number of frames of a capture whose camera may have moved: sets of photographs are steady."""
STEADY_PX = 0.6
"""Shake up to which frames are taken as they are: half of it is the codec's."""
STEADY_OBJECT_PX = 1.5
"""The same where only the object and the spheres have structure: shading moves over a round object with the light."""
STABILIZED_ERROR_DEG = 1.0
"""Degrees by which the mean error of simulated captures grows when a shake was corrected (docs/evaluation.md)."""
SETTLED_PX = 1.0
"""Distance from one of the places of a knocked camera up to which a frame is taken to stand there."""
UNKNOWN_SHAKE_ERROR_DEG = 5.0
"""Error in degrees of normals that a shake of three pixels leaves on a sphere of 30 pixels."""
CONTINUOUS_FRAMES = 25
"""Frames over which a camera stays about where it is: a second."""
CHANGED_COST_DEG = 15.0
"""Error of the normals of a capture of which a part shows another scene: that of an object moved by a tenth of its size
and more."""
REFERENCE = "stabilization_reference"


@dataclass(frozen=True, slots=True)
class Shake:
    """How far the camera moved, as the survey saves it: the record, the reference picture where frames are to be
    stabilized, and a warning then."""

    record: Mapping[str, Any]
    arrays: Mapping[str, np.ndarray] = field(default_factory=dict)
    warnings: Sequence[StageWarning] = ()


def reduced_frames(footage: Footage) -> tuple[np.ndarray, int]:
    """Return frames (T, h, w) spread over a video, reduced for registration, and the factor by which they are."""
    reduction = max(1, round((footage.height * footage.width / SAMPLED_PIXELS) ** 0.5))
    return np.stack([downsample(frame, reduction) for frame in footage.spread(SAMPLED_FRAMES)]), reduction


def measure_shake(footage: Footage, to_first: bool, excluded: Sequence[Region] = ()) -> Shake:
    """Measure how far the camera moved during a video.

    Args:
        footage: the video.
        to_first: move frames back to the first one rather than to the middle of all.
        excluded: rectangles around object and spheres, pixels of the full frame: shading moves over them.
    """
    if 0 < footage.count < MIN_FRAMES:
        return Shake({"shake_pixels": 0.0, "applied": False})
    frames, reduction = reduced_frames(footage)
    rectangles = [region.model_dump() for region in excluded]
    covered = _covered(frames.shape[1:], rectangles, reduction)
    reference, sampled = register(frames, covered)
    estimator, known = TranslationEstimator(reference, covered), np.isfinite(sampled[:, 0])
    is_registered = known.mean() >= MIN_REGISTERED
    if known.sum() < MIN_REFERENCE_FRAMES or not (is_registered or is_shown_throughout(known)):
        return Shake({"shake_pixels": None, "applied": False})
    shifts = sampled[known]
    shake = reduction * shake_amplitude(shifts)
    if shake <= (STEADY_PX if estimator.on_background else STEADY_OBJECT_PX):
        return Shake({"shake_pixels": round(shake, 3), "applied": False})
    if not is_registered:
        warning = _unregistered_warning(shake, float(known.mean()))
        return Shake({"shake_pixels": round(shake, 3), "applied": False}, warnings=[warning])
    places = knocked_places(shifts)
    first = _first_place(footage, estimator, reduction) if to_first else np.median(shifts, axis=0)
    origin = shifts[0] if first is None else first
    if places is not None:
        origin = places[np.abs(places - origin).sum(axis=1).argmin()]
    record = {
        "shake_pixels": round(shake, 3),
        "applied": True,
        "origin": origin.tolist(),
        "reduction": reduction,
        "excluded": rectangles,
        "places": None if places is None else places.tolist(),
    }
    return Shake(record, {REFERENCE: reference}, [_stabilized_warning(shake, to_first, places is not None)])


def _unregistered_warning(shake: float, known_share: float) -> StageWarning:
    """Return the warning of a shake in pixels whose way only a share of the frames shows."""
    message = (
        f"the camera moved by {shake:.1f} pixels or more, but only {known_share:.0%} of the frames show how far,"
        " so they are left as they are: record again from a firm tripod, before a background of fine structure"
    )
    return StageWarning(message, "camera", UNKNOWN_SHAKE_ERROR_DEG)


def _stabilized_warning(shake: float, to_first: bool, is_knocked: bool) -> StageWarning:
    """Return the warning of a shake in pixels that is undone; is_knocked: whether the camera moved once, and stayed."""
    target = "the first one" if to_first else "the middle"
    moved = f"the camera moved by {shake:.1f} pixels: frames are moved back to {target}"
    if is_knocked:
        moved = f"the camera was knocked {shake:.1f} pixels aside once: the frames of one side are moved to the other"
    message = (
        f"{moved}; a firm tripod gives better normals, and `parameters: {{survey: {{stabilize: false}}}}` leaves the"
        " frames as they are"
    )
    return StageWarning(message, "camera", STABILIZED_ERROR_DEG)


def _first_place(footage: Footage, estimator: TranslationEstimator, reduction: int) -> np.ndarray | None:
    """Return the translation (2,) of the first frame, or of the next one that shows it; None: none does."""
    for frame in islice(footage.frames(), CONTINUOUS_FRAMES):
        shift = estimator.estimate(downsample(frame, reduction))
        if shift is not None:
            return shift
    return None


def _covered(shape: tuple[int, ...], rectangles: Sequence[Mapping[str, int]], reduction: int) -> np.ndarray:
    """Return the pixels (H, W) bool that rectangles of the full frame cover in a picture `reduction` times smaller."""
    covered = np.zeros(shape, bool)
    for rectangle in rectangles:
        top, left = rectangle["y"] // reduction, rectangle["x"] // reduction
        bottom, right = rectangle["y"] + rectangle["height"], rectangle["x"] + rectangle["width"]
        covered[top : -(-bottom // reduction), left : -(-right // reduction)] = True
    return covered


class StabilizedFootage(FootageWrapper):
    """A video whose frames are moved back to where the survey's reference has them."""

    def __init__(self, footage: Footage, about: Mapping[str, Any], reference: np.ndarray) -> None:
        """Prepare to move frames back; about, reference: record and picture of a `Shake` that is applied."""
        super().__init__(footage)
        self._reduction = int(about["reduction"])
        covered = _covered(reference.shape, about["excluded"], self._reduction)
        self._estimator, self._origin = TranslationEstimator(reference, covered), np.array(about["origin"])
        self._places = None if about["places"] is None else np.array(about["places"])

    def frames(self, start: int = 0, step: int = 1) -> Iterator[np.ndarray]:
        """Yield the luma (H, W) of frames start, start + step, .., each moved back.

        A frame that does not show its own place is moved as the last one of CONTINUOUS_FRAMES before it that does, and
        by the reference's without one. So that does not depend on where reading starts.
        """
        earlier = min(CONTINUOUS_FRAMES, start) // step
        shift, age = self._settled(np.zeros(2)), 0
        for number, frame in enumerate(self._footage.frames(start - earlier * step, step)):
            measured, age = self._estimator.estimate(downsample(frame, self._reduction)), age + step
            if measured is not None:
                shift, age = self._settled(measured), 0
            elif age > CONTINUOUS_FRAMES:
                shift = self._settled(np.zeros(2))
            if number >= earlier:
                yield translate(frame, self._reduction * (self._origin - shift))

    def _settled(self, shift: np.ndarray) -> np.ndarray:
        """Return the place (2,) of a camera that was knocked once, or the shift itself during the knock."""
        if self._places is None:
            return shift
        distances = np.abs(self._places - shift).max(axis=1)
        return np.asarray(self._places[distances.argmin()]) if distances.min() < SETTLED_PX else shift


def stabilized(footage: Footage, about: Mapping[str, Any], arrays: Mapping[str, Any]) -> Footage:
    """Return the video with its frames moved back, or as it is where the camera stood still.

    about, arrays: record and arrays of a `Shake`, also as the survey has saved them.
    """
    return StabilizedFootage(footage, about, np.asarray(arrays[REFERENCE][...])) if about["applied"] else footage


def changed_scene(frames: np.ndarray, count: int) -> tuple[float | None, list[StageWarning]]:
    """Return the share of a capture after which another scene begins, None if there is one alone, and a warning of it.

    frames: (T, H, W) uint8, spread over the capture, moved back if they are shaken. count: of all its frames, 0 if
    unknown.
    """
    # The light of photographs jumps from one side to another.
    first = None if 0 < count < MIN_FRAMES else scene_change(frames)
    if first is None:
        return None, []
    share = first / len(frames)
    place = f"frame {share * count:.0f}" if count else f"{share:.0%} of its length"
    message = (
        f"from about {place} on the video shows something else, as if it held two recordings, or the object, a sphere"
        " or the camera had been moved: cut it there, and use one of the parts"
    )
    return share, [StageWarning(message, "video", CHANGED_COST_DEG)]
