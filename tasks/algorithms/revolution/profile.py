"""Profile of a surface of revolution: smoothing that keeps corners, and removal of what the contour cannot show.

Source of the smoothing: local linear regression with one-sided and centred windows, of which the widest that fits is
chosen (the edge-preserving smoothing of Nagao and Matsuyama 1979).
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy import ndimage

WINDOWS_PX_AND_LIMITS = ((24.0, 0.35), (12.0, 0.35), (6.0, 0.35), (3.0, 0.5))
"""Half widths of the windows, widest first, and RMS errors of the radius in pixels up to which a line fits."""
ONE_SIDED_PENALTY = 1.3
"""Factor of a one-sided window's error, against a centred one's."""
MIN_TAN_TILT = 0.02
"""Least tangent of the tilt that is reckoned with: seen from the side, a wall seen edge-on has no finite slope."""
MIN_CONE_RADIUS_PX = 2.0
"""Radius above which a steep fall of the profile counts as a cone; below, it is the profile's tip."""
STEM_HEIGHT_PX, MIN_STEM_PX = 6.0, 4.0
"""Height above a cone in which the stem's radius is looked for, and least height of a profile there to have a stem."""
TIP_SAMPLES = 2
"""Samples by which a cone's tip may seem longer than MIN_CONE_RADIUS_PX makes it: both of its ends lie between two."""
SLOPE_REACH_PX, MAX_STEM_GAP_PX = 1.0, 2.0
"""Distance to both sides over which slopes are taken, and gap along the axis across which a stem's normals go on."""
SHOULDER_SHARE = 0.03
"""Distance of the shoulder before a cone, as a share of the largest radius."""
CONE_SLOPE_RATIO, MAX_CORNER_SLOPE_RATIO = 0.7, 0.4
"""Slopes of the radius, as shares of that of a wall seen edge-on: from which samples belong to a cone, and up to which
the wall before a cone ends at a corner; that of a smooth shoulder is steeper."""


@njit(cache=True, nogil=True)
def smooth_profile(
    squared_radii: np.ndarray, heights: np.ndarray, after_corner: bool, before_corner: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return squared radii (N,), at heights (N,), and their slopes (N,) without the staircase of pixels, corners kept.

    Lines are fitted to windows about and beside each height: the widest that fits is used. after_corner, before_corner:
    whether the profile begins, and ends, at a corner.
    """
    step, length = heights[1] - heights[0], len(squared_radii)
    best, value, slope = np.full(length, np.inf), squared_radii.copy(), np.empty(length)
    for sample in range(length):
        before, after = max(sample - 1, 0), min(sample + 1, length - 1)
        slope[sample] = (squared_radii[after] - squared_radii[before]) / ((after - before) * step)
    for pixels, limit in WINDOWS_PX_AND_LIMITS:
        half_width = max(2, round(pixels / step))
        if 2 * half_width >= length:
            continue
        means, slopes, residuals = _fitted_lines(squared_radii, half_width, step)
        # A window must not cross a corner, beyond which something else begins.
        first, last = half_width * int(after_corner), length - 1 - half_width * int(before_corner)
        for sample in range(length):
            # Narrower windows count only where no wider one fits.
            if best[sample] <= 1.0:
                continue
            for shift in (0, half_width, -half_width):
                # A one-sided window is the centred one of a neighbour, extrapolated to this height.
                centre = sample - shift
                if not first <= centre <= last:
                    continue
                # An error of r^2 over 2 r is an error of r, in units of what a line may deviate.
                error = residuals[centre] / (2.0 * np.sqrt(squared_radii[sample]) + 2.0) / limit
                if shift != 0:
                    error *= ONE_SIDED_PENALTY
                if error < best[sample] and best[sample] > 1.0:
                    best[sample], slope[sample] = error, slopes[centre]
                    value[sample] = means[centre] + slopes[centre] * shift * step
    return np.maximum(value, 0.0), slope


class Plate(NamedTuple):
    """Samples between which the contour shows nothing but the end of a stem: those of the plate's edge and the stem."""

    edge: int
    stem: int


def profile_of_contour(
    radii: np.ndarray, heights: np.ndarray, tilts: np.ndarray
) -> tuple[np.ndarray, np.ndarray, tuple[Plate, ...]]:
    """Return the profile of a surface of revolution from the largest circle inside its silhouette at each height.

    Beside a sharp edge the contour is that of the edge, and the circles form a cone that the camera sees edge-on, above
    as well as below: what lies there the contour does not show. Behind a corner of the profile the surface is assumed
    to be flat, or to end, behind a smooth shoulder to continue as a sphere.

    Args:
        radii: (N,), of the circles.
        heights: (N,), equidistant.
        tilts: (N,), of the axis towards the camera as seen at these heights, radians.

    Returns:
        Squared radii (N,), their slopes (N,), and the plates that face the camera.
    """
    step = float(heights[1] - heights[0])
    # Slopes of the radius along the axis at which the wall is parallel to the view.
    edge_on = -1.0 / np.maximum(np.abs(np.tan(tilts)), MIN_TAN_TILT)
    falling, rising = _cones(radii, edge_on, step), _mirrored(_cones(radii[::-1], edge_on[::-1], step), len(radii))
    squared, slopes, assumed = _smooth_walls(radii, heights, [*falling, *rising])
    kept = _without_cones(squared, slopes, heights, falling, step)
    below = _mirrored(rising, len(radii))
    kept = _without_cones(kept[::-1], -slopes[::-1], -heights[::-1], below, step)[::-1].copy()
    kept[[0, -1]] = 0.0
    changed = ndimage.binary_dilation((kept != squared) | assumed, iterations=1)
    facing = [Plate(cone.start - 1, cone.stop) for cone in falling if cone.is_sharp and tilts[cone.start] >= 0.0]
    facing += [Plate(cone.stop, cone.start - 1) for cone in rising if cone.is_sharp and tilts[cone.stop - 1] < 0.0]
    inside = range(1, len(kept) - 1)
    plates = tuple(plate for plate in facing if plate.stem in inside and kept[plate.stem] > 0.0)
    return kept, np.where(changed, np.gradient(kept, heights), slopes), plates


def with_risen_plate(squared_radii: np.ndarray, heights: np.ndarray, plate: Plate, slopes: np.ndarray) -> np.ndarray:
    """Return the squared radii (N,) with a plate that rises from its edge to its stem.

    The stem goes on as far as normals show it, and as wide; from there a cone leads to the edge. Without normals it
    rises half as far as the contour allows.

    Args:
        squared_radii: (N,).
        heights: (N,), equidistant.
        plate: within it the stem, drawn as far as the height of the edge.
        slopes: (N,) of the radius along the axis, by normals; NaN where there are none.
    """
    radii, step = np.sqrt(squared_radii), float(heights[1] - heights[0])
    sign = 1 if plate.edge > plate.stem else -1
    last, radius = plate.stem, float(radii[plate.stem])
    for sample in range(plate.stem + sign, plate.edge, sign):
        if np.isfinite(slopes[sample]):
            for between in range(last + sign, sample + sign, sign):
                radius += float(slopes[sample]) * sign * step
                radii[between] = radius
            last = sample
        elif abs(sample - last) * step > MAX_STEM_GAP_PX:
            break
    if last == plate.stem:
        # It is somewhere between flat and edge-on.
        last = (plate.stem + plate.edge) // 2
    cone = np.arange(last, plate.edge + sign, sign)
    radii[cone] = np.linspace(radii[last], radii[plate.edge], len(cone))
    return np.asarray(radii**2)


@dataclass(frozen=True, slots=True)
class _Cone:
    """Samples start to stop at which the camera sees the circles' envelope edge-on.

    is_sharp: whether they begin at a corner of the profile. before: number of samples from the shoulder to the first.
    tip: length of the cone's tip, which they leave out, in pixels.
    """

    start: int
    stop: int
    is_sharp: bool
    before: int
    tip: float


def _mirrored(cones: list[_Cone], length: int) -> list[_Cone]:
    """Return the cones of a profile of so many samples turned upside down."""
    return [replace(cone, start=length - cone.stop, stop=length - cone.start) for cone in reversed(cones)]


def _smooth_walls(
    radii: np.ndarray, heights: np.ndarray, cones: list[_Cone]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Smooth what the contour shows, not across corners; return squared radii, slopes, and what it does not show."""
    is_sharp, assumed = np.zeros(len(radii), bool), np.zeros(len(radii), bool)
    for cone in cones:
        assumed[cone.start : cone.stop] = True
        is_sharp[cone.start : cone.stop] |= cone.is_sharp
    squared, slopes = radii**2, np.gradient(radii**2, heights)
    walls, count = ndimage.label(~is_sharp)
    for (wall,) in ndimage.find_objects(walls)[:count]:
        if wall.stop - wall.start > 2:
            squared[wall], slopes[wall] = smooth_profile(
                radii[wall] ** 2, heights[wall], after_corner=wall.start > 0, before_corner=wall.stop < len(radii)
            )
    return squared, slopes, assumed


def _cones(radii: np.ndarray, edge_on: np.ndarray, step: float) -> list[_Cone]:
    """Return the cones at which the radius falls with the height."""
    reach = max(1, round(SLOPE_REACH_PX / step))
    labels, count = ndimage.label(_edge_on_samples(radii, edge_on, reach, step))
    before = max(2, round(SHOULDER_SHARE * radii.max() / step))
    cones = []
    for (cone,) in ndimage.find_objects(labels)[:count]:
        # Slopes are negative: where the wall is not yet steep before the cone there is a corner.
        last = max(cone.start - reach, 1)
        first = max(last - before, 0)
        slope = (radii[last] - radii[first]) / ((last - first) * step)
        is_sharp = bool(slope > MAX_CORNER_SLOPE_RATIO * edge_on[cone.start])
        tip = float(-MIN_CONE_RADIUS_PX / edge_on[cone.stop - 1]) + TIP_SAMPLES * step
        cones.append(_Cone(cone.start, cone.stop, is_sharp, before, tip))
    return cones


def _without_cones(
    squared_radii: np.ndarray, slopes: np.ndarray, heights: np.ndarray, cones: list[_Cone], step: float
) -> np.ndarray:
    """Return the squared radii (N,) with cones replaced at which the radius falls with the height."""
    kept = squared_radii.copy()
    for cone in cones:
        # The corner between a foot and its stem is rounded by the contour: the stem is what comes a little above.
        has_stem = cone.stop * step < len(kept) * step - max(MIN_STEM_PX, cone.tip)
        above = slice(cone.stop, cone.stop + max(1, round(STEM_HEIGHT_PX / step)))
        stem = kept[above].min() if has_stem else 0.0
        inside = slice(cone.start, cone.stop)
        if cone.is_sharp:
            kept[inside] = stem
        else:
            # A sphere's squared radius is a parabola of the height, with the second derivative -2.
            shoulder = max(cone.start - cone.before, 0)
            distance = heights[inside] - heights[shoulder]
            kept[inside] = np.maximum(kept[shoulder] + slopes[shoulder] * distance - distance**2, stem)
        if stem == 0.0:
            kept[cone.stop :] = 0.0
            break
    return kept


def _edge_on_samples(radii: np.ndarray, edge_on: np.ndarray, reach: int, step: float) -> np.ndarray:
    """Return the samples (N,) bool at which radii (N,) fall nearly as steeply as a wall seen edge-on."""
    before, after = np.append(np.zeros(reach), radii[:-reach]), np.append(radii[reach:], np.zeros(reach))
    slope = (after - before) / (2 * reach * step)
    return ndimage.binary_closing((slope < CONE_SLOPE_RATIO * edge_on) & (radii > MIN_CONE_RADIUS_PX), iterations=reach)


@njit(cache=True, nogil=True)
def _fitted_lines(values: np.ndarray, half_width: int, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return value, slope and RMS residual (N,) of the line fitted to `half_width` samples either side of each.

    Beyond the ends the last values are repeated.
    """
    length, offsets = len(values), np.arange(-half_width, half_width + 1) * step
    padded = values[np.minimum(np.maximum(np.arange(-half_width, length + half_width), 0), length - 1)]
    means, slopes, residuals = np.empty(length), np.zeros(length), np.zeros(length)
    squares = (offsets**2).sum()
    for sample in range(length):
        window = padded[sample : sample + len(offsets)]
        means[sample] = window.mean()
        for place, offset in enumerate(offsets):
            slopes[sample] += window[place] * offset / squares
        for place, offset in enumerate(offsets):
            residuals[sample] += (window[place] - means[sample] - slopes[sample] * offset) ** 2
    return means, slopes, np.sqrt(residuals / len(offsets))
