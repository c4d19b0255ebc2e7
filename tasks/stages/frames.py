"""Frames: the footage decoded once, cropped to the object and to each sphere, and cut into chunks."""

from collections.abc import Iterator
from functools import lru_cache
from time import monotonic
from typing import Any

import numpy as np

from glint.storage.catalogue.loading import Region
from glint.storage.errors import StoreError
from glint.storage.footage.source import Footage, open_footage
from glint.storage.frames.cache import FrameCache, cache_digest, reduced
from glint.storage.frames.eviction import mark_used
from glint.storage.locations.location import Location
from glint.tasks.algorithms.candidates.thresholds import highlight_thresholds, saturation_level
from glint.tasks.algorithms.frames.stabilization import TranslationEstimator, register, shake_amplitude, translate
from glint.tasks.algorithms.geometry.perspective import view_vectors
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.stage import Outcome, Progress

OBJECT = "object"
AROUND_SPHERE = 4
"""Pixels beyond a sphere's outline that its crop holds."""
LEAST_FRAMES = 100
"""Frames from which on a camera may have moved: sets of photographs are steady."""
STEADY = 0.6
"""Pixels of wander up to which frames are taken as they are: half of it is the codec's."""
MARK_SECONDS = 600.0
"""How often the use of frames is written down."""


def frames(work: Workspace, progress: Progress) -> Outcome:
    """Fill the cache of frames; where the camera moved, with frames that are moved back.

    Raises:
        InputError: the footage cannot be read.
        StoreError: the store cannot be written.
    """
    cache = _opened(work, None, progress)
    warnings = list(cache.warnings)
    shaken = cache.reduction * shake_amplitude(register(cache.overview())[1]) if cache.frames >= LEAST_FRAMES else 0.0
    if shaken > STEADY:
        cache = _opened(work, cache, progress)
        warnings.append(
            f"the camera moved by {shaken:.1f} pixels: frames are moved back to"
            f" {'the first one' if _placed_by_hand(work) else 'the middle'}; a firm tripod gives better normals"
        )
    return Outcome(
        record={
            "cache": cache.digest,
            "frame_size": list(cache.frame_size[::-1]),
            "wander_pixels": round(shaken, 3),
            "steadied": shaken > STEADY,
        },
        counts={"frames": cache.frames},
        warnings=warnings,
    )


def open_frames(work: Workspace) -> FrameCache:
    """The capture's cache of frames, rebuilt from the footage where it is gone or incomplete."""
    shaken = _opened(work, None) if work.load("frames").record["steadied"] else None
    return _opened(work, shaken)


def _opened(work: Workspace, shaken: FrameCache | None, progress: Progress | None = None) -> FrameCache:
    """The frames as they are, or, from the cache of these, those that are moved back."""
    crops, content = crops_of(work), work.digest("frames") or ""
    if shaken is not None:
        content = f"{content} steadied to {'the first' if _placed_by_hand(work) else 'the middle'}"
    digest = cache_digest(content, crops)
    try:
        cache = FrameCache.open(work.location, digest)
        if cache.complete:
            _mark_used(work.location, digest, int(monotonic() // MARK_SECONDS))
            return cache
    except StoreError:
        pass
    with open_footage(work.capture.frames) as footage:
        if shaken is None:
            return FrameCache.ingest(footage, work.location, digest, crops, progress)
        steadied: Any = Steadied(footage, shaken.overview(), shaken.reduction, _placed_by_hand(work))
        return FrameCache.ingest(steadied, work.location, digest, crops, progress)


class Steadied:
    """Footage whose frames are moved back to the first one or to the middle; all else is the footage's own.

    overview (N, h, w): some of its frames, the first one first, so many times smaller.
    """

    def __init__(self, footage: Footage, overview: np.ndarray, reduction: int, to_first: bool) -> None:
        self._footage, self._reduction = footage, reduction
        reference, shifts = register(overview)
        self._steadier = TranslationEstimator(reference)
        self._origin = shifts[0] if to_first else np.median(shifts, axis=0)

    def __getattr__(self, name: str) -> Any:
        """What the footage says of itself."""
        return getattr(self._footage, name)

    def frames(self, *arguments: Any, **named: Any) -> Iterator[np.ndarray]:
        """The footage's frames, each moved back."""
        for frame in self._footage.frames(*arguments, **named):
            shift = self._steadier.estimate(reduced(frame, self._reduction))
            yield translate(frame, self._reduction * (self._origin - shift))


def _placed_by_hand(work: Workspace) -> bool:
    """Whether the catalogue places object or spheres in the frame, as one does by looking at the first."""
    return bool(work.capture.spheres or work.capture.mask)


@lru_cache(maxsize=256)
def _mark_used(location: Location, digest: str, period: int) -> None:
    """Mark frames as used, once per `period` and process."""
    mark_used(location, digest)


def crops_of(work: Workspace) -> dict[str, Region]:
    """Crops of the full frame by name: `object`, `sphere-0`, .."""
    record = work.load("survey").record
    width, height = record["frame_size"]
    crops = {OBJECT: Region(**record["region"])}
    for number, sphere in enumerate(spheres_of(work)):
        left, top = max(int(sphere.x - sphere.radius) - AROUND_SPHERE, 0), 0
        top = max(int(sphere.y - sphere.radius) - AROUND_SPHERE, 0)
        right = min(int(sphere.x + sphere.radius) + AROUND_SPHERE + 2, width)
        bottom = min(int(sphere.y + sphere.radius) + AROUND_SPHERE + 2, height)
        crops[f"sphere-{number}"] = Region(x=left, y=top, width=right - left, height=bottom - top)
    return crops


def spheres_of(work: Workspace) -> list[Sphere]:
    """The spheres that the survey was given or found."""
    return [
        Sphere(each["x"], each["y"], each["radius"], each["score"]) for each in work.load("survey").record["spheres"]
    ]


def region_of(work: Workspace) -> Region:
    """The object's region of the full frame."""
    return Region(**work.load("survey").record["region"])


def camera_within(work: Workspace, crop: Region) -> np.ndarray | None:
    """The perspective camera's matrix (3, 3) in the pixels of a crop; None: orthographic."""
    camera = work.camera_matrix
    return None if camera is None else camera - np.array([[0, 0, crop.x], [0, 0, crop.y], [0, 0, 0]])


def views_of(work: Workspace) -> np.ndarray | None:
    """View vectors (H, W, 3) of the region's pixels under a perspective camera; None: all are (0, 0, 1)."""
    region, camera = region_of(work), work.camera_matrix
    return None if camera is None else view_vectors(camera, (region.height, region.width), region.x, region.y)


def levels(cache: FrameCache, name: str = OBJECT, shards: int = 24, every: int = 16) -> tuple[np.ndarray, np.ndarray]:
    """Static level (temporal median) and temporal maximum (H, W) of a crop, of the frames' dtype.

    Taken from at most so many whole shards spread over the capture, the median from every sixteenth frame of them:
    neighbouring frames say the same.
    """
    starts = np.arange(0, cache.frames, 64)
    chosen = starts[np.unique(np.linspace(0, len(starts) - 1, min(shards, len(starts))).round().astype(int))]
    every = max(1, min(every, cache.frames // 64))
    kept, brightest = [], None
    for start in chosen.tolist():
        block = cache.read(name, slice(start, start + 64))
        top = block.max(axis=0)
        brightest = top if brightest is None else np.maximum(brightest, top)
        kept.append(block[::every])
    assert brightest is not None
    stack = np.concatenate(kept)
    middle = (len(stack) - 1) // 2
    return np.partition(stack, middle, axis=0)[middle], brightest


def bars_of(work: Workspace, cache: FrameCache, mask: np.ndarray) -> np.ndarray:
    """Luma (H, W) above which each pixel of the region counts as lit; outside the mask (H, W) none does.

    Raises:
        UnusableCapture: the object never glints, or is saturated all the time.
    """
    static, brightest = levels(cache)
    bars = highlight_thresholds(static, saturation_level(brightest[mask], static[mask]), work.parameters.clusters.share)
    bars[~mask] = np.iinfo(bars.dtype).max
    return bars
