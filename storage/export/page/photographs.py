"""Photographs of an object for its page: frames of lights from all sides, their median and maximum over the video."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from glint.storage.errors import StoreError
from glint.storage.export.page.packing import Part
from glint.storage.footage.luma import eight_bits
from glint.storage.frames.cache import FrameCache
from glint.storage.locations.location import Location
from glint.storage.versions.stage_results import StageResult

OBJECT_CROP = "object"
"""The array of cached frames that shows the region."""
JPEG_QUALITY = 88
"""JPEG quality of photographs on the page, at which artefacts stay below the noise of a compressed video."""


@dataclass(frozen=True, slots=True)
class Photograph:
    """A picture of the region: a frame with its light (unit vector), or the `median` or `maximum` over time."""

    label: str
    picture: Part
    frame: int | None = None
    light: tuple[float, float, float] | None = None


def photographs(
    location: Location, stages: Mapping[str, StageResult], n_frames: int, scale: float
) -> Iterator[Photograph]:
    """Yield the pictures that the store holds: of `n_frames` frames, where they are still cached, and of all frames.

    scale: of the pictures' sides. Frames evicted from the cache are left out.
    """
    if "frames" not in stages:
        return
    stored = stages["frames"]
    for label, array in (("maximum", "peak"), ("median", "background")):
        if array in stored.arrays:
            yield Photograph(label, encode_jpeg(eight_bits(stored.read(array)), scale))
    if "lights" not in stages or "cache" not in stored.record:
        return
    lights = stages["lights"].read("lights")
    chosen = spread_frames(lights, n_frames)
    if not chosen:
        return
    try:
        cache = FrameCache.open(location, str(stored.record["cache"]))
        for frame in chosen:
            x, y, z = (round(float(part), 5) for part in lights[frame])
            yield Photograph("frame", _cached_photograph(cache, frame, scale), frame, (x, y, z))
    except StoreError:
        # A cache may be evicted or damaged at any time; it is rebuilt by the next run, the page does without.
        return


def frame_photograph(location: Location, frames: StageResult, frame: int) -> Part:
    """Return a frame's picture of the region.

    frames: the result of the stage of that name.

    Raises:
        StoreError: the frame is not in the cache.
    """
    return _cached_photograph(FrameCache.open(location, str(frames.record["cache"])), frame)


def _cached_photograph(cache: FrameCache, frame: int, scale: float = 1.0) -> Part:
    if not 0 <= frame < cache.frames:
        raise StoreError(f"frame {frame} is not cached", "run again: the frames are decoded again")
    return encode_jpeg(eight_bits(cache.read(OBJECT_CROP, slice(frame, frame + 1))[0]), scale)


def spread_frames(lights: np.ndarray, count: int) -> list[int]:
    """Return at most `count` frames whose lights (T, 3) are far from each other: each the farthest from those before.

    The first is the one nearest to the camera's axis; frames without a light (NaN) are left out. Sorted.
    """
    known = np.flatnonzero(np.isfinite(lights).all(axis=-1))
    if not known.size or not count:
        return []
    directions = lights[known].astype(float)
    chosen = [int(directions[:, 2].argmax())]
    nearest = directions @ directions[chosen[0]]
    while len(chosen) < min(count, len(known)):
        chosen.append(int(nearest.argmin()))
        nearest = np.maximum(nearest, directions @ directions[chosen[-1]])
    return sorted({int(known[index]) for index in chosen})


def encode_jpeg(picture: np.ndarray, scale: float = 1.0) -> Part:
    """Return a grey picture (H, W) uint8, its sides multiplied by `scale`, as a JPEG file.

    Raises:
        StoreError: it is empty.
    """
    if scale < 1.0:
        size = tuple(max(1, round(side * scale)) for side in picture.shape[::-1])
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    is_encoded, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not is_encoded:
        raise StoreError(f"a picture of shape {picture.shape} cannot be encoded", "give a picture that is not empty")
    return Part("image/jpeg", picture.shape, data.tobytes())
