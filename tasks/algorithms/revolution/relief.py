"""Relief that repeats round a surface of revolution: hobnails, ribs, cuts.

Seen from the axis, a relief of n periods shows the same normals in each of them. Those of one period, which face the
light differently from the next, fill what the others lack: flanks too steep for a highlight on one side of the vessel
are seen on the other. Normals that repeat prove the relief, since false highlights do not.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.revolution.periodic_normals import MIN_SUPPORT, held_out_errors, sampled, sums_over_periods
from glint.tasks.algorithms.revolution.surface_of_revolution import MAX_WALL_SLOPE_DEG, SurfaceOfRevolution

PERIODS = range(8, 61)
"""Numbers of periods that are tried; fewer are the faces of a prism rather than a relief."""
MAX_ERROR_RATIO = 0.5
"""Ratio of squared errors up to which a circle has the relief: of normals predicted by other periods to those predicted
by their circle alone."""
MIN_RELIEF_SHARE = 0.12
"""Share of the normals that must lie on such circles; on objects without relief it is 0.01 at most."""
MIN_RELIEF_FIT = 0.7
"""Share of the capped squared error that relief and surface together must explain; vessels with relief have 0.83 to
0.94, a few normals of one flat face 0.05."""
MAX_GIRTH = 2000.0
"""Cells along the longest circle at most. A cell is a pixel on objects of up to 640 pixels; finer ones hold too few
normals to be compared, and cost more."""
CIRCLE_SIGMA = 4.0
"""Standard deviation along the axis, in cells, over which circles are compared."""
ERROR_CAP_DEG = 20.0
"""Cap of an angle, so that false normals do not decide."""
RELIEF_NORMALS, FIRST_STRIDE = 4000, 2
"""Normals in which a relief is looked for, and subsampling of these for what is tried first."""
FIRST_TURNS_DEG, THICKNESSES = (-4.0, 0.0, 4.0), (0.0, 0.04)
"""Corrections of the tilt, and depths of the relief as shares of the largest radius, that are tried first."""
FINAL_TURN_DEG = 0.2
"""Step of the tilt at which the refinement of both ends."""


def capped_angles(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the angles in degrees between normals (..., 3), at most ERROR_CAP_DEG, which NaN counts as."""
    return np.asarray(np.minimum(np.nan_to_num(angles(first, second), nan=ERROR_CAP_DEG), ERROR_CAP_DEG))


@dataclass(frozen=True, slots=True)
class Relief:
    """Relief on a surface of revolution.

    surface: the one that touches the silhouette. thickness: in pixels, between it and the circles on which the relief
    repeats. periods: round the axis. fit: share of the capped squared error that it and, on other circles, the surface
    explain. share: see MIN_RELIEF_SHARE.
    """

    surface: SurfaceOfRevolution
    thickness: float
    periods: int
    fit: float
    share: float

    def normals(self, x: np.ndarray, y: np.ndarray, measured: np.ndarray, base: np.ndarray) -> np.ndarray:
        """Return the unit normals (N, 3) with relief.

        Args:
            x: (N,), camera frame.
            y: (N,).
            measured: (N, 3), normals there, NaN where there are none.
            base: (N, 3), those of the surface without relief, which remain where the relief shows nothing.
        """
        places = _Places.on(self.surface.shrunk(self.thickness), x, y)
        known = np.isfinite(measured[:, 0]) & places.hit
        local = places.at(known).in_frames(measured[known])
        circles = self._circles(places.at(known), local, capped_angles(base[known], measured[known]) ** 2)
        relief, support = places.means(known, local, self.periods)
        weight = np.where(places.hit, circles[places.row] * support / (support + MIN_SUPPORT), 0.0)[:, None]
        result = np.where(weight > 0.0, weight * relief, 0.0) + (1.0 - weight) * base
        # What would be turned away is hidden by a nearer part of the relief, whose contour is beside it.
        result[:, 2] = np.maximum(result[:, 2], 0.0)
        return np.asarray(unit(result))

    def _circles(self, places: "_Places", normals: np.ndarray, surface_error: np.ndarray) -> np.ndarray:
        """Return the weight (rows,) of each circle: 1 where other periods predict normals (N, 3) far better."""
        predicted, _ = places.held_out_errors(normals, self.periods)
        with_relief, without = places.sums_over_circles(predicted, surface_error)
        return np.asarray(ndimage.gaussian_filter1d((with_relief < MAX_ERROR_RATIO * without).astype(float), 1.0))


def find_relief(
    mask: np.ndarray, surface: SurfaceOfRevolution, x: np.ndarray, y: np.ndarray, normals: np.ndarray
) -> Relief | None:
    """Find the relief of a surface, and the tilt under which it repeats; None if there is none.

    Args:
        mask: (H, W) bool, the silhouette.
        surface: the largest one in it.
        x: (N,), camera frame.
        y: (N,).
        normals: (N, 3), measured there.
    """
    chosen = np.random.default_rng(0).permutation(len(x))[:RELIEF_NORMALS]
    x, y, normals = x[chosen], y[chosen], normals[chosen]
    radius = float(np.sqrt(surface.squared_radii.max()))

    def fitted(tilt: float, thickness: float, periods: Iterable[int], stride: int = 1) -> Relief:
        """Return the best of some numbers of periods, by every n-th normal."""
        tilted = surface.tilted(mask, tilt, step=1.0)
        places = _Places.on(tilted.shrunk(thickness), x[::stride], y[::stride])
        if not places.hit.any():
            return Relief(tilted, thickness, PERIODS[0], 0.0, 0.0)
        hit, used = places.at(places.hit), normals[::stride][places.hit]
        base = tilted.normals(x[::stride][places.hit], y[::stride][places.hit])
        local, error = hit.in_frames(used), capped_angles(base, used) ** 2
        fit, share, count = max((*hit.fit(local, error, count), count) for count in periods)
        return Relief(tilted, thickness, count, fit * float(places.hit.mean()), share)

    starts = [
        fitted(surface.tilt + np.radians(turn), share * radius, PERIODS, FIRST_STRIDE)
        for turn in FIRST_TURNS_DEG
        for share in THICKNESSES
    ]
    best = max(starts, key=lambda relief: relief.fit)
    if best.share < MIN_RELIEF_SHARE / 2.0:
        return None
    # Coordinate search, with steps that are halved where no neighbour is better.
    turn, step = np.radians(FIRST_TURNS_DEG[-1] / 2.0), THICKNESSES[1] / 2.0 * radius
    while turn > np.radians(FINAL_TURN_DEG):
        # A relief that lies deeper has fewer periods in the same width.
        nearby = range(max(best.periods - 1, PERIODS[0]), min(best.periods + 1, PERIODS[-1]) + 1)
        neighbours = [
            fitted(best.surface.tilt + i * turn, max(0.0, best.thickness + j * step), nearby)
            for i, j in ((-1, 0), (1, 0), (0, -1), (0, 1))
        ]
        better = max(neighbours, key=lambda relief: relief.fit)
        if better.fit > best.fit:
            best = better
        else:
            turn, step = turn / 2.0, step / 2.0
    if best.share < MIN_RELIEF_SHARE or best.fit < MIN_RELIEF_FIT:
        return None
    return replace(best, surface=surface.tilted(mask, best.surface.tilt))


@dataclass(frozen=True, slots=True)
class _Places:
    """Places of N points on a surface of revolution.

    row: (N,) int, of the circle, heights in cells. azimuth: (N,), radians, 0 towards the camera. frames: (N, 3, 3),
    unit vectors outward, along the circle and along the axis. hit: (N,) bool, whether the ray meets its wall. rows,
    girth: number of circles, and the length of the largest in cells, see MAX_GIRTH.
    """

    row: np.ndarray
    azimuth: np.ndarray
    frames: np.ndarray
    hit: np.ndarray
    rows: int
    girth: float

    @classmethod
    def on(cls, surface: SurfaceOfRevolution, x: np.ndarray, y: np.ndarray) -> "_Places":
        """Place the points where the rays of x, y (N,) enter a surface."""
        hits = surface.intersect(x, y)
        outward, upward = np.asarray(unit(hits.outward)), hits.upward
        azimuth = np.arctan2(hits.across, hits.forward)
        # All points of a flat end lie on one circle.
        is_wall = np.abs((surface.normals_at(hits) * upward).sum(axis=1)) < np.sin(np.radians(MAX_WALL_SLOPE_DEG))
        hit = np.isfinite(azimuth) & is_wall
        girth = 2.0 * np.pi * float(np.sqrt(surface.squared_radii.max()))
        cell = max(1.0, girth / MAX_GIRTH)
        row = np.rint(np.where(hit, hits.heights - surface.heights[0], 0.0) / cell).astype(int)
        frames = np.stack([outward, np.cross(upward, outward), upward], axis=1)
        rows = int(np.ptp(surface.heights) / cell) + 2
        return cls(row, np.where(hit, azimuth, 0.0), frames, hit, rows, girth / cell)

    def at(self, chosen: np.ndarray) -> "_Places":
        """Return the chosen (N,) bool of the points."""
        return replace(
            self, row=self.row[chosen], azimuth=self.azimuth[chosen], frames=self.frames[chosen], hit=self.hit[chosen]
        )

    def in_frames(self, normals: np.ndarray) -> np.ndarray:
        """Return normals (N, 3) in the frames of their points."""
        return np.asarray(np.einsum("nij,nj->ni", self.frames, normals))

    def means(self, chosen: np.ndarray, normals: np.ndarray, periods: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the mean over all periods at each point: unit normals (N, 3), camera frame, and their support (N,).

        normals: (M, 3), in their frames, of the chosen (N,) bool of the points.
        """
        turns = self._turns(periods)
        sums = sums_over_periods(self.row[chosen], turns[chosen], normals, self.rows, self._columns(periods))
        relief, support = sampled(sums, self.row, turns)
        return np.einsum("nij,ni->nj", self.frames, relief), support

    def held_out_errors(self, normals: np.ndarray, periods: int) -> tuple[np.ndarray, np.ndarray]:
        """Predict normals (N, 3), in their frames, of every other period by those between: by relief, by circles alone.

        Returns the squared errors (N,) of both in square degrees, NaN where too few others are near.
        """
        columns = self._columns(periods)
        return held_out_errors(self.row, self._turns(periods), normals, self.rows, columns, ERROR_CAP_DEG)

    def sums_over_circles(self, *errors: np.ndarray) -> list[np.ndarray]:
        """Return the sums (rows,) of errors (N,) where the first is finite, smoothed along the axis."""
        used = np.isfinite(errors[0])
        sums = [np.bincount(self.row[used], error[used], minlength=self.rows) for error in errors]
        return [ndimage.gaussian_filter1d(values, CIRCLE_SIGMA) for values in sums]

    def fit(self, normals: np.ndarray, surface_error: np.ndarray, periods: int) -> tuple[float, float]:
        """Return how well a relief explains normals (N, 3), 1 at best, and the share of them on circles that have it.

        normals: in their frames. surface_error: (N,), squared, of the surface, which explains the other circles.
        """
        by_relief, by_circles = self.held_out_errors(normals, periods)
        left, whole = self.sums_over_circles(by_relief, by_circles)
        has_relief = (left < MAX_ERROR_RATIO * whole)[self.row] & np.isfinite(by_relief)
        error = np.where(has_relief, by_relief, surface_error)
        return 1.0 - float(error.mean()) / ERROR_CAP_DEG**2, float(has_relief.mean())

    def _columns(self, periods: int) -> int:
        """Return the number of places within a period."""
        return max(4, round(self.girth / periods))

    def _turns(self, periods: int) -> np.ndarray:
        return self.azimuth * (periods / (2.0 * np.pi))
