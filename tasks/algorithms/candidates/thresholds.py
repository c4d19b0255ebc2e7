"""Luma thresholds above which a pixel counts as lit.

Yeung et al. 2009 threshold the intensities "to discard weak intensities" (section 4.2) without giving a threshold.
Since the background shows through glass, the threshold here is an excess over each pixel's own background level.
"""

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture

SATURATION_PERCENTILE = 99.9
"""Percentile of the object's peak levels that is the saturation level: in one frame the highlight of a light's disc of
2.2 degrees covers at least 0.15% of a convex object, and with few lights little more is covered in all."""
MIN_HEADROOM_SHARE = 0.02
"""Lower bound of a pixel's headroom, as a share of the saturation level: even a bright background has noise."""
MAX_BACKGROUND_SHARE = 0.93
"""Share of the dtype's largest value from which the background counts as saturated."""
MIN_CONTRAST_SHARE = 0.12
"""Share of the dtype's largest value by which highlights must exceed the background."""


def highlight_thresholds(background: np.ndarray, saturation: float, min_rise: float = 0.85) -> np.ndarray:
    """Return the luma (H, W), of the background's dtype, above which a pixel counts as lit.

    Args:
        background: (H, W), integer dtype, the pixel's level without the light.
        saturation: level of clipped highlights.
        min_rise: how far a highlight must rise from background (0) to saturation (1): a picture behind the glass is no
            highlight, however bright.
    """
    headroom = np.maximum(saturation - background.astype(np.float64), MIN_HEADROOM_SHARE * saturation)
    return np.floor(background + min_rise * headroom).astype(background.dtype)


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
