"""Show a question: a loop of the frames around its highlight, the sphere in them, and their half vectors."""

from typing import Any

import numpy as np

from glint.storage.errors import InputError
from glint.storage.export.image_files import encode_png
from glint.storage.footage.luma import eight_bits
from glint.tasks.questions.capture_questions import CaptureQuestions, ShownQuestion
from glint.tasks.stages.capture_geometry import OBJECT

LOOP_FRAMES = 24
"""Frames that a loop shows before and after the question's own: two seconds at 24 frames per second."""
WINDOW_PX = 56
"""Pixels around a highlight that a loop shows, on each side."""


def facts_of(held: CaptureQuestions, shown: ShownQuestion) -> dict[str, Any]:
    """Return a question as JSON values.

    Pixels are those of the full frame; `sheet`: pixels (x, y) of the sheet; `loop`: its frames and its window;
    `lights`: x and y of the frames' half vectors, None where the light was rejected.

    Raises:
        InputError: its pixel lies outside the region.
    """
    question, region = shown.question, held.geometry.region
    first, count = _loop(shown.frame, held.frames.cache.frames)
    rows, columns = _window(held, shown.x, shown.y)
    sphere = _sphere_crop(held)
    crop = None if sphere is None else held.geometry.crops[sphere]
    lights = held.frames.half_vectors[first : first + count, :2]
    return {
        "frame": shown.frame,
        "x": shown.x,
        "y": shown.y,
        "accepted": question.exterior,
        "wrong": round(question.wrong, 3),
        "sheet": [
            [int(column) + region.x, int(row) + region.y]
            for row, column in zip(question.rows, question.columns, strict=True)
        ],
        "loop": {
            "first": first,
            "count": count,
            "x": region.x + columns.start,
            "y": region.y + rows.start,
            "width": columns.stop - columns.start,
            "height": rows.stop - rows.start,
        },
        "sphere": None if crop is None else {"width": crop.width, "height": crop.height},
        "lights": [[round(float(x), 3), round(float(y), 3)] if np.isfinite(x) else None for x, y in lights],
    }


def loop_picture(held: CaptureQuestions, frame: int, x: int, y: int, part: str) -> bytes:
    """Return the frames of a loop around a highlight, one below the other, as PNG.

    part: `object`, the window around the highlight; `sphere`, the first chrome sphere.

    Raises:
        InputError: there is no such frame or sphere, or the pixel lies outside the region; StoreError: the store cannot
            be read.
    """
    cache = held.frames.cache
    if frame >= cache.frames:
        raise InputError(f"there is no frame {frame:,}", f"the last one is {cache.frames - 1:,}")
    first, count = _loop(frame, cache.frames)
    if part == OBJECT:
        frames = cache.read(OBJECT, slice(first, first + count), *_window(held, x, y))
    else:
        sphere = _sphere_crop(held)
        if sphere is None:
            raise InputError(f"{held.work.name} has no chrome sphere", "its lights are known from a file")
        frames = cache.read(sphere, slice(first, first + count))
    return encode_png(eight_bits(np.ascontiguousarray(frames)).reshape(-1, frames.shape[2]))


def _loop(frame: int, frames: int) -> tuple[int, int]:
    """Return the first frame of a loop around `frame`, and their number."""
    first = max(0, frame - LOOP_FRAMES)
    return first, min(frames, frame + LOOP_FRAMES + 1) - first


def _window(held: CaptureQuestions, x: int, y: int) -> tuple[slice, slice]:
    """Return the region's rows and columns around a pixel of the full frame.

    Raises:
        InputError: the pixel lies outside the region.
    """
    row, column = held.geometry.row_and_column(x, y)
    region = held.geometry.region
    return (
        slice(max(0, row - WINDOW_PX), min(region.height, row + WINDOW_PX + 1)),
        slice(max(0, column - WINDOW_PX), min(region.width, column + WINDOW_PX + 1)),
    )


def _sphere_crop(held: CaptureQuestions) -> str | None:
    return next((name for name in held.geometry.crops if name != OBJECT), None)
