"""Slopes of a profile by the candidates' normals.

The silhouette gives radii to a fraction of a pixel but slopes only to several degrees; a normal gives the slope to one
degree, for its whole circle. True candidates of all pixels of a circle show the same slope, and lie in planes through
the axis. What a false sheet shows changes around the circle. So the slope that most pixels show is the true one, even
where false candidates have been accepted.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.blur import blurred_sums
from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution

SIDE_DEG = 4.0
"""Angle of a normal from the plane through the axis at which its weight has fallen to a quarter."""
SLOPE_SIGMA_DEG, HEIGHT_SIGMA_PX = 2.5, 0.5
"""Standard deviations of the Gaussian that smooths shares: in slope, and along the axis."""
CHANCE_SHARE = 0.1
"""Share of a circle's pixels that shows any slope by chance; where no slope has more, the contour's stays."""
CORRECTION_NATS, MAX_FROM_CONTOUR_DEG = 0.03, 60.0
"""Cost of each degree between a slope and the contour's, and the angle beyond which it is not that of the wall."""
MIN_CIRCLE_PIXELS = 10.0
"""Least number of pixels, per pixel of the axis' length, that a circle's shares refer to: a few show small shares."""
OWN_DEG = 4.0
"""Largest difference from the slope that most pixels of its circle show at which a normal enters the mean slope."""
MEAN_SIGMA_PX, PRIOR_NORMALS = 0.7, 3.0
"""Standard deviation of the Gaussian that smooths mean slopes along the axis, and how many normals without a residual
are added to each mean."""
RIVAL_DEG = 6.0
"""Difference from which slopes are those of different sheets."""
COUNTED_SLOPES_DEG = np.arange(-90, 91)
"""Slopes whose shares are counted."""


@dataclass(frozen=True, eq=False)
class ShownSlopes:
    """Slopes (M,) that normals show, radians, with weights (M,), at samples (M,) of the profile.

    circles: (H,), number of pixels that show a normal at each of the H samples. step: their distance, in pixels.
    """

    slopes: np.ndarray
    weights: np.ndarray
    samples: np.ndarray
    circles: np.ndarray
    step: float

    @classmethod
    def on(cls, surface: SurfaceOfRevolution, x: np.ndarray, y: np.ndarray, candidates: np.ndarray) -> "ShownSlopes":
        """Return the slopes that normals show on a surface.

        Args:
            surface: with the contour's radii and slopes.
            x: (N,), camera frame.
            y: (N,).
            candidates: (K, N, 3), normals shown there, NaN where there are fewer.
        """
        hits, step = surface.intersect(x, y), float(surface.heights[1] - surface.heights[0])
        outward = unit(hits.outward)
        # Where a section bends, its apothem grows by less than a point moves outwards.
        growth = np.linalg.norm(hits.outward, axis=1) / hits.apothems
        sideways = np.cross(hits.upward, outward)
        axial, radial, side = ((candidates * axis).sum(axis=-1) for axis in (hits.upward, outward, sideways))
        is_shown = np.isfinite(radial)
        places = np.nan_to_num((hits.heights - surface.heights[0]) / step)
        samples = np.broadcast_to(np.rint(places).astype(int), is_shown.shape)[is_shown]
        pixels = np.rint(places[is_shown.any(axis=0)]).astype(int)
        from_plane = np.degrees(np.arcsin(side[is_shown].clip(-1.0, 1.0)))
        weights = 1.0 / (1.0 + (from_plane / SIDE_DEG) ** 2) ** 2
        circles = np.bincount(pixels, minlength=len(surface.heights))
        axial = axial * growth
        return cls(np.arctan2(axial[is_shown], radial[is_shown]), weights, samples, circles, step)

    @cached_property
    def shares(self) -> np.ndarray:
        """Shares (H, S) of the pixels of each circle that show each of COUNTED_SLOPES_DEG."""
        counts, degrees = np.zeros((len(self.circles), COUNTED_SLOPES_DEG.size)), np.degrees(self.slopes)
        is_counted = np.abs(degrees) < 90.0
        numbers = np.rint(degrees[is_counted]).astype(int) - COUNTED_SLOPES_DEG[0]
        np.add.at(counts, (self.samples[is_counted], numbers), self.weights[is_counted])
        along = HEIGHT_SIGMA_PX / self.step
        counts = ndimage.gaussian_filter(counts, (along, SLOPE_SIGMA_DEG), mode="constant")
        # A circle whose pixels all show the same slope has the share 1 there.
        counts *= np.sqrt(2.0 * np.pi) * SLOPE_SIGMA_DEG
        pixels = ndimage.gaussian_filter1d(self.circles.astype(float), along, mode="constant")
        return np.minimum(counts / np.maximum(pixels, MIN_CIRCLE_PIXELS * self.step)[:, None], 1.0)

    def most_shown(self, contour: np.ndarray) -> np.ndarray:
        """Return the slope (H,) in radians at each sample that the largest share of its circle's pixels shows.

        contour: (H,), slopes in radians that need no normal.
        """
        correction = np.abs(COUNTED_SLOPES_DEG - np.degrees(contour)[:, None])
        score = np.log(CHANCE_SHARE + self.shares) - CORRECTION_NATS * correction
        best = np.where(correction <= MAX_FROM_CONTOUR_DEG, score, -np.inf).argmax(axis=1)
        is_shown = _taken(self.shares, best) > CHANCE_SHARE
        return np.where(is_shown, np.radians(COUNTED_SLOPES_DEG[best]), contour)

    def rivalry(self, slopes: np.ndarray) -> np.ndarray:
        """Return the largest share (H,) that shows another slope than `slopes` (H,), radians, relative to their own."""
        degrees = np.degrees(slopes)
        is_other = np.abs(COUNTED_SLOPES_DEG - degrees[:, None]) > RIVAL_DEG
        nearest = np.rint(degrees).astype(int) - COUNTED_SLOPES_DEG[0]
        own = np.maximum(_taken(self.shares, nearest), CHANCE_SHARE)
        return np.asarray(np.where(is_other, self.shares, 0.0).max(axis=1) / own)

    def near(self, slopes: np.ndarray) -> "ShownSlopes":
        """Return those within OWN_DEG of the slopes (H,) of their circles, radians."""
        is_near = np.abs(self.slopes - slopes[self.samples]) < np.radians(OWN_DEG)
        return replace(self, slopes=self.slopes[is_near], weights=self.weights[is_near], samples=self.samples[is_near])

    def mean_residual(self, slopes: np.ndarray) -> np.ndarray:
        """Return the mean difference (H,) from slopes (H,) to those shown, radians, smoothed along the axis.

        PRIOR_NORMALS draw it towards 0, which it is where none are shown.
        """
        residual = self.slopes - slopes[self.samples]
        total, sums = blurred_sums(self.samples, self.weights, residual, len(slopes), MEAN_SIGMA_PX / self.step)
        return np.asarray(sums / (total + PRIOR_NORMALS))


def with_shown_slopes(surface: SurfaceOfRevolution, shown: ShownSlopes) -> SurfaceOfRevolution:
    """Return the surface with its profile's slopes corrected by those shown on it; flat ends are left unchanged.

    surface: with the contour's radii and slopes.
    """
    contour = surface.slope_angles
    slopes = np.where(surface.is_wall, shown.most_shown(contour), contour)
    own = shown.near(slopes)
    # Smoothing flattens what is bent: the second time the residual is added back (Tukey's twicing).
    for _ in range(2):
        slopes = slopes + np.where(surface.is_wall, own.mean_residual(slopes), 0.0)
    return surface.with_slope_angles(slopes)


def _taken(shares: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Return the share (H,) of each row of shares (H, S) at a number (H,)."""
    return np.asarray(np.take_along_axis(shares, numbers[:, None], axis=1)[:, 0])
