"""Check: whether a capture can be processed, how well the lights cover it, what to record again; before long stages."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from glint.storage.errors import InputError
from glint.storage.footage.source import open_footage
from glint.storage.frames.cache import FrameCache
from glint.storage.inputs.markup import read_markup
from glint.storage.inputs.preflight import check_inputs
from glint.tasks.agreement import agreement_warnings
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.frames.keyframes import keyframes
from glint.tasks.algorithms.geometry.perspective import half_vectors_on_axis, rotate_from_view
from glint.tasks.algorithms.lighting.coverage import is_observable
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.prior.silhouette import initial_normals
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.stage import StageRecord, perform, stage_keys
from glint.tasks.engine.stage_warning import StageWarning, by_cost
from glint.tasks.figures.check_pictures import write_check_pictures, write_failure_picture
from glint.tasks.pipeline import STAGES, stages_until
from glint.tasks.sphere_agreement import sphere_offer, surveyed_spheres
from glint.tasks.stages.capture_geometry import OBJECT, load_geometry
from glint.tasks.stages.frames import open_frames
from glint.tasks.stages.stabilization import SAMPLED_FRAMES
from glint.tasks.verdict import GOOD, NEEDS_SPHERE, USABLE, Verdict, failure_verdict, verdict

LAST_STAGE = "thresholds"
MAX_HIGHLIGHT_ANGLE_DEG = 3.0
"""Angle between a normal and the nearest half vector within which a highlight could be seen."""
LIGHTS_NOTE = "only `glint run` compares the lights of the `.lp` file with the object"
"""What the verdict on a capture with known lights does not include, since it takes the labels."""
FRAMES_READ = 256
"""Frames that are compared with the thresholds at once."""


@dataclass(frozen=True, slots=True)
class Check:
    """Measurements of a check.

    frames, and lights: frames with a light; observable, observed: shares of the object on which a highlight could be
    and was seen; spheres: as text; warnings: one for each cause, the most costly first; error: why the capture cannot
    be processed, with the remedy, empty if it can, and None or nothing stands for what is then not known; picture: the
    one to look at; pictures: all that were written.
    """

    name: str
    verdict: Verdict
    frames: int | None
    lights: int | None
    observable: float | None
    observed: float | None
    spheres: tuple[str, ...]
    warnings: tuple[StageWarning, ...]
    picture: Path | None
    pictures: tuple[Path, ...]
    seconds: float
    error: str = ""


def check(context: CaptureContext, out: Path, progress: Callable[[str, int, int | None], None]) -> Check:
    """Perform the stages up to the thresholds, which `glint run` will not repeat, and compare frames with them.

    out: folder for the pictures of `write_check_pictures`; of a capture that cannot be processed overview.png alone.
    progress(stage, done, total).

    Raises:
        StoreError: the store fails; OutputError: `out` cannot be written.
    """
    records: list[StageRecord] = []
    stage = ""
    try:
        check_inputs(context.capture)
        keys = stage_keys(context, STAGES)
        for declared in stages_until(LAST_STAGE):
            stage = declared.name
            records.append(perform(context, declared, keys[stage], partial(progress, stage)))
        _check_marks(context)
    except (InputError, UnusableCapture) as error:
        warnings = [warning for record in records for warning in record.warnings]
        judged = failure_verdict(stage, error, warnings, _given_spheres(context))
        return _failed(context, records, judged, f"{error.message}: {error.remedy}", out)
    return _measured(context, records, out, progress)


def _check_marks(context: CaptureContext) -> None:
    """Raise an InputError if a mark does not lie on the object, or in a frame that there is."""
    address = context.file("markup")
    if address is not None:
        cache, region = open_frames(context), load_geometry(context).region
        read_markup(address, cache.frame_size, cache.frames, region, context.load("mask").read("mask"))


def with_agreement(checks: Sequence[tuple[CaptureContext, Check]]) -> list[Check]:
    """Return the checks of an object's captures with what spheres and scales of the others say of theirs.

    Raises:
        StoreError: the store fails.
    """
    usable = [context for context, result in checks if not result.error]
    spheres = surveyed_spheres(usable)
    warnings = agreement_warnings(usable, spheres)
    agreed = list[Check]()
    for context, result in checks:
        offer = sphere_offer(context, spheres) if result.verdict.word == NEEDS_SPHERE and result.error else ""
        offered = replace(result, error=f"{result.error}; {offer}") if offer else result
        agreed.append(_with_warnings(context, offered, warnings.get(context.capture.id, [])))
    return agreed


def _measured(
    context: CaptureContext,
    records: Sequence[StageRecord],
    out: Path,
    progress: Callable[[str, int, int | None], None],
) -> Check:
    """Return the check of a capture whose stages up to the thresholds are done, and write its pictures; see `check`."""
    cache, geometry = open_frames(context), load_geometry(context)
    mask, half_vectors = context.load("mask").read("mask"), context.load("lights").read("half_vectors")
    observed, lit = _lit(cache, context.load("thresholds").read("thresholds"), half_vectors, progress)
    pictures = write_check_pictures(
        _first_frame(context),
        geometry.region,
        geometry.spheres,
        mask=mask,
        doubt=context.load("mask").read("doubt"),
        peak=context.load("frames").read("peak"),
        half_vectors=half_vectors,
        keyframe_pictures={
            frame: cache.read(OBJECT, slice(frame, frame + 1))[0] for frame in keyframes(half_vectors, lit)
        },
        out=out,
    )
    warnings = by_cost(warning for record in records for warning in record.warnings)
    observable_share = _observable_share(mask, half_vectors, geometry.view_vectors)
    observed_share = float(observed[mask].mean())
    judged = _judged(context, warnings, observable_share, observed_share, cache.frames)
    return Check(
        name=context.name,
        verdict=judged,
        frames=cache.frames,
        lights=int(np.isfinite(half_vectors[:, 0]).sum()),
        observable=observable_share,
        observed=observed_share,
        spheres=_texts(geometry.spheres),
        warnings=tuple(warnings),
        picture=next((path for path in pictures if path.stem == judged.picture), pictures[0]),
        pictures=pictures,
        seconds=sum(record.seconds for record in records),
    )


def _with_warnings(context: CaptureContext, result: Check, warnings: Sequence[StageWarning]) -> Check:
    """Return a check of a capture that can be processed with further warnings, judged again."""
    if not warnings or result.observable is None or result.observed is None or result.frames is None:
        return result
    ordered = by_cost([*result.warnings, *warnings])
    judged = _judged(context, ordered, result.observable, result.observed, result.frames)
    picture = next((path for path in result.pictures if path.stem == judged.picture), result.picture)
    return replace(result, verdict=judged, warnings=tuple(ordered), picture=picture)


def _judged(
    context: CaptureContext, warnings: Sequence[StageWarning], observable: float, observed: float, frames: int
) -> Verdict:
    """Return the verdict on a capture that can be processed, with what it says nothing of; see `verdict`."""
    judged = verdict(warnings, observable, observed, frames, _given_spheres(context))
    if context.capture.lights is None or judged.word not in (GOOD, USABLE):
        return judged
    return replace(judged, reason="; ".join(filter(None, (judged.reason, LIGHTS_NOTE))))


def _failed(context: CaptureContext, records: Sequence[StageRecord], judged: Verdict, error: str, out: Path) -> Check:
    """Return the check of a capture that cannot be processed, with a picture of what is known of it."""
    spheres, region = _given_spheres(context), context.capture.region
    if records:
        geometry = load_geometry(context)
        spheres, region = geometry.spheres, geometry.region
    pictures: tuple[Path, ...] = ()
    with suppress(InputError):
        pictures = (write_failure_picture(_brightest_frame(context), region, spheres, out),)
    return Check(
        name=context.name,
        verdict=judged,
        frames=None,
        lights=None,
        observable=None,
        observed=None,
        spheres=_texts(spheres),
        warnings=tuple(by_cost(warning for record in records for warning in record.warnings)),
        picture=next(iter(pictures), None),
        pictures=pictures,
        seconds=sum(record.seconds for record in records),
        error=error,
    )


def _given_spheres(context: CaptureContext) -> tuple[Sphere, ...]:
    return tuple(Sphere(sphere.x, sphere.y, sphere.radius) for sphere in context.capture.spheres)


def _texts(spheres: Sequence[Sphere]) -> tuple[str, ...]:
    return tuple(f"x {sphere.x:.1f}, y {sphere.y:.1f}, radius {sphere.radius:.1f}" for sphere in spheres)


def _observable_share(mask: np.ndarray, half_vectors: np.ndarray, view: np.ndarray | None) -> float:
    """Return the share of a mask (H, W) whose initial normals face a half vector (T, 3); view: (H, W, 3) or None."""
    expected = initial_normals(mask).normals
    if view is not None:
        expected = half_vectors_on_axis(rotate_from_view(expected, view), view)
    return float(is_observable(expected[mask], half_vectors, MAX_HIGHLIGHT_ANGLE_DEG).mean())


def _lit(
    cache: FrameCache,
    thresholds: np.ndarray,
    half_vectors: np.ndarray,
    progress: Callable[[str, int, int | None], None],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels (H, W) that were lit in a frame with a light, and the number (T,) lit in each frame."""
    observed, lit = np.zeros(thresholds.shape, bool), np.zeros(cache.frames, np.int64)
    for start in range(0, cache.frames, FRAMES_READ):
        above = cache.read(OBJECT, slice(start, start + FRAMES_READ)) > thresholds
        above &= np.isfinite(half_vectors[start : start + FRAMES_READ, 0])[:, None, None]
        observed |= above.any(axis=0)
        lit[start : start + FRAMES_READ] = above.sum(axis=(1, 2))
        progress("highlights", min(start + FRAMES_READ, cache.frames), cache.frames)
    return observed, lit


def _brightest_frame(context: CaptureContext) -> np.ndarray:
    """Return the maximum (H, W) of some frames spread over the footage, in which highlights and spheres show."""
    video = context.file("frames")
    assert video is not None
    with open_footage(video) as footage:
        return np.max(footage.spread(SAMPLED_FRAMES), axis=0)


def _first_frame(context: CaptureContext) -> np.ndarray:
    video = context.file("frames")
    assert video is not None
    with open_footage(video) as footage:
        return next(iter(footage.frames()))
