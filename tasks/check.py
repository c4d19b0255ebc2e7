"""Check: whether a capture can be worked on, how well the lamp swept, what to film again; before the long stages."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from glint.storage.export.image_files import write_png
from glint.storage.footage.source import open_footage
from glint.storage.frames.cache import FrameCache
from glint.tasks.algorithms.frames.keyframes import keyframes
from glint.tasks.algorithms.geometry.perspective import half_vectors_on_axis, rotate_from_view
from glint.tasks.algorithms.lighting.coverage import coverage, is_observable
from glint.tasks.algorithms.prior.silhouette import initial_normals
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.stage import perform, stage_keys
from glint.tasks.figures.coverage_map import draw_coverage
from glint.tasks.figures.keyframe_picture import draw_keyframe
from glint.tasks.pipeline import BY_NAME, STAGES
from glint.tasks.stages.frames import OBJECT, bars_of, open_frames, region_of, spheres_of, views_of

CHECKED = ("survey", "frames", "lights", "mask")
TOLERANCE = 3.0
"""Degrees between a normal and the nearest half vector within which it could have glinted."""
BLOCK = 256


@dataclass(frozen=True, slots=True)
class Check:
    """What was found: frames and those with a light, shares of the object that could be and were observed, spheres as
    text, warnings with what to do, and the pictures that were written."""

    name: str
    frames: int
    lights: int
    could: float
    observed: float
    spheres: tuple[str, ...]
    warnings: tuple[str, ...]
    pictures: tuple[Path, ...]
    seconds: float


def check(work: Workspace, out: Path, progress: Callable[[str, int, int | None], None]) -> Check:
    """Perform the stages before the clusters, which `glint run` will not repeat, and look at what they tell.

    out: folder for the pictures coverage.png, overview.png and keyframe_<frame>.png. progress(stage, done, total).

    Raises:
        InputError, StoreError, UnusableCapture: the capture cannot be worked on.
    """
    keys = stage_keys(work, STAGES)
    records = [perform(work, BY_NAME[name], keys[name], partial(progress, name)) for name in CHECKED]
    cache, mask = open_frames(work), work.load("mask").read("mask")
    half_vectors = work.load("lights").read("half_vectors")
    bars = bars_of(work, cache, mask)
    observed, lit = _lit(cache, bars, half_vectors, progress)
    expected, view = initial_normals(mask).normals, views_of(work)
    if view is not None:
        expected = half_vectors_on_axis(rotate_from_view(expected, view), view)
    could = is_observable(expected[mask], half_vectors, TOLERANCE)
    pictures = _pictures(work, cache, mask, half_vectors, lit, out)
    return Check(
        name=work.name,
        frames=cache.frames,
        lights=int(np.isfinite(half_vectors[:, 0]).sum()),
        could=float(could.mean()),
        observed=float(observed[mask].mean()),
        spheres=tuple(f"x {sphere.x:.1f}, y {sphere.y:.1f}, radius {sphere.radius:.1f}" for sphere in spheres_of(work)),
        warnings=tuple(warning for record in records for warning in record.warnings),
        pictures=pictures,
        seconds=sum(record.seconds for record in records),
    )


def _lit(
    cache: FrameCache, bars: np.ndarray, half_vectors: np.ndarray, progress: Callable[[str, int, int | None], None]
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (H, W) that were lit in a frame with a light, and lit pixels (T,) of each frame."""
    observed, lit = np.zeros(bars.shape, bool), np.zeros(cache.frames, np.int64)
    for start in range(0, cache.frames, BLOCK):
        above = cache.read(OBJECT, slice(start, start + BLOCK)) > bars
        above &= np.isfinite(half_vectors[start : start + BLOCK, 0])[:, None, None]
        observed |= above.any(axis=0)
        lit[start : start + BLOCK] = above.sum(axis=(1, 2))
        progress("highlights", min(start + BLOCK, cache.frames), cache.frames)
    return observed, lit


def _pictures(
    work: Workspace, cache: FrameCache, mask: np.ndarray, half_vectors: np.ndarray, lit: np.ndarray, out: Path
) -> tuple[Path, ...]:
    out.mkdir(parents=True, exist_ok=True)
    region = region_of(work)
    drawn = {
        "coverage": draw_coverage(coverage(half_vectors), half_vectors),
        "overview": _overview(work, mask),
    }
    for frame in keyframes(half_vectors, lit):
        picture = cache.read(OBJECT, slice(frame, frame + 1))[0]
        drawn[f"keyframe_{frame:06d}"] = draw_keyframe(picture, frame, region.x, region.y)
    paths = []
    for name, picture in drawn.items():
        paths.append(out / f"{name}.png")
        write_png(paths[-1], picture)
    return tuple(paths)


def _overview(work: Workspace, mask: np.ndarray) -> np.ndarray:
    """The first frame (H, W, 3) with the region, the object's outline and the spheres drawn in."""
    with open_footage(work.capture.frames) as footage:
        frame = next(iter(footage.frames()))
    grey = frame if frame.dtype == np.uint8 else (frame // 257).astype(np.uint8)
    picture = cv2.cvtColor(grey, cv2.COLOR_GRAY2RGB)
    region = region_of(work)
    corner = (region.x + region.width - 1, region.y + region.height - 1)
    cv2.rectangle(picture, (region.x, region.y), corner, (255, 190, 60), 1)
    outlines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(picture, outlines, -1, (80, 220, 120), 1, offset=(region.x, region.y))
    for sphere in spheres_of(work):
        centre = round(sphere.x), round(sphere.y)
        cv2.circle(picture, centre, round(sphere.radius), (90, 160, 255), 1, cv2.LINE_AA)
        cv2.drawMarker(picture, centre, (90, 160, 255), cv2.MARKER_CROSS, 8, 1)
    return picture
