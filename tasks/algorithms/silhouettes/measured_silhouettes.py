"""Silhouettes of surfaces of revolution as their normals show them, for masks whose contour is wrong.

The normal of a circle of radius r about the axis, at the distance u from the axis in the image, has the component u/r
across the view, relative to its length in the circle's plane. So normals well inside the contour measure axis, tilt and
radii. Those of a sphere do not show an axis, but its centre and radius.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from glint.tasks.algorithms.geometry.connected_parts import largest_part
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.geometry.robust import robust_deviation
from glint.tasks.algorithms.geometry.vectors import sampled_pixels
from glint.tasks.algorithms.silhouettes.mirror_images import MirrorAxis, mirror_image
from glint.tasks.algorithms.silhouettes.reflection_axes import refined_place

AXIS_STEP_DEG, AXIS_TILT_STEP_DEG, LARGEST_TILT_DEG = 6.0, 15.0, 45.0
"""Steps of the exhaustive search for the axis in the image and its tilt, and the largest tilt that is tried."""
LAST_AXIS_STEP_DEG = 1.0
"""Step of the axis' angle at which refinement ends."""
SEEDS = 3
"""Best pairs of angle and tilt that are refined."""
LEAST_NORMALS, COARSE_NORMALS, FINE_NORMALS = 50, 400, 1500
"""Normals without which nothing is measured, and those compared in the exhaustive search and afterwards."""
COARSE_ROUNDS, FINE_ROUNDS = 5, 15
"""Rounds in which circles are fitted and normals weighed by their distance from them, likewise."""
MAX_UPWARD = 0.8
"""Component along the axis up to which a normal belongs to a wall, not to a flat end."""
MIN_WALL_SHARE = 0.5
"""Share of the normals that must belong to a wall."""
CIRCLE_SHARE = 0.15
"""Distance from one circle to the next, in inradii of the mask."""
MIN_DEVIATION_SHARE, MAX_DEVIATION_SHARE = 0.025, 0.15
"""Deviation of a normal's place up to which it counts in full, and beyond which it is as bad as any, in inradii."""
MIN_CIRCLE_WEIGHT = 2.0
"""Normals, as if all of them pointed across, without which the radius of a circle is unknown."""
MAX_SPHERE_RATIO, MAX_SPHERE_MISFIT, MIN_SPHERE_RADIUS = 2.0, 0.3, 0.5
"""Misfit of a sphere, relative to that of circles about the best axis, up to which it is one: 1.5 on hemispheres, since
it lies in two directions rather than one, and 3 and more on glasses, mugs and jugs; its misfit relative to the bound,
0.2 on hemispheres; and its radius in inradii."""
MIN_CIRCLES = 3
"""Circles without which there is no silhouette."""


@dataclass(frozen=True, slots=True)
class _Circles:
    """Circles about an axis that normals measure, in pixels.

    misfit: mean distance from where the normals' places would be on them, bounded. offset: of the axis. heights: (N,),
    along the axis, where they are widest in the image. radii: (N,). weights: (N,), in normals that point across.
    """

    misfit: float
    offset: float
    heights: np.ndarray
    radii: np.ndarray
    weights: np.ndarray


@dataclass(frozen=True, slots=True)
class _Sample:
    """Normals (N, 3), camera frame, at places (N, 2), column and row from the centroid of a mask, and its inradius."""

    places: np.ndarray
    normals: np.ndarray
    inradius: float

    def part(self, count: int) -> "_Sample":
        """Return the first ones."""
        return _Sample(self.places[:count], self.normals[:count], self.inradius)

    def circles(self, angle: float, tilt: float, rounds: int) -> _Circles | None:
        """Fit circles about an axis; None where too few normals belong to a wall.

        angle: of the axis' normal in the image, from the columns to the rows. tilt: of its upper end towards the
        camera. Both in radians.
        """
        (columns, rows), (x, y, z) = self.places.T, self.normals.T
        across, along = _turned(columns, rows, angle)
        # Rows run downwards, y upwards.
        n_across, n_along = _turned(x, -y, angle)
        upward, forward = n_along * np.cos(tilt) + z * np.sin(tilt), z * np.cos(tilt) - n_along * np.sin(tilt)
        is_wall = (np.abs(upward) < MAX_UPWARD) & (forward > 0.0)
        if is_wall.sum() < max(LEAST_NORMALS, MIN_WALL_SHARE * len(x)):
            return None
        in_plane = np.hypot(n_across, forward)[is_wall]
        circles = _fitted_circles(
            across[is_wall],
            along[is_wall],
            n_across[is_wall] / in_plane,
            forward[is_wall] / in_plane * np.sin(tilt),
            self.inradius,
            rounds,
        )
        # Otherwise a tilt under which false normals belong to no wall would fit best.
        share, bound = float(is_wall.mean()), MAX_DEVIATION_SHARE * self.inradius
        return replace(circles, misfit=share * circles.misfit + (1.0 - share) * bound)


def measured_silhouettes(mask: np.ndarray, normals: np.ndarray) -> list[np.ndarray]:
    """Return silhouettes (H, W) bool of the surface of revolution that normals (H, W, 3), else NaN, show best.

    Where they give its radius, it is as wide as that. Elsewhere it is where the mask (H, W) bool and its mirror image
    about the axis overlap, or, in a second silhouette, both together. Of a sphere it is the disc. There are none if the
    normals are too few.
    """
    rows, columns = sampled_pixels(mask & np.isfinite(normals[..., 0]), FINE_NORMALS)
    if len(rows) < LEAST_NORMALS:
        return []
    centre, inradius = np.argwhere(mask).mean(axis=0)[::-1], inradius_of(mask)
    sample = _Sample(np.column_stack([columns, rows]) - centre, normals[rows, columns].astype(float), inradius)
    angle, tilt = _best_axis(sample)
    circles = sample.circles(angle, tilt, FINE_ROUNDS)
    if circles is None or (circles.weights >= MIN_CIRCLE_WEIGHT).sum() < MIN_CIRCLES:
        return []
    misfit, middle, radius = _fitted_sphere(sample)
    # What fits neither has the bound as its misfit.
    limit = min(MAX_SPHERE_RATIO * circles.misfit, MAX_SPHERE_MISFIT * MAX_DEVIATION_SHARE * inradius)
    if misfit < limit and radius > MIN_SPHERE_RADIUS * inradius:
        x, y = centre + middle
        return [np.hypot(*(np.indices(mask.shape) - np.array([y, x])[:, None, None])) <= radius]
    image = mirror_image(mask, MirrorAxis(centre, angle, circles.offset))
    measured = [_with_circles(base, mask, circles, centre, angle) for base in (mask & image, mask | image)]
    return [silhouette for silhouette in measured if silhouette.any()]


def _best_axis(sample: _Sample) -> tuple[float, float]:
    """Return angle and tilt, radians, of the axis about which circles fit best."""

    def fit(normals: _Sample, rounds: int) -> Callable[[float, float], float]:
        @cache
        def score(angle: float, tilt: float) -> float:
            circles = normals.circles(angle, tilt, rounds)
            return -np.inf if circles is None else -circles.misfit

        return score

    coarse, fine = fit(sample.part(COARSE_NORMALS), COARSE_ROUNDS), fit(sample, FINE_ROUNDS)
    tilts = np.radians(np.arange(-LARGEST_TILT_DEG, LARGEST_TILT_DEG + 1.0, AXIS_TILT_STEP_DEG))
    places = [
        (float(angle), float(tilt)) for angle in np.radians(np.arange(0.0, 180.0, AXIS_STEP_DEG)) for tilt in tilts
    ]
    seeds = sorted(places, key=lambda place: -coarse(*place))[:SEEDS]
    steps = float(np.radians(AXIS_STEP_DEG / 2)), float(np.radians(AXIS_TILT_STEP_DEG / 2))
    refined = [refined_place(fine, seed, steps, float(np.radians(LAST_AXIS_STEP_DEG)))[0] for seed in seeds]
    return max(refined, key=lambda place: fine(*place))


def _fitted_sphere(sample: _Sample) -> tuple[float, np.ndarray, float]:
    """Fit a sphere to the places of normals by robust least squares (Cauchy weights).

    Returns the mean distance from where they would be on it, bounded, its centre (2,) in the frame of the places, and
    its radius.
    """
    # Rows run downwards, y upwards.
    outward, weights = sample.normals[:, :2] * (1.0, -1.0), np.ones(len(sample.normals))
    deviation, middle, radius = weights, np.zeros(2), 0.0
    for _ in range(FINE_ROUNDS):
        place, direction = (np.average(values, axis=0, weights=weights) for values in (sample.places, outward))
        spread_out = outward - direction
        total = float((weights[:, None] * spread_out**2).sum())
        radius = float((weights[:, None] * spread_out * (sample.places - place)).sum()) / max(total, 1e-9)
        middle = place - radius * direction
        deviation = np.linalg.norm(sample.places - middle - radius * outward, axis=1)
        spread = max(MIN_DEVIATION_SHARE * sample.inradius, robust_deviation(deviation))
        weights = 1.0 / (1.0 + (deviation / spread) ** 2)
    return float(np.minimum(deviation, MAX_DEVIATION_SHARE * sample.inradius).mean()), middle, radius


def _fitted_circles(
    across: np.ndarray, along: np.ndarray, sides: np.ndarray, rises: np.ndarray, inradius: float, rounds: int
) -> _Circles:
    """Fit circles, smooth along the axis, to the places of normals by robust least squares (Cauchy weights).

    across, along: (N,), places in the image. sides: (N,), sine of the normal's turn about the axis. rises: (N,), by how
    much a normal's place lies below where its circle is widest in the image, in radii. inradius: of the mask.
    """
    step = CIRCLE_SHARE * inradius
    offset, weights = float(np.median(across)), np.ones(len(across))
    reach = np.abs(across - offset).max() + 2.0 * step
    first, widest = along.min() - reach, along
    count = int((np.ptp(along) + 2.0 * reach) / step) + 2
    radii = totals = np.zeros(count)
    deviation = np.zeros(len(across))
    for _ in range(rounds):
        number = ((widest - first) / step).astype(int).clip(0, count - 1)
        sums = _smoothed(np.bincount(number, weights * sides * (across - offset), count))
        totals = _smoothed(np.bincount(number, weights * sides**2, count))
        radii = np.maximum(sums / np.maximum(totals, 1e-9), 0.0)
        offset += float(np.average(across - offset - radii[number] * sides, weights=weights))
        deviation = np.abs(across - offset - radii[number] * sides)
        spread = max(MIN_DEVIATION_SHARE * inradius, robust_deviation(deviation))
        weights = 1.0 / (1.0 + (deviation / spread) ** 2)
        widest = along + radii[number] * rises
    misfit = float(np.minimum(deviation, MAX_DEVIATION_SHARE * inradius).mean())
    return _Circles(misfit, offset, first + step * (np.arange(count) + 0.5), radii, totals)


def _smoothed(sums: np.ndarray) -> np.ndarray:
    return np.convolve(sums, [0.25, 0.5, 0.25], "same")


def _with_circles(
    base: np.ndarray, mask: np.ndarray, circles: _Circles, centre: np.ndarray, angle: float
) -> np.ndarray:
    """Return a silhouette (H, W) bool that is as wide as the circles whose radii are known, and `base` elsewhere.

    It ends where the mask does. For centre and angle see `MirrorAxis`.
    """
    rows, columns = np.indices(mask.shape).astype(float)
    across, along = _turned(columns - centre[0], rows - centre[1], angle)
    is_known = circles.weights >= MIN_CIRCLE_WEIGHT
    number = np.rint((along - circles.heights[0]) / (circles.heights[1] - circles.heights[0])).astype(int)
    known_there = is_known[number.clip(0, len(is_known) - 1)]
    radius = np.interp(along, circles.heights[is_known], circles.radii[is_known])
    is_between = (along >= along[mask].min()) & (along <= along[mask].max())
    return largest_part(np.where(known_there, (np.abs(across - circles.offset) <= radius) & is_between, base))


def _turned(columns: np.ndarray, rows: np.ndarray, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Return components (..) across and along an axis, the latter upward, of those along columns and rows (..)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return columns * cosine + rows * sine, columns * sine - rows * cosine
