"""Rotationally symmetric objects, as most glasses, bottles and domes are: whether one is, and its normals.

Accepted normals decide whether the object is a surface of revolution at all (`surface_fit`), and the slopes of its
profile. The surface supplies what neither highlights nor a smooth field can: feet, shoulders, flat ends, and the far
wall seen through an opening.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from glint.tasks.algorithms.geometry.distance import with_nearest
from glint.tasks.algorithms.geometry.vectors import pixel_positions, positions_at, sampled_pixels, unit
from glint.tasks.algorithms.revolution.hollowness import hollow_opening
from glint.tasks.algorithms.revolution.opening import Opening, find_opening
from glint.tasks.algorithms.revolution.profile_slopes import ShownSlopes, with_shown_slopes
from glint.tasks.algorithms.revolution.relief import Relief, capped_angles, find_relief
from glint.tasks.algorithms.revolution.surface_fit import SilhouetteSymmetry, fitted_surface
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from glint.tasks.algorithms.silhouettes.aimed_view import AimedView

MIN_RELIEF_DEG = 2.0
"""Median angle of accepted normals from a fitted surface from which a relief is looked for."""
SHOWN_PIXELS = 300_000
"""Pixels whose candidates show a relief, and the slopes of a profile."""
HOPELESS_ERROR_RATIO = 3.0
"""Error with coarse steps, relative to the limit of a fit, from which nothing is refined; with fitted slopes or relief,
fits come from up to 2.5 times it."""


class FitLimits(NamedTuple):
    """Largest mean angle from accepted normals to a surface, each angle capped, and its ratio to that of simpler ones.

    is_of_slopes: whether the profile's slopes are fitted first. relief_excuses: whether one with relief may fit worse.
    """

    error_deg: float
    simpler_error_ratio: float
    is_of_slopes: bool = False
    relief_excuses: bool = True

    def largest_error(self, accepted: np.ndarray, field: np.ndarray | None) -> float:
        """Return the largest mean angle in degrees from accepted normals to a surface that fits well enough.

        Args:
            accepted: (H, W, 3), NaN where there is none.
            field: (H, W, 3), the initial normals; None: not compared.
        """
        is_accepted = np.isfinite(accepted[..., 0])
        normals = accepted[is_accepted]
        if not len(normals):
            return self.error_deg
        # A single flat face may be the end of any surface of revolution: it shows no axis.
        simpler = [np.broadcast_to(unit(normals.sum(axis=0)), normals.shape)]
        if field is not None:
            simpler.append(field[is_accepted])
        errors = [float(capped_angles(surface, normals).mean()) for surface in simpler]
        return min(self.error_deg, self.simpler_error_ratio * min(errors))


SYMMETRIC_LIMITS = FitLimits(5.0, 0.4)
"""Limits for a symmetric silhouette."""


class RotationalNormals(NamedTuple):
    """Normals and depths of a rotationally symmetric object.

    normals: (H, W, 3) float32, relative to the view rays, NaN outside the object. depths: (H, W) float32, z of what is
    seen of its body in pixels towards the camera, up to a constant; NaN outside the body, on handles, and where rays
    miss it. relief_fit: how well its relief fits, or 0. round_error: mean angle in degrees between the accepted normals
    and the surface of revolution without relief. rivalry: (H, W) float32, share of the circle's pixels that shows
    another slope of the wall, relative to that which shows the surface's; 0 outside walls. tangents: (H, W, 3) float32,
    unit, along the circles of the wall, relative to the view rays; NaN outside walls. Either is None if not known.
    """

    normals: np.ndarray
    depths: np.ndarray
    relief_fit: float
    round_error: float
    rivalry: np.ndarray | None = None
    tangents: np.ndarray | None = None

    def seen_back(self, aimed: AimedView) -> "RotationalNormals":
        """Return what the camera's own image shows of what a view aimed at the object shows."""
        rivalry = None if self.rivalry is None else aimed.values_back(self.rivalry)
        tangents = None if self.tangents is None else aimed.vectors_back(self.tangents)
        normals, depths = aimed.normals_back(self.normals), aimed.heights_back(self.depths)
        return self._replace(normals=normals, depths=depths, rivalry=rivalry, tangents=tangents)

    def behind(self, nearer: "RotationalNormals") -> "RotationalNormals":
        """Return what is seen if another object stands before this one, where that is nearer to the camera."""
        is_nearer = np.isfinite(nearer.depths) & ~(nearer.depths <= self.depths)
        normals = np.where(is_nearer[..., None], nearer.normals, self.normals)
        depths = np.where(is_nearer, nearer.depths, self.depths)
        rivalry = None
        if self.rivalry is not None and nearer.rivalry is not None:
            rivalry = np.where(is_nearer, nearer.rivalry, self.rivalry)
        return self._replace(normals=normals, depths=depths, rivalry=rivalry, tangents=None)


class _Fit(NamedTuple):
    """A surface of revolution that accepted normals support.

    error: mean angle in degrees from these to the surface inside the silhouette, without relief. relief: with which
    they fit better, if there is one; surface is then the one below it.
    """

    error: float
    surface: SurfaceOfRevolution
    relief: Relief | None


def surface_of_revolution_normals(
    silhouette: SilhouetteSymmetry,
    accepted: np.ndarray,
    candidates: np.ndarray,
    field: np.ndarray | None = None,
    limits: FitLimits = SYMMETRIC_LIMITS,
) -> RotationalNormals | None:
    """Return the normals of a rotationally symmetric object; None if it is not one.

    Args:
        silhouette: of (H, W) pixels.
        accepted: (H, W, 3), normals of accepted highlights, NaN elsewhere.
        candidates: (K, H, W, 3), NaN where there is none; they show a relief, the slopes of the profile, and whether an
            end is an opening.
        field: (H, W, 3), the initial normals, which the surface must fit much better than.
        limits: how well the surface must fit.
    """
    mask = silhouette.mask
    fit = _supported_fit(silhouette, accepted, candidates, limits, limits.largest_error(accepted, field))
    if fit is None:
        return None
    # A relief turns rays aside as a solid does.
    find = hollow_opening if fit.relief is None else find_opening
    opening = find(fit.surface, mask, candidates)
    by_contour = fit.surface.with_risen_plates(*_accepted_normals(mask, accepted))
    return shown_normals(by_contour, opening, mask, candidates, fit.error, fit.relief)


def shown_normals(
    surface: SurfaceOfRevolution,
    opening: Opening | None,
    mask: np.ndarray,
    candidates: np.ndarray,
    error: float = 0.0,
    relief: Relief | None = None,
) -> RotationalNormals | None:
    """Return what a mask (H, W) bool shows of a body about an axis; None if all rays miss it.

    surface: with the contour's radii and slopes; candidates (K, H, W, 3), NaN where there is none, show the true
    slopes. opening: of its end. error: mean angle in degrees between accepted normals and the body without relief.
    """
    shown = sampled_candidates(mask, candidates, SHOWN_PIXELS)
    slopes = ShownSlopes.on(surface, *shown)
    surface = with_shown_slopes(surface, slopes)
    x, y = pixel_positions(mask)
    hits = surface.intersect(x, y)
    normals, depths = surface.normals_at(hits), hits.depths
    if not np.isfinite(normals[:, 0]).any():
        return None
    is_wall = np.isfinite(hits.heights) & ~surface.is_end_at(hits)
    rivalry = np.where(is_wall, np.interp(hits.heights, surface.heights, slopes.rivalry(surface.slope_angles)), 0.0)
    tangents = np.where(is_wall[:, None], unit(np.cross(hits.upward, hits.outward)), np.nan)
    if relief is not None:
        normals = relief.normals(x, y, normals)
    if opening is not None:
        inside = with_shown_slopes(opening.surface, ShownSlopes.on(opening.surface, *shown))
        _see_into(replace(opening, surface=inside), opening.around[mask], x, y, normals, depths)
        tangents[opening.around[mask]] = np.nan
    return RotationalNormals(
        # Rays at the contour may miss the surface.
        with_nearest(picture(mask, normals), mask),
        picture(mask, depths),
        relief.fit if relief else 0.0,
        error,
        picture(mask, rivalry, 0.0),
        picture(mask, tangents),
    )


def _supported_fit(
    silhouette: SilhouetteSymmetry,
    accepted: np.ndarray,
    candidates: np.ndarray,
    limits: FitLimits,
    largest_error: float,
) -> _Fit | None:
    """Return the surface that fits accepted normals, or has a relief with which it does; None without.

    largest_error: of a surface that fits, degrees. For the rest see `surface_of_revolution_normals`.
    """
    fitted = fitted_surface(silhouette, accepted, HOPELESS_ERROR_RATIO * largest_error)
    if fitted is None:
        return None
    error, surface = fitted
    x, y, normals = _accepted_normals(silhouette.mask, accepted)
    deviation = capped_angles(surface.with_fitted_slopes(x, y, normals).normals(x, y), normals)
    if (limits.relief_excuses or error <= largest_error) and np.median(deviation) > MIN_RELIEF_DEG:
        relief = _sampled_relief(silhouette.mask, surface, accepted, candidates)
        if relief is not None:
            return _Fit(error, relief.surface, relief)
    fits = (deviation.mean() if limits.is_of_slopes else error) <= largest_error
    return _Fit(error, surface, None) if fits else None


def _accepted_normals(mask: np.ndarray, accepted: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x and y (N,), camera frame, of the pixels with an accepted normal, and these normals (N, 3)."""
    is_accepted = mask & np.isfinite(accepted[..., 0])
    return *pixel_positions(is_accepted), accepted[is_accepted]


def sampled_candidates(
    mask: np.ndarray, candidates: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x and y (N,), pixels, camera frame, of at most `count` pixels with a candidate, and theirs (K, N, 3).

    mask: (H, W) bool. candidates: (K, H, W, 3), NaN where there is none.
    """
    rows, columns = sampled_pixels(mask & np.isfinite(candidates[..., 0]).any(axis=0), count)
    return *positions_at(rows, columns, mask.shape), candidates[:, rows, columns]


def _sampled_relief(
    mask: np.ndarray, surface: SurfaceOfRevolution, accepted: np.ndarray, candidates: np.ndarray
) -> Relief | None:
    """Return the relief of a surface by a sample of its pixels; see `surface_of_revolution_normals`."""
    sample = np.zeros_like(mask)
    sample[sampled_pixels(mask, SHOWN_PIXELS)] = True
    return find_relief(mask, surface, *pixel_positions(sample), accepted[sample], candidates[:, sample])


def _see_into(
    opening: Opening, around: np.ndarray, x: np.ndarray, y: np.ndarray, normals: np.ndarray, depths: np.ndarray
) -> None:
    """Replace normals (N, 3) and depths (N,) at x and y (N,) by those of an opening, where `around` (N,) bool it."""
    normals[around], end_depths, is_far = opening.entries(x[around], y[around])
    # Another tilt moves the end towards the camera, the wall below it hardly.
    moved = (end_depths - depths[around])[~is_far]
    depths[around] = end_depths - (np.nanmedian(moved) if np.isfinite(moved).any() else 0.0)


def picture(mask: np.ndarray, values: np.ndarray, outside: float = np.nan) -> np.ndarray:
    """Return values (N, ..) of the N pixels of a mask (H, W) bool as a picture (H, W, ..) float32."""
    result = np.full((*mask.shape, *values.shape[1:]), outside, np.float32)
    result[mask] = values
    return result
