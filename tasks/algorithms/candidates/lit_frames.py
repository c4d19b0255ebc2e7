"""Frames in which each pixel is lit, as lists of varying length in one array (compressed sparse rows)."""

from typing import NamedTuple

import numpy as np
from numba import njit

BRIGHT_RISE, SPARSE_RISE = 0.85, 0.65
"""Rise of a highlight from background (0) to saturation (1) from which it counts under dense and under sparse lights: a
dim one is the edge of a highlight, or smaller than a pixel."""


class HighlightLevels(NamedTuple):
    """Levels of an object's highlights.

    thresholds: (...), of the frames' dtype, above which a pixel is lit; the dtype's largest value excludes it.
    saturation: level of clipped highlights. least_rise: rise at the thresholds.
    """

    thresholds: np.ndarray
    saturation: float
    least_rise: float = BRIGHT_RISE


class LitFrames(NamedTuple):
    """Frames in which each pixel is lit; those of pixel i are at starts[i] : starts[i + 1].

    starts: (N + 1,) int64. frames: (M,) int32, ascending within a pixel. brightness: (M,) float32, weight of each: 1
    under dense lights, under sparse ones from 0 at the threshold to 1 at saturation.
    """

    starts: np.ndarray
    frames: np.ndarray
    brightness: np.ndarray


@njit(cache=True, nogil=True)
def collect_lit_frames(frames: np.ndarray, usable: np.ndarray, levels: HighlightLevels) -> LitFrames:
    """Collect the frames in which each pixel exceeds its threshold, and how bright it is in them.

    A frame is compared at the speed of memory, then searched eight pixels at a time, since hardly any are lit.

    Args:
        frames: (T, N) uint8 or uint16.
        usable: frames that have a light, ascending.
        levels: thresholds (N,) among them.
    """
    thresholds, saturation, least_rise = levels
    pixels = frames.shape[1]
    # One byte per pixel, also read as 64-bit words: a word of zero means that none of its eight pixels is lit.
    words = np.zeros(-(-pixels // 8), np.uint64)
    above = words.view(np.uint8)
    capacity = max(1024, pixels)
    lit_pixel, lit_frame = np.empty(capacity, np.int32), np.empty(capacity, np.int32)
    count = 0
    starts = np.zeros(pixels + 1, np.int64)
    for t in usable:
        row = frames[t]
        for i in range(pixels):
            above[i] = row[i] > thresholds[i]
        if count + pixels > capacity:
            capacity = 2 * capacity + pixels
            lit_pixel, lit_frame = _enlarged(lit_pixel, capacity), _enlarged(lit_frame, capacity)
        for word in range(len(words)):
            if words[word] == 0:
                continue
            for i in range(8 * word, 8 * word + 8):
                if above[i]:
                    lit_pixel[count], lit_frame[count] = i, t
                    count += 1
                    starts[i + 1] += 1
    # Counting sort by pixel: the cumulative counts are the starts; within a pixel the frames keep their order.
    for i in range(pixels):
        starts[i + 1] += starts[i]
    end = starts[:pixels].copy()
    lit = np.empty(count, np.int32)
    brightness = np.empty(count, np.float32)
    sparseness = min(max((BRIGHT_RISE - least_rise) / (BRIGHT_RISE - SPARSE_RISE), 0.0), 1.0)
    for k in range(count):
        i, t = lit_pixel[k], lit_frame[k]
        lit[end[i]] = t
        below = max(saturation - frames[t, i], 0.0) / max(saturation - thresholds[i], 1.0)
        brightness[end[i]] = 1.0 - sparseness * min(below, 1.0)
        end[i] += 1
    return LitFrames(starts, lit, brightness)


@njit(cache=True, nogil=True)
def _enlarged(values: np.ndarray, capacity: int) -> np.ndarray:
    larger = np.empty(capacity, values.dtype)
    larger[: len(values)] = values
    return larger
