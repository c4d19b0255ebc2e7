"""The path of a hand that moves a lamp: a spiral over the hemisphere, unsteady, lingering, now and then out of use."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

STEEPEST = 88.0
"""Degrees from the camera axis to which the lamp is swung."""


def sweep(frames: int, generator: np.random.Generator, missing_quarter: bool = False) -> np.ndarray:
    """Light directions (frames, 3) float32, unit, camera frame; NaN where the lamp is off.

    The turns of the spiral lie so that some 2,000 frames leave 2 to 6 frames within 1.5 degrees of a half vector. A few
    frames at the end show the lamp behind the object or off.
    """
    turns = max(3.0, 0.30 * np.sqrt(frames))
    pace = np.exp(0.8 * _wander(frames, frames / 25, generator))
    progress = np.concatenate([[0.0], np.cumsum(pace[1:])])
    progress /= max(progress[-1], 1e-9)
    angle = STEEPEST * np.sqrt(progress) * (1.0 + 0.03 * _wander(frames, frames / 60, generator))
    around = 2.0 * np.pi * turns * np.sqrt(progress) + generator.uniform(0, 2 * np.pi)
    around += 0.25 * _wander(frames, frames / 30, generator)
    polar = np.radians(np.clip(angle + 0.7 * _wander(frames, 8.0, generator), 0.0, STEEPEST))
    if missing_quarter:
        # The hand turns back at the quarter's edges instead of crossing it.
        start = generator.uniform(0, 2 * np.pi)
        along = np.mod(around - start, 2 * np.pi)
        around = start + 0.75 * along
    lights = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1)
    tail = max(0, round(0.01 * frames))
    if tail:
        lights[-tail:, 2] = -np.abs(lights[-tail:, 2]) - 0.3
        lights[-tail:] /= np.linalg.norm(lights[-tail:], axis=1, keepdims=True)
        lights[-2 * tail : -tail] = np.nan
    return lights.astype(np.float32)


def _wander(count: int, length: float, generator: np.random.Generator) -> np.ndarray:
    """Smooth noise (count,) of unit deviation that forgets itself over `length` frames."""
    noise = gaussian_filter1d(generator.normal(size=count), max(length, 1.0), mode="reflect")
    return noise / max(float(noise.std()), 1e-9)
