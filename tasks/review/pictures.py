"""Pictures of a capture's inputs: the whole frame at a moment, its levels over time, its thumbnail.

Only region and spheres are kept of a video's frames. Around them a picture shows the first frame, which is decoded at
once however long the video is: the camera stands still, and nothing there is used.
"""

from functools import lru_cache

import cv2
import numpy as np

from glint.storage.errors import InputError
from glint.storage.export.image_files import encode_png
from glint.storage.footage.luma import eight_bits
from glint.storage.footage.source import open_footage
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.review.stored import saved_records
from glint.tasks.stages.capture_geometry import OBJECT, CaptureGeometry
from glint.tasks.stages.frames import open_frames
from glint.tasks.stages.levels import levels, load_levels

THUMBNAIL_SIZE = 112
"""Pixels of a thumbnail's longer side, twice what the catalogue view shows, for fine screens."""
KEPT_FRAMES = 4
"""First frames that a server keeps, each of as many bytes as the frame has pixels or twice that."""
KEPT_THUMBNAILS = 500
"""Thumbnails of captures that never ran which a server keeps, some kilobytes each."""
SAMPLE_FRAMES = 24
"""Frames from which background and peak level are taken while the stage `frames` has no result."""
LEVELS = ("background", "peak", "mean")
"""Levels over time: median, maximum, and mean, which shows the object under light from all sides."""


def frame_picture(context: CaptureContext, number: int) -> bytes:
    """Return frame `number`, counted from 0, as PNG of the full frame.

    Raises:
        InputError, StoreError: as `frame_image`.
    """
    return encode_png(frame_image(context, number))


def level_picture(context: CaptureContext, level: str) -> bytes:
    """Return a level over time as PNG of the full frame.

    Raises:
        InputError, StoreError: as `level_image`.
    """
    return encode_png(level_image(context, level))


def frame_image(context: CaptureContext, number: int) -> np.ndarray:
    """Return frame `number`, counted from 0, of the full frame, (H, W) uint8.

    Raises:
        InputError: the video cannot be read, or has no such frame.
        StoreError: the store cannot be read.
    """
    if number == 0:
        return eight_bits(first_frame(context)).copy()
    if "frames" not in saved_records(context):
        raise InputError("only the first frame is known before the first run", "run the capture")
    whole, cache = eight_bits(surveyed_frame(context)).copy(), open_frames(context)
    if number >= cache.frames:
        raise InputError(f"there is no frame {number:,}", f"the last one is {cache.frames - 1:,}")
    for name, crop in cache.crops.items():
        whole[crop.rows, crop.columns] = eight_bits(cache.read(name, slice(number, number + 1))[0])
    return whole


def level_image(context: CaptureContext, level: str) -> np.ndarray:
    """Return a level over time (one of LEVELS) of the full frame, (H, W) uint8; the mean is that of SAMPLE_FRAMES.

    Raises:
        InputError: the video cannot be read, or there is no such level; StoreError: the store cannot be read.
    """
    if level not in LEVELS:
        raise InputError(f"there is no level {level!r}", f"choose from {', '.join(LEVELS)}")
    if level == "mean":
        return np.asarray(frame_sample(context).mean(axis=0).round(), np.uint8)
    if "frames" not in saved_records(context):
        sample = frame_sample(context)
        return np.asarray(sample.max(axis=0) if level == "peak" else np.median(sample, axis=0), np.uint8)
    whole, cache = eight_bits(surveyed_frame(context)).copy(), open_frames(context)
    for name, crop in cache.crops.items():
        pictures = load_levels(context) if name == OBJECT else levels(cache, name)
        whole[crop.rows, crop.columns] = eight_bits(pictures[LEVELS.index(level)])
    return whole


def thumbnail(context: CaptureContext) -> bytes:
    """Return a small PNG of the object under all lights, of the first frame where nothing has run yet.

    Raises:
        InputError: the video cannot be read; StoreError: the store cannot be read.
    """
    if "frames" in saved_records(context):
        background, peak = (eight_bits(level).astype(np.float32) for level in load_levels(context))
        # The peak level alone is nearly white where the light has been all round.
        return _small_picture((0.6 * background + 0.4 * peak).astype(np.uint8))
    return _first_thumbnail(*_stamped_address(context))


def _small_picture(image: np.ndarray) -> bytes:
    """Return a picture (H, W) uint8 as PNG whose longer side has THUMBNAIL_SIZE pixels."""
    scale = THUMBNAIL_SIZE / max(image.shape)
    size = (max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale)))
    return encode_png(cv2.resize(image, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR))


def stored_geometry(context: CaptureContext) -> CaptureGeometry | None:
    """Return what the survey found, None before the first run."""
    saved = saved_records(context)
    return CaptureGeometry.of(saved["survey"][1]) if "survey" in saved else None


def first_frame(context: CaptureContext) -> np.ndarray:
    """Return the first frame, luma (H, W).

    Raises:
        InputError: the video cannot be read.
    """
    return _first_frame(*_stamped_address(context))


def surveyed_frame(context: CaptureContext) -> np.ndarray:
    """Return the first frame, luma (H, W), in which the places that the last run stored are the same.

    Raises:
        InputError: the video cannot be read, or has another size than at the last run; StoreError: the store cannot.
    """
    frame, geometry = first_frame(context), stored_geometry(context)
    height, width = frame.shape
    if geometry is not None and geometry.frame_size != (width, height):
        earlier = f"{geometry.frame_size[0]} x {geometry.frame_size[1]}"
        raise InputError(
            f"the video is {width} x {height} pixels, and was {earlier} at the last run", "run the capture"
        )
    return frame


def frame_sample(context: CaptureContext) -> np.ndarray:
    """Return frames spread over the video, (T, H, W) uint8.

    Raises:
        InputError: the video cannot be read.
    """
    return _frame_sample(*_stamped_address(context))


@lru_cache(maxsize=KEPT_FRAMES)
def _first_frame(address: str, stamp: str) -> np.ndarray:
    return _read_first(address)


@lru_cache(maxsize=KEPT_THUMBNAILS)
def _first_thumbnail(address: str, stamp: str) -> bytes:
    return _small_picture(eight_bits(_read_first(address)))


def _read_first(address: str) -> np.ndarray:
    with open_footage(address) as footage:
        return next(iter(footage.frames()))


@lru_cache(maxsize=2)
def _frame_sample(address: str, stamp: str) -> np.ndarray:
    with open_footage(address) as footage:
        return np.stack([eight_bits(frame) for frame in footage.spread(SAMPLE_FRAMES)])


def _stamped_address(context: CaptureContext) -> tuple[str, str]:
    """Return the address of a capture's frames, and a text that is another one once they have changed."""
    address = context.file("frames")
    assert address is not None
    return address, str(context.stamps(("frames",)))
