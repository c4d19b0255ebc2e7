"""Frames: the video decoded once, cropped to the object and to each sphere, and cut into chunks."""

from collections.abc import Mapping
from functools import lru_cache, partial
from hashlib import sha256
from time import monotonic
from typing import Any

import numpy as np

from glint.storage.catalogue.loading import Region
from glint.storage.errors import StoreError
from glint.storage.footage.source import Footage, open_footage
from glint.storage.frames.cache import FrameCache, cache_digest
from glint.storage.frames.eviction import mark_used
from glint.storage.inputs.digests import input_stamps
from glint.storage.locations.location import Location
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import CaptureResults, StageInputs
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.levels import BACKGROUND, CLIPPED, PEAK, LevelRecorder, stored_levels
from glint.tasks.stages.stabilization import CONTINUOUS_FRAMES, REFERENCE, stabilized
from glint.tasks.stages.thumbnails import NUMBERS, PICTURES, ThumbnailRecorder

USE_SECONDS = 600.0
"""How often the use of frames is written down."""


def frames(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Fill the cache of frames, moved back where the camera was shaken; take background and peak level of the region.

    Raises:
        InputError: the video cannot be read.
        StoreError: the store cannot be written.
    """
    digest, address = _digest(inputs), inputs.file("frames")
    assert address is not None
    survey = inputs.load("survey")
    recorded = [name for name in (PICTURES, NUMBERS, BACKGROUND, PEAK, CLIPPED) if name in survey.arrays]
    arrays = {name: survey.read(name) for name in recorded}
    if PICTURES in arrays:
        cache = open_cache(inputs, digest, progress)
        if CLIPPED not in arrays:
            arrays |= stored_levels(cache)
    else:
        with open_footage(address) as footage:
            thumbnails = ThumbnailRecorder(footage)
            recorder = LevelRecorder(_still(inputs, thumbnails), load_geometry(inputs).region)
            cache = fill_cache(inputs, digest, load_geometry(inputs).crops, recorder, progress)
            arrays |= {**thumbnails.arrays(), **recorder.arrays(cache)}
    return StageOutput(
        arrays=arrays,
        record={"cache": cache.digest, "frame_size": list(cache.frame_size[::-1])},
        counts={"frames": cache.frames},
        warnings=[StageWarning(message, "video") for message in cache.warnings],
    )


def open_frames(results: CaptureResults) -> FrameCache:
    """Open the capture's cache of frames, filled again from the video where it is gone or incomplete.

    Raises:
        InputError: the video cannot be read; StoreError: the store fails.
    """
    return open_cache(results, str(results.load("frames").record["cache"]))


def open_cache(results: CaptureResults, digest: str, progress: Progress | None = None) -> FrameCache:
    """Open a cache of the capture's frames, filled from the video where it is gone or incomplete.

    Raises:
        InputError: the video cannot be read; StoreError: the store fails, or video, region or spheres have changed
            since the frames were stored, so that they cannot be stored again.
    """
    cache = _complete(results.location, digest)
    if cache is not None:
        return cache
    if digest != _digest(results):
        raise StoreError(
            "the stored frames are gone, and video, region or spheres have changed since", "run the capture again"
        )
    address = results.file("frames")
    assert address is not None
    with open_footage(address) as footage:
        return fill_cache(results, digest, load_geometry(results).crops, _still(results, footage), progress)


def fill_cache(
    results: CaptureResults,
    digest: str,
    crops: Mapping[str, Region],
    source: Footage,
    progress: Progress | None = None,
) -> FrameCache:
    """Store the crops of all frames of `source`, unless they are stored.

    Raises:
        InputError: the video cannot be read; StoreError: the store fails.
    """
    return _complete(results.location, digest) or FrameCache.ingest(
        source, results.location, digest, crops, progress, partial(_unchanged, results)
    )


def load_thumbnails(results: CaptureResults) -> tuple[np.ndarray, np.ndarray]:
    """Load the thumbnails (N, h, w) uint8 of the whole frame, 0 to 255, and the number (N,) of each one's frame."""
    stored = results.load("frames")
    return stored.read(PICTURES), stored.read(NUMBERS)


def _digest(results: CaptureResults) -> str:
    """Return the name of the cache: it follows from the video's content, the crops and the stabilization."""
    survey, content = results.load("survey"), results.digest("frames") or ""
    stabilization = survey.record["stabilization"]
    if stabilization["applied"]:
        reference = sha256(survey.read(REFERENCE).tobytes()).hexdigest()
        content = f"{content} stabilized to {reference} at {stabilization['origin']} {stabilization['places']}"
        content = f"{content} as within {CONTINUOUS_FRAMES} frames"
    return cache_digest(content, load_geometry(results).crops)


def _complete(location: Location, digest: str) -> FrameCache | None:
    """Open the cache; None where it is gone or incomplete."""
    try:
        cache = FrameCache.open(location, digest)
    except StoreError:
        return None
    if cache.complete:
        _mark_used(location, digest, int(monotonic() // USE_SECONDS))
    return cache if cache.complete else None


def _still(results: CaptureResults, footage: Footage) -> Footage:
    """Return the video, moved back where the camera was shaken."""
    survey = results.load("survey")
    return stabilized(footage, survey.record["stabilization"], survey.arrays)


def _unchanged(results: CaptureResults) -> list[list[Any]]:
    """Return what tells the video from others.

    Raises:
        InputError: it is not the one whose digest names the cache.
    """
    address = results.file("frames")
    assert address is not None
    stamps = input_stamps(address)
    results.check_unchanged(["frames"])
    return stamps


@lru_cache(maxsize=256)
def _mark_used(location: Location, digest: str, period: int) -> None:
    """Mark frames as used, once per `period` and process."""
    mark_used(location, digest)
