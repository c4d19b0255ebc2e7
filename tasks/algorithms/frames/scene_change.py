"""Change of scene: the place in a capture from which its frames show something else.

Two recordings in one video, an object that was pushed, or a sphere that was moved: what does not move with the light
changes once, for good. A moving light changes it everywhere a little, and all the time.
"""

import cv2
import numpy as np

COMPARED_WIDTH = 200
"""Width in pixels to which frames are reduced for the comparison."""
DARK_LEVEL, SURROUNDINGS_SIGMA_PX, MAX_CONTRAST = 8.0, 3.0, 0.4
"""Level that is added before the logarithm; standard deviation of the window that is a pixel's surroundings; and bound
of the logarithm's contrast with them, so that highlights count no more than edges."""
WINDOW_SHARE, MIN_WINDOW = 0.1, 6
"""Frames on either side that are compared, as a share of all, and least number of them."""
MIN_CHANGE_RATIO = 2.0
"""Ratio of the largest change to that anywhere else from which it is one of the scene: 1.5 at most in 58 captures, 2.8
and more in five of two recordings, or whose object was moved."""


def scene_change(frames: np.ndarray) -> int | None:
    """Return the index of the first frame of another scene; None: there is one scene, or there are too few frames.

    frames: (T, H, W) in levels of 8 bits, spread over the capture.
    """
    window = max(MIN_WINDOW, round(WINDOW_SHARE * len(frames)))
    if len(frames) < 4 * window:
        return None
    contrast = np.stack([_contrast(frame) for frame in frames])
    sums = np.concatenate([np.zeros((1, *contrast.shape[1:])), np.cumsum(contrast, axis=0, dtype=float)])
    means = (sums[window:] - sums[:-window]) / window
    change = np.abs(means[window:] - means[:-window]).mean(axis=(1, 2))
    largest = int(change.argmax())
    # Windows that overlap the change show a part of it.
    elsewhere = change[np.abs(np.arange(len(change)) - largest) > window]
    return largest + window if change[largest] > MIN_CHANGE_RATIO * elsewhere.max() else None


def _contrast(frame: np.ndarray) -> np.ndarray:
    """Return the bounded contrast (h, w) of a reduced frame (H, W) with its surroundings."""
    height, width = frame.shape
    scale = max(1, width // COMPARED_WIDTH)
    size = (max(1, width // scale), max(1, height // scale))
    brightness = np.log(cv2.resize(frame.astype(np.float32), size, interpolation=cv2.INTER_AREA) + DARK_LEVEL)
    brightness -= cv2.GaussianBlur(brightness, (0, 0), SURROUNDINGS_SIGMA_PX)
    return np.clip(brightness, -MAX_CONTRAST, MAX_CONTRAST)
