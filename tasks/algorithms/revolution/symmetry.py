"""Rotationally symmetric objects: fit of a surface of revolution, as most glasses, bottles and domes are.

A reflection symmetry axis of the silhouette may be the image of an axis of revolution. For a tilt of that axis towards
the camera, the largest surface of revolution inside the silhouette follows (after Wong, Mendonca and Cipolla 2004).
Accepted normals decide whether the object is one at all, its tilt, and the slopes of its profile. The surface supplies
what neither highlights nor a smooth field can: feet, shoulders, flat ends, and the far wall seen through an opening.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from typing import NamedTuple

import numpy as np

from glint.tasks.algorithms.geometry.distance import with_nearest
from glint.tasks.algorithms.geometry.vectors import angles, positions_at
from glint.tasks.algorithms.revolution.fit_limits import SYMMETRIC_LIMITS, FitLimits
from glint.tasks.algorithms.revolution.opening import find_opening
from glint.tasks.algorithms.revolution.relief import ERROR_CAP_DEG, capped_angles, find_relief
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from glint.tasks.algorithms.silhouettes.mirror_images import completed_silhouette, mirror_images, symmetric_body
from glint.tasks.algorithms.silhouettes.reflection_axes import ReflectionAxis, reflection_axes

MAX_TILT_DEG = 75
"""Largest tilt that is tried."""
TILT_STEP_DEG, COARSE_TILT_STEP_DEG, FINAL_TILT_STEP_DEG = 3.75, 0.95, 0.1
"""Half the distance of the tilts tried first, and the steps at which their refinement ends, coarse and fine."""
COLLAPSED_ERROR_RATIO = 1.5
"""Ratio of its error to that with coarser steps from which a profile has collapsed."""
MIN_RELIEF_DEG = 2.0
"""Median angle of accepted normals from a fitted surface from which a relief is looked for."""
RELIEF_PIXELS = 300_000
"""Pixels that show a relief."""
MIN_NORMALS, SAMPLED_NORMALS = 20, 1500
"""Accepted normals without which no surface is fitted, and number of those compared for each tilt."""
TILTS = np.radians(np.arange(-MAX_TILT_DEG, MAX_TILT_DEG + 1, 2 * TILT_STEP_DEG))
"""Tilts tried first, in radians."""
COARSE_STEP_PX, COARSE_STRIDE = 2.0, 8
"""Step along the axis, and subsampling of the normals, for the tilts tried first."""
FITTED_STEP_PX, FINAL_STEP_PX = 1.0, 0.5
"""Steps along the axis while the tilt is refined, and of the surface that results."""
FITTED_LENGTH_PX = 600.0
"""Length of an object beyond which the first two steps grow with it, so that there are as many."""
HOPELESS_ERROR_RATIO = 3.0
"""Error with coarse steps, relative to the limit of a fit, from which nothing is refined; with fitted slopes or relief,
fits come from up to 2.5 times it."""
REFINED_ERROR_RATIO = 1.3
"""Ratio to the least error of the tilts found by coarse steps up to which one is refined."""


@dataclass(frozen=True, eq=False)
class SilhouetteSymmetry:
    """Axes, bodies and surfaces of revolution inside a silhouette: computed on demand, and kept for the next fit.

    mask: (H, W) bool. inverse_focal: 1 over the focal length in pixels of the perspective camera that sees it, aimed at
    the middle of the image; 0 for parallel rays.
    """

    mask: np.ndarray
    inverse_focal: float = 0.0
    _surfaces: dict[tuple[int, float, float], SurfaceOfRevolution] = field(default_factory=dict, init=False)

    @cached_property
    def axes(self) -> list[ReflectionAxis]:
        """Reflection symmetry axes of the silhouette, best first."""
        return reflection_axes(self.mask)

    @cached_property
    def bodies(self) -> list["SilhouetteSymmetry"]:
        """Symmetric parts of the silhouette that could be its body."""
        return self._symmetric(symmetric_body)

    @cached_property
    def completions(self) -> list["SilhouetteSymmetry"]:
        """Symmetric silhouettes of which this one may show a part."""
        return self._symmetric(completed_silhouette)

    @cached_property
    def _images(self) -> list[np.ndarray]:
        return mirror_images(self.mask)

    def _symmetric(self, joined: Callable[[np.ndarray, np.ndarray], np.ndarray | None]) -> list["SilhouetteSymmetry"]:
        masks = [joined(self.mask, image) for image in self._images]
        return [SilhouetteSymmetry(mask, self.inverse_focal) for mask in masks if mask is not None]

    def surface(self, axis: int, tilt: float, step: float) -> SurfaceOfRevolution:
        """Return the largest surface inside the silhouette about an axis; see `SurfaceOfRevolution.from_silhouette`."""
        key = (axis, tilt, step)
        if key not in self._surfaces:
            self._surfaces[key] = SurfaceOfRevolution.from_silhouette(
                self.mask, self.axes[axis], tilt, step, self.inverse_focal
            )
        return self._surfaces[key]


class RotationalNormals(NamedTuple):
    """Normals and depths of a rotationally symmetric object.

    normals: (H, W, 3) float32, relative to the view rays, NaN outside the object. depths: (H, W) float32, z of what is
    seen of its body in pixels towards the camera, up to a constant; NaN outside the body, on handles, and where rays
    miss it. relief_fit: how well its relief fits, or 0. round_error: mean angle in degrees between the accepted normals
    and the surface of revolution without relief.
    """

    normals: np.ndarray
    depths: np.ndarray
    relief_fit: float
    round_error: float


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
        candidates: (K, H, W, 3), NaN where there is none; they decide whether an end is an opening.
        field: (H, W, 3), the silhouette's smooth normal field, which the surface must fit much better than.
        limits: how well the surface must fit.
    """
    mask, limit = silhouette.mask, limits.largest_error(accepted, field)
    fitted = _fitted_surface(silhouette, accepted, HOPELESS_ERROR_RATIO * limit)
    if fitted is None:
        return None
    error, surface = fitted
    rows, columns = np.nonzero(mask)
    x, y = positions_at(rows, columns, mask.shape)
    known = np.isfinite(accepted[rows, columns, 0])
    measured = (x[known], y[known], accepted[rows, columns][known])
    deviation = capped_angles(surface.with_fitted_slopes(*measured).normals(*measured[:2]), measured[2])
    may_have_relief = (limits.relief_excuses or error <= limit) and np.median(deviation) > MIN_RELIEF_DEG
    relief = None
    if may_have_relief:
        used = np.sort(np.random.default_rng(0).permutation(len(rows))[:RELIEF_PIXELS])
        shown = accepted[rows[used], columns[used]], candidates[:, rows[used], columns[used]]
        relief = find_relief(mask, surface, x[used], y[used], *shown)
    if relief is not None:
        surface = relief.surface
    elif (deviation.mean() if limits.is_of_slopes else error) > limit:
        return None
    opening = find_opening(surface, mask, candidates)
    surface = surface.with_risen_plates(*measured).with_fitted_slopes(*measured)
    hits = surface.intersect(x, y)
    normals, depths = surface.normals_at(hits), hits.depths
    if not np.isfinite(normals[:, 0]).any():
        return None
    if relief is not None:
        normals = relief.normals(x, y, normals)
    if opening is not None:
        opening = replace(opening, surface=opening.surface.with_fitted_slopes(*measured))
        around = opening.around[rows, columns]
        normals[around], end_depths, is_far = opening.entries(x[around], y[around])
        # Another tilt moves the end towards the camera, the wall below it hardly.
        moved = (end_depths - depths[around])[~is_far]
        depths[around] = end_depths - (np.nanmedian(moved) if np.isfinite(moved).any() else 0.0)
    result, body = np.full((*mask.shape, 3), np.nan, np.float32), np.full(mask.shape, np.nan, np.float32)
    result[rows, columns], body[rows, columns] = normals, depths
    # Rays at the contour may miss the surface.
    return RotationalNormals(with_nearest(result, mask), body, relief.fit if relief else 0.0, error)


def _fitted_surface(
    silhouette: SilhouetteSymmetry, accepted: np.ndarray, hopeless_error: float
) -> tuple[float, SurfaceOfRevolution] | None:
    """Return the least mean angle in degrees to the accepted normals (H, W, 3), and the surface.

    None: there are too few normals, or coarse steps give at least the hopeless error.
    """
    mask = silhouette.mask
    rows, columns = np.nonzero(mask & np.isfinite(accepted[..., 0]))
    if len(rows) < MIN_NORMALS:
        return None
    # A random sample: every n-th pixel in order would be a few columns of the image.
    chosen = np.random.default_rng(0).permutation(len(rows))[:SAMPLED_NORMALS]
    rows, columns = rows[chosen], columns[chosen]
    x, y = positions_at(rows, columns, mask.shape)
    normals = accepted[rows, columns]
    enlarged = max(1.0, float(np.ptp(np.argwhere(mask), axis=0).max()) / FITTED_LENGTH_PX)

    def mean_error(axis: int, tilt: float, step: float = FITTED_STEP_PX, stride: int = 1) -> float:
        return surface_error(silhouette.surface(axis, tilt, enlarged * step), stride)

    def surface_error(surface: SurfaceOfRevolution, stride: int = 1) -> float:
        hits = surface.intersect(x[::stride], y[::stride])
        error = angles(surface.normals_at(hits), normals[::stride])
        # An end may be open: counted as wrong, the normals of the far wall would favour tilts that hide it.
        is_end = surface.is_end_at(hits)
        far = surface.normals(x[::stride][is_end], y[::stride][is_end], far=True)
        error[is_end] = np.fmin(error[is_end], angles(far, normals[::stride][is_end]))
        error = np.nan_to_num(error, nan=ERROR_CAP_DEG)
        return float(np.minimum(error, ERROR_CAP_DEG).mean())

    starts = []
    for axis in range(len(silhouette.axes)):
        coarse_error_at = cache(partial(mean_error, axis, step=COARSE_STEP_PX, stride=COARSE_STRIDE))
        for tilt in TILTS[_local_minima(np.array([coarse_error_at(float(tilt)) for tilt in TILTS]))]:
            starts.append((*refined_tilt(coarse_error_at, float(tilt), TILT_STEP_DEG, COARSE_TILT_STEP_DEG), axis))
    if not starts or min(starts)[0] >= hopeless_error:
        return None
    least_error, best = ERROR_CAP_DEG, None
    for coarse_error, tilt, axis in starts:
        if coarse_error > REFINED_ERROR_RATIO * min(starts)[0]:
            continue
        error_at = cache(partial(mean_error, axis))
        error, tilt = refined_tilt(error_at, tilt, COARSE_TILT_STEP_DEG, FINAL_TILT_STEP_DEG)
        if error < least_error:
            least_error, best = error, silhouette.surface(axis, tilt, FINAL_STEP_PX)
            # Trimming is discontinuous: with finer steps a profile can collapse that fits with coarser ones.
            if surface_error(best) > COLLAPSED_ERROR_RATIO * least_error:
                best = silhouette.surface(axis, tilt, enlarged * FITTED_STEP_PX)
    return None if best is None else (least_error, best)


def _local_minima(errors: np.ndarray) -> np.ndarray:
    # A vessel fits from below nearly as well as from above.
    beside = np.pad(errors, 1, constant_values=np.inf)
    return np.flatnonzero((errors <= beside[:-2]) & (errors < beside[2:]))


def refined_tilt(
    error_at: Callable[[float], float], tilt: float, first_step: float, last_step: float
) -> tuple[float, float]:
    """Search either side of a tilt, with steps (degrees) that are halved where neither side is better.

    Returns the error and the tilt, in radians as the argument of `error_at`.
    """
    # A step to one side comes from the other, whose error is known.
    error, turn = error_at(tilt), np.radians(first_step)
    while turn > np.radians(last_step):
        neighbours = [angle for angle in (tilt - turn, tilt + turn) if abs(angle) <= np.radians(MAX_TILT_DEG)]
        neighbour_error, neighbour = min((error_at(angle), angle) for angle in neighbours)
        if neighbour_error < error:
            error, tilt = neighbour_error, neighbour
        else:
            turn /= 2
    return error, tilt
