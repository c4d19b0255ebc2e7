"""Path of a hand-held light: an unsteady spiral over the hemisphere that lingers and is sometimes off.

Simulates the moving spotlight of section 5 ("Setup"); the parameters are chosen, not published.
"""

import numpy as np
from scipy.ndimage import gaussian_filter1d

MAX_LIGHT_ANGLE_DEG = 88.0
"""Largest angle of the light from the camera axis."""


def light_path(frames: int, generator: np.random.Generator, missing_quarter: bool = False) -> np.ndarray:
    """Return light directions (frames, 3) float32, unit, camera frame; NaN where the light is off.

    The turns of the spiral are spaced so that some 2,000 frames leave 2 to 6 frames within 1.5 degrees of a half
    vector. A few frames at the end have the light behind the object or off.

    Args:
        frames: how many.
        generator: random numbers; the same state gives the same path.
        missing_quarter: whether one quarter of the azimuths is never visited.
    """
    turns = max(3.0, 0.30 * np.sqrt(frames))
    # The pace varies, so the light lingers; the square root below then covers the hemisphere evenly.
    pace = np.exp(0.8 * _smooth_noise(frames, frames / 25, generator))
    progress = np.concatenate([[0.0], np.cumsum(pace[1:])])
    progress /= max(progress[-1], 1e-9)
    angle = MAX_LIGHT_ANGLE_DEG * np.sqrt(progress) * (1.0 + 0.03 * _smooth_noise(frames, frames / 60, generator))
    azimuth = 2.0 * np.pi * turns * np.sqrt(progress) + generator.uniform(0, 2 * np.pi)
    azimuth += 0.25 * _smooth_noise(frames, frames / 30, generator)
    tremor = 0.7 * _smooth_noise(frames, 8.0, generator)
    polar = np.radians(np.clip(angle + tremor, 0.0, MAX_LIGHT_ANGLE_DEG))
    if missing_quarter:
        # The azimuths are compressed, so the light wraps round at the quarter's edges without entering it.
        start = generator.uniform(0, 2 * np.pi)
        offset = np.mod(azimuth - start, 2 * np.pi)
        azimuth = start + 0.75 * offset
    lights = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)
    tail = max(0, round(0.01 * frames))
    if tail:
        lights[-tail:, 2] = -np.abs(lights[-tail:, 2]) - 0.3
        lights[-tail:] /= np.linalg.norm(lights[-tail:], axis=1, keepdims=True)
        lights[-2 * tail : -tail] = np.nan
    return lights.astype(np.float32)


def _smooth_noise(count: int, length: float, generator: np.random.Generator) -> np.ndarray:
    """Return Gaussian noise (count,) of unit standard deviation, smoothed over `length` frames."""
    noise = gaussian_filter1d(generator.normal(size=count), max(length, 1.0), mode="reflect")
    return noise / max(float(noise.std()), 1e-9)
