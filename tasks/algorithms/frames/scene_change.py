"""Change of scene: the place in a capture from which its frames show something else.

Two recordings in one video, an object that was pushed, or a sphere that was moved: what does not move with the light
changes at once, and for good. A moving light changes it everywhere a little, and all the time.
"""

import cv2
import numpy as np

from glint.tasks.algorithms.table.log_levels import log_levels

COMPARED_PIXELS = 20_000
"""Pixels to which frames are reduced, about, for the comparison."""
SURROUNDINGS_SIGMA_PX, MAX_CONTRAST = 3.0, 0.4
"""Standard deviation of the window that is a pixel's surroundings, and bound of the logarithm's contrast with them, so
that highlights count no more than edges."""
MIN_COMPARED_FRAMES = 60
"""Frames below which nothing is compared: a light that was first on one side and then on the other may change as
much."""
LONG_SHARE, SHORT_WINDOW = 0.1, 3
"""Frames on either side that are compared: for a lasting change, as a share of all, and for a sudden one."""
MIN_LASTING_RATIO, MIN_SUDDEN_RATIO, USUAL_QUANTILE = 2.0, 1.7, 0.95
"""Ratio of the largest lasting change to that anywhere else, and of the sudden change there to this quantile of all:
2.8 and 2.0 at least in five captures of two recordings, or whose object was moved, 1.5 and 1.6 at most in 58 others."""


def scene_change(frames: np.ndarray) -> int | None:
    """Return the index of the first frame of another scene; None: there is one scene, or there are too few frames.

    frames: (T, H, W) in levels of 8 bits, spread over the capture.
    """
    if len(frames) < MIN_COMPARED_FRAMES:
        return None
    contrasts = np.stack([_contrast(frame) for frame in frames])
    window = round(LONG_SHARE * len(frames))
    lasting, sudden = _changes(contrasts, window), _changes(contrasts, SHORT_WINDOW)
    first = int(np.nanargmax(lasting))
    # Windows that overlap the change show a part of it.
    elsewhere = lasting[np.abs(np.arange(len(frames)) - first) > window]
    is_lasting = lasting[first] > MIN_LASTING_RATIO * np.nanmax(elsewhere)
    at_once = np.nanmax(sudden[first - SHORT_WINDOW : first + SHORT_WINDOW + 1])
    return first if is_lasting and at_once > MIN_SUDDEN_RATIO * np.nanquantile(sudden, USUAL_QUANTILE) else None


def _changes(contrasts: np.ndarray, window: int) -> np.ndarray:
    """Return the mean change (T,) at each of some frames (T, h, w), from the window before it to that which it begins.

    It is NaN where either window is incomplete.
    """
    changes = np.full(len(contrasts), np.nan)
    before, after = contrasts[:window].mean(axis=0), contrasts[window : 2 * window].mean(axis=0)
    for number in range(window, len(contrasts) - window):
        changes[number] = np.abs(after - before).mean()
        before += (contrasts[number] - contrasts[number - window]) / window
        after += (contrasts[number + window] - contrasts[number]) / window
    return changes


def _contrast(frame: np.ndarray) -> np.ndarray:
    """Return the bounded contrast (h, w) float32 of a reduced frame (H, W) with its surroundings."""
    reduction = max(1.0, float(np.sqrt(frame.size / COMPARED_PIXELS)))
    height, width = (max(1, round(side / reduction)) for side in frame.shape)
    brightness = log_levels(cv2.resize(frame.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA))
    brightness -= cv2.GaussianBlur(brightness, (0, 0), SURROUNDINGS_SIGMA_PX)
    return np.clip(brightness, -MAX_CONTRAST, MAX_CONTRAST)
