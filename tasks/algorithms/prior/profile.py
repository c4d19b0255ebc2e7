"""Profile of a surface of revolution: smoothing that keeps corners, and removal of what the contour cannot show.

Source of the smoothing: local linear regression with one-sided and centred windows, of which the widest that fits is
chosen (the edge-preserving smoothing of Nagao and Matsuyama 1979).
"""

import numpy as np
from scipy import ndimage

WINDOWS_PX_AND_LIMITS = ((24.0, 0.35), (12.0, 0.35), (6.0, 0.35), (3.0, 0.5))
"""Half widths of the windows, widest first, and RMS errors of the radius in pixels up to which a line fits."""
ONE_SIDED_PENALTY = 1.3
"""Factor of a one-sided window's error, against a centred one's."""
MIN_TAN_TILT = 0.02
MIN_CONE_RADIUS_PX = 2.0
"""Radius above which a steep fall of the profile counts as a cone; below, it is the profile's tip."""
STEM_HEIGHT_PX = 6.0
"""Height above a cone in which the stem's radius is looked for."""
MIN_STEM_PX = 4.0
"""Least height of a profile above a cone for it to have a stem."""
SHOULDER_SHARE = 0.03
"""Distance of the shoulder before a cone, as a share of the largest radius."""


def smooth_profile(squared_radii: np.ndarray, heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the squared radii (N,) and their slopes (N,) without the staircase of pixels, corners kept.

    Lines are fitted to windows about and beside each height: the widest that fits is used.
    """
    radius = np.sqrt(squared_radii)
    step = heights[1] - heights[0]
    best = np.full(len(squared_radii), np.inf)
    value, slope = squared_radii.copy(), np.gradient(squared_radii, heights)
    for pixels, limit in WINDOWS_PX_AND_LIMITS:
        half_width = max(2, round(pixels / step))
        line = _fitted_lines(squared_radii, half_width, step)
        for shift in (0, half_width, -half_width):
            # A one-sided window is the centred one of a neighbour `shift` samples away, extrapolated to this height.
            line_value, line_slope, residual = (np.roll(values, shift) for values in line)
            line_value = line_value + line_slope * shift * step
            # An error of r^2 over 2 r is an error of r, in units of what a line may deviate.
            error = residual / (2.0 * radius + 2.0) / limit * (1.0 if shift == 0 else ONE_SIDED_PENALTY)
            error[_wrapped(len(error), shift)] = np.inf
            # Narrower windows count only where no wider one fits.
            is_better = (error < best) & ~(best <= 1.0)
            best, value, slope = (
                np.where(is_better, new, old) for new, old in ((error, best), (line_value, value), (line_slope, slope))
            )
    return np.maximum(value, 0.0), slope


def trimmed_profile(
    radii: np.ndarray, squared_radii: np.ndarray, slopes: np.ndarray, heights: np.ndarray, tilt: float
) -> tuple[np.ndarray, np.ndarray]:
    """Remove what the contour cannot rule out: cones that the camera sees edge-on above feet, flat ends and domes.

    Behind a corner of the profile the surface is assumed to be flat, behind a smooth shoulder to continue as a sphere.

    Args:
        radii: (N,), before they were smoothed.
        squared_radii: (N,), smoothed.
        slopes: (N,), of the squared radii.
        heights: (N,), equidistant.
        tilt: of the upper end towards the camera, radians.

    Returns:
        Squared radii (N,) and their slopes (N,).
    """
    if tilt < 0:
        # The lower end faces the camera: turn the profile upside down.
        kept, kept_slopes = trimmed_profile(radii[::-1], squared_radii[::-1], -slopes[::-1], -heights[::-1], -tilt)
        return kept[::-1], -kept_slopes[::-1]
    step = heights[1] - heights[0]
    # Slope of the radius along the axis at which the wall is parallel to the view.
    edge_on = -1.0 / max(np.tan(tilt), MIN_TAN_TILT)
    cones, count = ndimage.label(_edge_on_samples(radii, edge_on, step))
    before = max(2, round(SHOULDER_SHARE * radii.max() / step))
    kept = squared_radii.copy()
    for cone in ndimage.find_objects(cones)[:count]:
        below, above = cone[0].start, cone[0].stop
        # The corner between a foot and its stem is rounded by the contour: the stem is what comes a little above.
        has_stem = above * step < len(kept) * step - MIN_STEM_PX
        stem = kept[above : above + round(STEM_HEIGHT_PX / step)].min() if has_stem else 0.0
        shoulder = max(below - before, 0)
        if slopes[shoulder] / (2.0 * max(radii[shoulder], 1.0)) > 0.4 * edge_on:
            # The profile is not yet steep before the cone: a corner, with a flat end.
            kept[below:above] = stem
        else:
            # A sphere's squared radius is a parabola of the height, with the second derivative -2.
            distance = heights[below:above] - heights[shoulder]
            kept[below:above] = np.maximum(kept[shoulder] + slopes[shoulder] * distance - distance**2, stem)
        if stem == 0.0:
            kept[above:] = 0.0
            break
    kept[-1] = 0.0
    changed = ndimage.binary_dilation(kept != squared_radii, iterations=1)
    return kept, np.where(changed, np.gradient(kept, heights), slopes)


def _edge_on_samples(radii: np.ndarray, edge_on: float, step: float) -> np.ndarray:
    """Return the samples (N,) bool at which radii (N,) fall nearly as steeply as a wall seen edge-on."""
    reach = max(1, round(1.0 / step))
    before, after = np.append(np.zeros(reach), radii[:-reach]), np.append(radii[reach:], np.zeros(reach))
    slope = (after - before) / (2 * reach * step)
    return ndimage.binary_closing((slope < 0.7 * edge_on) & (radii > MIN_CONE_RADIUS_PX), iterations=reach)


def _wrapped(length: int, shift: int) -> slice:
    """Return the entries that `np.roll` by `shift` brings in from the opposite end."""
    return slice(0, shift) if shift >= 0 else slice(length + shift, length)


def _fitted_lines(values: np.ndarray, half_width: int, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return value, slope and RMS residual (N,) of the line fitted to `half_width` samples either side of each."""
    offset = np.arange(-half_width, half_width + 1) * step
    mean = ndimage.uniform_filter1d(values, 2 * half_width + 1, mode="nearest")
    slope = ndimage.correlate1d(values, offset / (offset**2).sum(), mode="nearest")
    # Variance about the overall mean, which loses fewer digits than about zero.
    square = ndimage.uniform_filter1d((values - values.mean()) ** 2, 2 * half_width + 1, mode="nearest")
    variance = square - (mean - values.mean()) ** 2 - slope**2 * (offset**2).mean()
    return mean, slope, np.sqrt(np.maximum(variance, 0.0))
