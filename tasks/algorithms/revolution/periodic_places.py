"""Places on a surface of revolution, and what pixels observe at them: candidate normals that repeat round its axis."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.revolution.periodic_normals import repeated_candidates, sampled, sums_over_periods
from glint.tasks.algorithms.revolution.surface_of_revolution import MAX_WALL_SLOPE_DEG, SurfaceOfRevolution

MIN_SHOWN_SHARE, MIN_SHOWN_SHARE_OF_RELIEF = 0.4, 0.2
"""Share of other periods' pixels that must show a candidate: where a relief is looked for, and of one that is known."""
MIN_EXCESS, MIN_EXCESS_RATIO = 0.035, 0.25
"""Share of pixels whose candidates repeat in excess of those that do so by chance, in all and relative to these, from
which a relief is there."""
MIN_CIRCLE_RATIO = 0.3
"""Ratio of the share of a circle's pixels whose candidates repeat to that of all circles from which it has a relief."""
CHANCE_SHIFT = 1.0 / 3.0
"""Part of a period after which candidates repeat by chance."""
MAX_AZIMUTH_DEG, MAX_RADIAL_DEG = 75.0, 72.5
"""Largest angle about the axis from the camera's side at which places are compared, and of a candidate from the radius;
nearer to the contour of the vessel a place is uncertain."""
MAX_GIRTH = 2000.0
"""Cells along the longest circle at most. A cell is a pixel on objects of up to 640 pixels."""
ASKED_PIXELS, FIRST_ASKED_PIXELS = 3_000, 1_000
"""Pixels whose candidates are compared with those of all others, and fewer to find the number of periods."""
MIN_PERIOD = 6.0
"""Cells on the longest circle that a period has at least."""
CIRCLE_SIGMA = 4.0
"""Standard deviation along the axis, in cells, over which circles are compared."""


def exceeds_chance[T: (float, np.ndarray)](repeated: T, by_chance: T, pixels: T) -> bool | np.ndarray:
    """Return whether more pixels repeat than by chance, by as many as a relief takes.

    repeated, by_chance, pixels: numbers of these and of all pixels, (...), or shares of 1.0.
    """
    return repeated - by_chance > np.maximum(MIN_EXCESS * pixels, MIN_EXCESS_RATIO * by_chance)


@dataclass(frozen=True, slots=True)
class Places:
    """Places of N pixels on a surface of revolution.

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
    def on(cls, surface: SurfaceOfRevolution, x: np.ndarray, y: np.ndarray, cell: float = 1.0) -> "Places":
        """Place the points where the rays of x, y (N,) enter a surface, in cells of some pixels at least."""
        hits = surface.intersect(x, y)
        outward, upward = np.asarray(unit(hits.outward)), hits.upward
        azimuth = np.arctan2(hits.across, hits.forward)
        # All points of a flat end lie on one circle.
        is_wall = np.abs((surface.normals_at(hits) * upward).sum(axis=1)) < np.sin(np.radians(MAX_WALL_SLOPE_DEG))
        hit = np.isfinite(azimuth) & is_wall
        girth = 2.0 * np.pi * float(np.sqrt(surface.squared_radii.max()))
        cell = max(cell, girth / MAX_GIRTH)
        row = np.rint(np.where(hit, hits.heights - surface.heights[0], 0.0) / cell).astype(int)
        frames = np.stack([outward, np.cross(upward, outward), upward], axis=1)
        rows = int(np.ptp(surface.heights) / cell) + 2
        return cls(row, np.where(hit, azimuth, 0.0), frames, hit, rows, girth / cell)

    def at(self, chosen: np.ndarray) -> "Places":
        """Return the chosen of the pixels: (N,) bool or (M,) int."""
        return replace(
            self, row=self.row[chosen], azimuth=self.azimuth[chosen], frames=self.frames[chosen], hit=self.hit[chosen]
        )

    def means(self, shown: "Places", normals: np.ndarray, periods: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the mean over all periods at each pixel: unit normals (N, 3), camera frame, and their support (N,).

        normals: (M, 3), in the frames of the places that they are shown at.
        """
        columns = self.columns(periods)
        sums = sums_over_periods(shown.row, shown.turns(periods), normals, self.rows, columns)
        relief, support = sampled(sums, self.row, self.turns(periods))
        return np.einsum("nij,ni->nj", self.frames, relief), support

    def columns(self, periods: int) -> int:
        """Return the number of places within a period."""
        return max(4, round(self.girth / periods))

    def turns(self, periods: int) -> np.ndarray:
        """Return the azimuths (N,) in periods."""
        return self.azimuth * (periods / (2.0 * np.pi))


class Excess(NamedTuple):
    """Shares of the pixels whose candidates repeat and do so by chance, and mean agreement in excess of chance."""

    repeated: float
    by_chance: float
    agreement: float


@dataclass(frozen=True, slots=True)
class ObservedPlaces:
    """Places of N pixels at which candidates are compared.

    candidates: (K, N, 3), in the frames of their places; NaN where there is none.
    """

    places: Places
    candidates: np.ndarray

    @classmethod
    def at(cls, places: Places, candidates: np.ndarray) -> "ObservedPlaces":
        """Return those of the pixels that show candidates (K, N, 3) which could be normals of their places."""
        local = np.einsum("nij,knj->kni", places.frames, candidates)
        is_possible = local[..., 0] > np.cos(np.radians(MAX_RADIAL_DEG))
        chosen = places.hit & (np.abs(places.azimuth) < np.radians(MAX_AZIMUTH_DEG)) & is_possible.any(axis=0)
        local = np.where(is_possible[..., None], local, np.nan)[:, chosen]
        return cls(places.at(chosen), np.ascontiguousarray(local))

    def likely_periods(self, counts: range) -> tuple[int, float]:
        """Return which of some numbers of periods agrees best, and its agreement in excess of chance."""
        possible = [count for count in counts if self.places.girth >= MIN_PERIOD * count]
        excesses = ((self.excess(count, FIRST_ASKED_PIXELS).agreement, count) for count in possible)
        agreement, periods = max(excesses, default=(0.0, counts[0]))
        return periods, agreement

    def excess(self, periods: int, pixels: int = ASKED_PIXELS) -> Excess:
        """Return how much more candidates of some pixels repeat after periods than by chance, after parts of them."""
        asked = np.random.default_rng(0).permutation(len(self.places.row))[:pixels]
        if len(asked) == 0:
            return Excess(0.0, 0.0, 0.0)
        repeated, agreement = self._repeated(periods, asked=asked)
        by_chance, chance_agreement = self._repeated(periods, CHANCE_SHIFT, asked)
        shares = float((repeated >= 0).mean()), float((by_chance >= 0).mean())
        return Excess(*shares, float((agreement - chance_agreement).mean()))

    def repeated_normals(self, periods: int) -> tuple[Places, np.ndarray]:
        """Return the places (M) of the pixels whose candidates repeat, and these (M, 3), in their frames."""
        repeated, _ = self._repeated(periods, least_share=MIN_SHOWN_SHARE_OF_RELIEF)
        pixels = np.flatnonzero(repeated >= 0)
        return self.places.at(pixels), self.candidates[repeated[pixels], pixels]

    def amplitude(self, periods: int) -> float:
        """Return the RMS angle in degrees of repeated candidates from their mean on each circle."""
        places, normals = self.repeated_normals(periods)
        sums = [np.bincount(places.row, part, minlength=places.rows) for part in normals.T]
        lengths = np.linalg.norm(sums, axis=0).sum()
        return float(np.degrees(np.sqrt(2.0 - 2.0 * lengths / max(len(normals), 1))))

    def circles_with_relief(self, periods: int) -> np.ndarray:
        """Return the weight (rows,) of each circle: 1 where candidates repeat far more often than by chance."""
        row, rows = self.places.row, self.places.rows
        pixels, repeated, by_chance = (
            ndimage.gaussian_filter1d(np.bincount(row[chosen], minlength=rows).astype(float), CIRCLE_SIGMA)
            for chosen in (slice(None), self._repeated(periods)[0] >= 0, self._repeated(periods, CHANCE_SHIFT)[0] >= 0)
        )
        has_relief = exceeds_chance(repeated, by_chance, pixels)
        has_relief &= repeated > MIN_CIRCLE_RATIO * pixels * repeated.sum() / max(pixels.sum(), 1.0)
        return np.asarray(ndimage.gaussian_filter1d(has_relief.astype(float), 1.0))

    def _repeated(
        self, periods: int, shift: float = 0.0, asked: np.ndarray | None = None, least_share: float = MIN_SHOWN_SHARE
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return which candidate of each asked pixel repeats, and its agreement (M,); shift: part of a period."""
        places, columns = self.places, self.places.columns(periods)
        grid = places.rows, columns, round(shift * columns)
        asked = np.arange(len(places.row)) if asked is None else asked
        return repeated_candidates(places.row, places.turns(periods), self.candidates, *grid, least_share, asked)
