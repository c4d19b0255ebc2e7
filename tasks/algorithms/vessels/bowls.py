"""Bowls: surfaces of revolution into which the camera looks, so that nearly all that it sees is their inside.

The contour of a shallow bowl is that of its rim, which hides the outside: given a tilt it tells where the rim is, and
nothing of what lies below. That follows from the normals of the inside. Each gives the slope of a whole circle, and the
profile is the integral of the slopes from the rim downwards; which circle a pixel shows depends on the profile in turn,
so that both are found in rounds. Below the last circle that shows a highlight the profile goes on as steeply.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.contours import smooth_contour
from glint.tasks.algorithms.geometry.distance import with_nearest
from glint.tasks.algorithms.geometry.vectors import angles, pixel_positions, positions_at, sampled_pixels, to_camera
from glint.tasks.algorithms.revolution.inscribed_circles import inscribed_circles
from glint.tasks.algorithms.revolution.opening import Opening, agreement
from glint.tasks.algorithms.revolution.relief import ERROR_CAP_DEG
from glint.tasks.algorithms.revolution.surface_fit import SilhouetteSymmetry
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from glint.tasks.algorithms.revolution.symmetry import SYMMETRIC_LIMITS, RotationalNormals
from glint.tasks.algorithms.revolution.view_rays import AxisFrame
from glint.tasks.algorithms.silhouettes.reflection_axes import ReflectionAxis

BOWL_TILTS_DEG, FINE_TILTS_DEG = np.arange(8.0, 76.0, 3.0), (-2.0, -1.0, 1.0, 2.0)
"""Tilts of the axis that are tried, and changes of the best one that are tried then."""
FIRST_SLOPES = 0.7, 1.8, 4.0
"""Changes of the radius with the height from which the profile is sought: a steep wall, and shallower ones."""
DEPTH_STEP_PX, MAX_DEPTH_RADII = 0.5, 1.5
"""Step of the profile along the axis, and the depth to which it is sought, in radii of the rim."""
MAX_RADIUS_SLOPE = 40.0
"""Change of the radius with the height beyond which the inside is flat."""
SLOPE_SIGMA_SAMPLES, MIN_SAMPLE_WEIGHT = 2.0, 0.05
"""Smoothing of the slopes along the axis, and the weight of a height from which its normals tell the slope."""
BOWL_ROUNDS, FIRST_REACH_DEG, REACH_RATIO, LAST_REACH_DEG = 8, 60.0, 0.8, 12.0
"""Rounds, and the angle from the present inside up to which a normal is taken as its own: in the first round, from one
to the next, and at last."""
MIN_BOWL_NORMALS, BOWL_SAMPLES, MIN_ROUND_NORMALS = 50, 600, 20
"""Pixels that show a normal without which no bowl is sought, how many are compared, and how many a round needs."""
MIN_RIM_DISC_SHARE, MAX_MISSED_SHARE = 0.6, 0.15
"""Area of the rim's disc relative to the object's, at least, and share of the object that may lie beside the bowl."""
MIN_INWARD = 0.02
"""Component of a normal towards the axis from which it belongs to a wall."""


@dataclass(frozen=True, slots=True)
class Bowl:
    """A bowl that normals show.

    opening: the rim, and the inside below it. error_deg: mean angle from the normals shown to those of the bowl, each
    capped. excess: share of the pixels with a normal that agree with the bowl, less that of those that should and do
    not.
    """

    opening: Opening
    error_deg: float
    excess: float

    def normals(self, mask: np.ndarray) -> RotationalNormals:
        """Return the normals and depths of the bowl in a mask (H, W) bool, which it may not fill."""
        image, depths = np.full((*mask.shape, 3), np.nan, np.float32), np.full(mask.shape, np.nan, np.float32)
        image[mask], depths[mask], _ = self.opening.entries(*pixel_positions(mask))
        return RotationalNormals(with_nearest(image, mask), depths, 0.0, self.error_deg)


def accepted_bowl(silhouette: SilhouetteSymmetry, accepted: np.ndarray, field: np.ndarray) -> RotationalNormals | None:
    """Return the normals of the bowl whose inside accepted normals show, None if they show none.

    silhouette: of (H, W) pixels. accepted: (H, W, 3), NaN where there is none. field: (H, W, 3), the silhouette's
    smooth normal field, which the bowl must fit much better than.
    """
    bowl = find_bowl(silhouette, accepted[None])
    if bowl is None or bowl.error_deg > SYMMETRIC_LIMITS.largest_error(accepted, field):
        return None
    return bowl.normals(silhouette.mask)


def find_bowl(silhouette: SilhouetteSymmetry, shown: np.ndarray) -> Bowl | None:
    """Return the bowl to which the normals shown, (K, H, W, 3) with NaN where there are none, are nearest.

    None: too few pixels show a normal, or the contour is not that of a bowl's rim.
    """
    mask = silhouette.mask
    rows, columns = sampled_pixels(mask & np.isfinite(shown[..., 0]).any(axis=0), BOWL_SAMPLES)
    if len(rows) < MIN_BOWL_NORMALS:
        return None
    sample = _Sample(*positions_at(rows, columns, mask.shape), shown[:, rows, columns])
    bowls = [bowl for start in _starts(silhouette) if (bowl := _fitted(sample, silhouette, *start)) is not None]
    if not bowls:
        return None
    best = min(bowls, key=lambda bowl: bowl.error_deg)
    surface = best.opening.surface
    for turn in FINE_TILTS_DEG:
        bowl = _fitted(sample, silhouette, surface.axis, surface.tilt + np.radians(turn), FIRST_SLOPES[1])
        if bowl is not None and bowl.error_deg < best.error_deg:
            best = bowl
    x, y = pixel_positions(mask)
    missed = np.isnan(best.opening.entries(x, y)[0][:, 0]).mean()
    return best if missed <= MAX_MISSED_SHARE else None


@dataclass(frozen=True, slots=True)
class _Sample:
    """Normals shown (K, N, 3), NaN where there are none, at positions x and y (N,) in pixels."""

    x: np.ndarray
    y: np.ndarray
    normals: np.ndarray

    def nearest(self, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the normals shown (N, 3) that are nearest to given ones (N, 3), and the angles (N,) in degrees."""
        gaps = np.nan_to_num(angles(self.normals, normals[None]), nan=180.0)
        layer, place = gaps.argmin(axis=0), np.arange(gaps.shape[1])
        return self.normals[layer, place], gaps[layer, place]


def _starts(silhouette: SilhouetteSymmetry) -> Iterator[tuple[ReflectionAxis, float, float]]:
    """Yield axes, tilts in radians and slopes with which a bowl is sought."""
    for axis in silhouette.axes:
        for tilt in np.radians(BOWL_TILTS_DEG):
            for slope in FIRST_SLOPES:
                yield axis, float(tilt), slope


def _fitted(
    sample: _Sample, silhouette: SilhouetteSymmetry, axis: ReflectionAxis, tilt: float, first_slope: float
) -> Bowl | None:
    """Return the bowl with that axis and tilt whose inside normals show; None if too few belong to it."""
    mask = silhouette.mask
    contour = smooth_contour(mask)
    rays = AxisFrame.of(axis, tilt, silhouette.inverse_focal).rays(
        *to_camera(contour[:, 0], contour[:, 1], mask.shape[1], mask.shape[0])
    )
    # Of all circles inside the contour the rim is the largest.
    heights, radii = inscribed_circles(rays, DEPTH_STEP_PX)
    largest = int(np.argmax(radii))
    rim, radius = float(heights[largest]), float(radii[largest])
    if np.pi * radius**2 * np.sin(tilt) < MIN_RIM_DISC_SHARE * mask.sum():
        return None
    slopes = np.full(int(MAX_DEPTH_RADII * radius / DEPTH_STEP_PX) + 1, first_slope)
    for number in range(BOWL_ROUNDS):
        surface = _inside(axis, tilt, rim, radius, slopes, silhouette.inverse_focal)
        reach = max(FIRST_REACH_DEG * REACH_RATIO**number, LAST_REACH_DEG)
        measured = _measured_slopes(surface, rim, len(slopes), sample, reach)
        if measured is None:
            return None
        slopes = np.sqrt(slopes * measured)
    opening = Opening(_inside(axis, tilt, rim, radius, slopes, silhouette.inverse_focal), 0.0, mask)
    normals = opening.entries(sample.x, sample.y)[0]
    _, gaps = sample.nearest(normals)
    error = float(np.minimum(gaps, ERROR_CAP_DEG).mean())
    return Bowl(opening, error, float(agreement(normals, sample.normals).mean()))


def _inside(
    axis: ReflectionAxis, tilt: float, rim: float, radius: float, slopes: np.ndarray, inverse_focal: float
) -> SurfaceOfRevolution:
    """Return the body that fills a bowl up to its rim, at a height and of a radius, pixels.

    slopes: (N,) of the radius with the height, from the rim downwards.
    """
    radii = radius - DEPTH_STEP_PX * np.concatenate([[0.0], np.cumsum(slopes)])
    radii = np.append(radii[radii > 0.0], 0.0)
    heights = rim - DEPTH_STEP_PX * np.arange(-1, len(radii))
    squared = np.append(0.0, radii**2)
    half_slopes = np.gradient(squared[::-1], heights[::-1]) / 2.0
    return SurfaceOfRevolution(axis, tilt, heights[::-1], squared[::-1], half_slopes, inverse_focal=inverse_focal)


def _measured_slopes(
    surface: SurfaceOfRevolution, rim: float, count: int, sample: _Sample, reach_deg: float
) -> np.ndarray | None:
    """Return the slopes (count,) of the radius with the height, from the rim downwards, that normals show.

    reach_deg: angle from the surface up to which a normal is its own. None: too few are.
    """
    hits = surface.intersect(sample.x, sample.y, far=True)
    normals, gaps = sample.nearest(-surface.normals_at(hits))
    radii = np.maximum(np.linalg.norm(hits.outward, axis=1), 1e-6)
    axial = (normals * hits.upward).sum(axis=1)
    inward = -(normals * hits.outward).sum(axis=1) / radii
    used = np.isfinite(hits.heights) & (gaps < reach_deg) & (inward > MIN_INWARD) & (axial > 0.0)
    if used.sum() < MIN_ROUND_NORMALS:
        return None
    place = np.rint((rim - hits.heights[used]) / DEPTH_STEP_PX).astype(int).clip(0, count - 1)
    weight, total = (
        ndimage.gaussian_filter1d(
            np.bincount(place, values, minlength=count).astype(float), SLOPE_SIGMA_SAMPLES, mode="constant"
        )
        for values in (np.ones(len(place)), np.arctan2(axial, inward)[used])
    )
    known = np.flatnonzero(weight > MIN_SAMPLE_WEIGHT)
    slope_angles = np.interp(np.arange(count), known, total[known] / weight[known])
    return np.clip(np.tan(slope_angles), 1.0 / MAX_RADIUS_SLOPE, MAX_RADIUS_SLOPE)
