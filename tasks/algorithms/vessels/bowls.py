"""Bowls: surfaces of revolution into which the camera looks, so that nearly all that it sees is their inside.

The far half of a bowl's contour is that of its rim. It tells where the rim is and how the axis is tilted, but nothing
of what lies below. That follows from the normals of the inside. Each gives the slope of a whole circle, and the profile
is the integral of the slopes from the rim downwards; which circle a pixel shows depends on the profile in turn, so that
both are found in rounds. Below the last circle that shows a highlight the bottom is taken to be flat.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from glint.tasks.algorithms.geometry.blur import blurred_sums
from glint.tasks.algorithms.geometry.contours import smooth_contour
from glint.tasks.algorithms.geometry.distance import with_nearest
from glint.tasks.algorithms.geometry.vectors import angles, pixel_positions, to_camera
from glint.tasks.algorithms.revolution.inscribed_sections import inscribed_sections, lines_across_planes
from glint.tasks.algorithms.revolution.opening import Opening, agreement
from glint.tasks.algorithms.revolution.relief import ERROR_CAP_DEG
from glint.tasks.algorithms.revolution.surface_fit import SilhouetteSymmetry
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from glint.tasks.algorithms.revolution.symmetry import SYMMETRIC_LIMITS, RotationalNormals, picture, sampled_candidates
from glint.tasks.algorithms.revolution.view_rays import AxisFrame
from glint.tasks.algorithms.silhouettes.reflection_axes import ReflectionAxis

BOWL_TILTS_DEG, FINE_TILTS_DEG = np.arange(8.0, 76.0, 3.0), np.arange(-2.5, 2.6, 0.5)
"""Tilts of the axis that are tried, and changes of the best one that are tried then."""
FIRST_SLOPES = 0.7, 1.8, 4.0
"""Changes of the radius with the height from which the profile is sought: a steep wall, and shallower ones."""
DEPTH_STEP_PX, MAX_DEPTH_RADII = 0.5, 1.5
"""Step of the profile along the axis, and the depth to which it is sought, in radii of the rim."""
MAX_RADIUS_SLOPE = 40.0
"""Change of the radius with the height beyond which the inside is flat."""
SLOPE_SIGMA_SAMPLES, MIN_SAMPLE_WEIGHT = 2.0, 0.05
"""Standard deviation of the smoothing of slopes along the axis, in samples, and the weight of a height from which its
normals tell the slope."""
BOWL_ROUNDS, FIRST_REACH_DEG, REACH_RATIO, LAST_REACH_DEG = 8, 60.0, 0.8, 12.0
"""Rounds, and the angle from the present inside up to which a normal is taken as its own: in the first round, from one
to the next, and at last."""
MIN_BOWL_NORMALS, BOWL_SAMPLES, MIN_ROUND_NORMALS = 50, 600, 20
"""Pixels that show a normal without which no bowl is sought, how many are compared, and how many a round needs."""
MIN_RIM_DISC_SHARE, MAX_MISSED_SHARE = 0.6, 0.15
"""Area of the rim's disc relative to the object's, at least, and share of the object that may lie beside the bowl."""
MAX_RIM_GAP_PX, MAX_RIM_GAP_RADII = 1.5, 0.03
"""Distance of the contour from the far half of the rim, in the rim's plane, up to which it is the rim's: in pixels, and
in radii, whichever is more."""
MIN_INWARD = 0.02
"""Component of a normal towards the axis from which it belongs to a wall."""


@dataclass(frozen=True, slots=True)
class Rim:
    """A bowl's rim: axis and tilt (radians) of the bowl, height and radius of the rim in pixels, and its object.

    gap: how far the contour lies outside the far half of the rim, in its plane, root mean square in pixels. mask: (H,
    W) bool. inverse_focal: see `AxisFrame`.
    """

    axis: ReflectionAxis
    tilt: float
    height: float
    radius: float
    gap: float
    mask: np.ndarray
    inverse_focal: float

    def inside(self, slopes: np.ndarray) -> SurfaceOfRevolution:
        """Return the body that fills the bowl; slopes: (N,) of the radius with the height, from the rim downwards."""
        radii = self.radius - DEPTH_STEP_PX * np.concatenate([[0.0], np.cumsum(slopes)])
        radii = np.append(radii[radii > 0.0], 0.0)
        heights = self.height - DEPTH_STEP_PX * np.arange(-1, len(radii))[::-1]
        squared = np.append(0.0, radii**2)[::-1]
        half_slopes = np.gradient(squared, heights) / 2.0
        return SurfaceOfRevolution(
            self.axis, self.tilt, heights, squared, half_slopes, inverse_focal=self.inverse_focal
        )


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

    def normals(self) -> RotationalNormals:
        """Return the normals and depths of the bowl in the mask of its object, which it may not fill."""
        mask = self.opening.around
        normals, depths, _ = self.opening.entries(*pixel_positions(mask))
        return RotationalNormals(with_nearest(picture(mask, normals), mask), picture(mask, depths), 0.0, self.error_deg)


def bowl_rims(silhouette: SilhouetteSymmetry) -> list[Rim]:
    """Return the rims of bowls whose far half the contour follows, one about each axis at most."""
    return [rim for axis in silhouette.axes if (rim := _rim_about(axis, silhouette)) is not None]


def accepted_bowl(rims: Sequence[Rim], accepted: np.ndarray, field: np.ndarray) -> RotationalNormals | None:
    """Return the normals of the bowl whose inside accepted normals show, None if they show none.

    rims: of `bowl_rims`. accepted: (H, W, 3), NaN where there is none. field: (H, W, 3), the initial normals,
    which the bowl must fit much better than.
    """
    bowl = find_bowl(rims, accepted[None])
    if bowl is None or bowl.error_deg > SYMMETRIC_LIMITS.largest_error(accepted, field):
        return None
    return bowl.normals()


def find_bowl(rims: Sequence[Rim], shown: np.ndarray) -> Bowl | None:
    """Return the bowl to which the normals shown, (K, H, W, 3) with NaN where there are none, are nearest.

    rims: of `bowl_rims`. None: there is no rim, or too few pixels show a normal of any bowl.
    """
    if not rims:
        return None
    mask = rims[0].mask
    sample = _Sample(*sampled_candidates(mask, shown, BOWL_SAMPLES))
    if len(sample.x) < MIN_BOWL_NORMALS:
        return None
    bowls = [_fitted(sample, rim, slope) for rim in rims for slope in FIRST_SLOPES]
    best = min((bowl for bowl in bowls if bowl is not None), key=attrgetter("error_deg"), default=None)
    if best is None:
        return None
    missed = np.isnan(best.opening.entries(*pixel_positions(mask))[0][:, 0]).mean()
    return best if missed <= MAX_MISSED_SHARE else None


def _rim_about(axis: ReflectionAxis, silhouette: SilhouetteSymmetry) -> Rim | None:
    """Return the rim about an axis whose far half the contour follows, None if it follows none.

    The near half may lie before the outside of the bowl.
    """
    mask = silhouette.mask
    contour = smooth_contour(mask)
    x, y = to_camera(contour[:, 0], contour[:, 1], mask.shape[1], mask.shape[0])

    def rim_at(tilt_deg: float) -> Rim:
        tilt = float(np.radians(tilt_deg))
        rays = AxisFrame.of(axis, tilt, silhouette.inverse_focal).rays(x, y)
        # Of all circles inside the contour the rim is the largest.
        heights, radii = inscribed_sections(rays, DEPTH_STEP_PX)
        largest = int(np.argmax(radii))
        height, radius = float(heights[largest]), float(radii[largest])
        _, starts, slopes = lines_across_planes(rays, DEPTH_STEP_PX)
        places = starts + height * slopes
        distances = np.linalg.norm(places[places[:, 1] < 0.0], axis=1)
        gap = float(np.sqrt(np.mean((distances - radius) ** 2))) if len(distances) else np.inf
        return Rim(axis, tilt, height, radius, gap, mask, silhouette.inverse_focal)

    best = min((rim_at(tilt) for tilt in BOWL_TILTS_DEG), key=attrgetter("gap"))
    best = min((rim_at(np.degrees(best.tilt) + turn) for turn in FINE_TILTS_DEG), key=attrgetter("gap"))
    is_small = np.pi * best.radius**2 * np.sin(best.tilt) < MIN_RIM_DISC_SHARE * mask.sum()
    return None if is_small or best.gap > max(MAX_RIM_GAP_PX, MAX_RIM_GAP_RADII * best.radius) else best


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


def _fitted(sample: _Sample, rim: Rim, first_slope: float) -> Bowl | None:
    """Return the bowl with that rim whose inside normals show; None if too few belong to it."""
    slopes = np.full(int(MAX_DEPTH_RADII * rim.radius / DEPTH_STEP_PX) + 1, first_slope)
    for number in range(BOWL_ROUNDS):
        reach = max(FIRST_REACH_DEG * REACH_RATIO**number, LAST_REACH_DEG)
        measured = _measured_slopes(rim.inside(slopes), rim.height, len(slopes), sample, reach)
        if measured is None:
            return None
        slopes = np.sqrt(slopes * measured)
    opening = Opening(rim.inside(slopes), 0.0, rim.mask)
    normals = opening.entries(sample.x, sample.y)[0]
    _, gaps = sample.nearest(normals)
    error = float(np.minimum(gaps, ERROR_CAP_DEG).mean())
    return Bowl(opening, error, float(agreement(normals, sample.normals).mean()))


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
    shown = np.arctan2(axial, inward)[used]
    weight, total = blurred_sums(place, np.ones(len(place)), shown, count, SLOPE_SIGMA_SAMPLES)
    known = np.flatnonzero(weight > MIN_SAMPLE_WEIGHT)
    slope_angles = np.interp(np.arange(count), known, total[known] / weight[known])
    slope_angles[known[-1] + 1 :] = np.arctan(MAX_RADIUS_SLOPE)
    return np.clip(np.tan(slope_angles), 1.0 / MAX_RADIUS_SLOPE, MAX_RADIUS_SLOPE)
