"""Luma thresholds above which a pixel counts as lit.

Yeung et al. 2009 threshold the intensities "to discard weak intensities" (section 4.2) without giving a threshold.
Since the background shows through glass, the threshold here is an excess over each pixel's own background level. Where
the lights are dense, each normal is close to a half vector, and its highlight is bright in some frame. Where they are
sparse, many normals lie between half vectors and show the edge of a highlight at most, so that dimmer ones must count.
In a set of photographs each light is alone, and what its edge shows cannot be averaged with what others do.
"""

import numpy as np

from glint.tasks.algorithms.candidates.lit_frames import BRIGHT_RISE, SPARSE_RISE, HighlightLevels
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.lighting.coverage import MIN_SWEEP_FRAMES, share_between

SPARSE_SHARE_RANGE = (0.14, 0.2)
"""Share of normals between the half vectors up to which lights are dense, and from which they are sparse."""

SATURATION_PERCENTILE = 99.9
"""Percentile of the object's peak levels that is the saturation level: in one frame the highlight of a light's disc of
2.2 degrees covers 0.10 to 0.15% of a sphere, and with few lights little more is covered in all."""
MIN_HEADROOM_SHARE = 0.02
"""Lower bound of a pixel's headroom, as a share of the saturation level: even a bright background has noise."""
MAX_BACKGROUND_SHARE = 0.93
"""Share of the dtype's largest value from which the background counts as saturated."""
MIN_CONTRAST_SHARE = 0.12
"""Share of the dtype's largest value by which highlights must exceed the background."""


def highlight_levels(
    background: np.ndarray, peak: np.ndarray, mask: np.ndarray, half_vectors: np.ndarray, rise: float | None = None
) -> HighlightLevels:
    """Return the levels of an object's highlights; outside the mask nothing is lit.

    Args:
        background: (H, W), integer dtype, each pixel's level without the light.
        peak: (H, W), of the same dtype, its highest level.
        mask: (H, W) bool, the object.
        half_vectors: (T, 3), NaN where the frame was rejected.
        rise: how far a highlight must rise from background (0) to saturation (1); None: by the density of the lights.

    Raises:
        UnusableCapture: the object shows no highlights, or is saturated all the time.
    """
    saturation = saturation_level(peak[mask], background[mask])
    rise = least_rise(half_vectors) if rise is None else rise
    thresholds = highlight_thresholds(background, saturation, rise)
    thresholds[~mask] = np.iinfo(thresholds.dtype).max
    return HighlightLevels(thresholds, saturation, rise)


def least_rise(half_vectors: np.ndarray) -> float:
    """Return how far a highlight must rise from background (0) to saturation (1) under these lights.

    half_vectors: (T, 3), NaN where the frame was rejected.
    """
    if np.isfinite(half_vectors[:, 0]).sum() < MIN_SWEEP_FRAMES:
        return BRIGHT_RISE
    return float(np.interp(share_between(half_vectors), SPARSE_SHARE_RANGE, (BRIGHT_RISE, SPARSE_RISE)))


def highlight_thresholds(background: np.ndarray, saturation: float, rise: float) -> np.ndarray:
    """Return the luma (H, W), of the background's dtype, above which a pixel counts as lit.

    Args:
        background: (H, W), integer dtype, the pixel's level without the light.
        saturation: level of clipped highlights.
        rise: how far a highlight must rise from background (0) to saturation (1), from `least_rise`: a picture behind
            the glass is no highlight, however bright.
    """
    headroom = np.maximum(saturation - background.astype(np.float64), MIN_HEADROOM_SHARE * saturation)
    # What is saturated without the light never counts as lit.
    highest = np.iinfo(background.dtype).max
    return np.minimum(np.floor(background + rise * headroom), highest).astype(background.dtype)


def saturation_level(peak: np.ndarray, background: np.ndarray) -> float:
    """Return the level of clipped highlights.

    Args:
        peak: temporal maximum (N,) of the object's pixels, integer dtype.
        background: their levels (N,) without the light.

    Raises:
        UnusableCapture: the object shows no highlights, or is saturated all the time.
    """
    limit = float(np.iinfo(peak.dtype).max)
    saturation, dark = float(np.percentile(peak, SATURATION_PERCENTILE)), float(np.median(background))
    if dark >= MAX_BACKGROUND_SHARE * limit:
        raise UnusableCapture(
            f"the object is saturated all the time (its background level is {dark:.0f} of {limit:.0f})",
            "lower the exposure until only the highlights clip, and darken the room",
        )
    if saturation - dark < MIN_CONTRAST_SHARE * limit:
        raise UnusableCapture(
            f"the object shows no highlights (its peak level is {saturation:.0f}, its background level {dark:.0f},"
            f" of {limit:.0f})",
            "move a bright light around the object, expose so that its highlights clip, and check the region; a dark"
            " matte object has none",
        )
    return saturation
