"""Fit of a surface of revolution to a silhouette and accepted normals: its axis, its tilt and its profile.

A reflection symmetry axis of the silhouette may be the image of an axis of revolution. For a tilt of that axis towards
the camera, the largest surface of revolution inside the silhouette follows (after Wong, Mendonca and Cipolla 2004);
accepted normals decide the tilt.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property, partial

import numpy as np

from glint.tasks.algorithms.geometry.vectors import angles, positions_at, sampled_pixels
from glint.tasks.algorithms.revolution.relief import ERROR_CAP_DEG
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from glint.tasks.algorithms.silhouettes.mirror_images import completed_silhouette, mirror_images, symmetric_body
from glint.tasks.algorithms.silhouettes.reflection_axes import ReflectionAxis, reflection_axes

MAX_TILT_DEG = 75
"""Largest tilt that is tried."""
TILT_STEP_DEG, COARSE_TILT_STEP_DEG, FINAL_TILT_STEP_DEG = 3.75, 0.95, 0.1
"""Half the distance of the tilts tried first, and the steps at which their refinement ends, coarse and fine."""
COLLAPSED_ERROR_RATIO = 1.5
"""Ratio of its error to that with coarser steps from which a profile has collapsed."""
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


@dataclass(frozen=True, slots=True)
class _SampledNormals:
    """A sample of accepted normals (N, 3), at positions x and y (N,) in pixels."""

    x: np.ndarray
    y: np.ndarray
    normals: np.ndarray

    @classmethod
    def of(cls, accepted: np.ndarray, mask: np.ndarray) -> "_SampledNormals | None":
        """Return a sample of normals (H, W, 3), NaN without, in a mask (H, W) bool; None if there are too few."""
        rows, columns = sampled_pixels(mask & np.isfinite(accepted[..., 0]), SAMPLED_NORMALS)
        if len(rows) < MIN_NORMALS:
            return None
        return cls(*positions_at(rows, columns, mask.shape), accepted[rows, columns])

    def mean_error(self, surface: SurfaceOfRevolution, stride: int = 1) -> float:
        """Return the mean angle in degrees to a surface's normals, of every `stride`-th normal of the sample."""
        x, y, normals = self.x[::stride], self.y[::stride], self.normals[::stride]
        hits = surface.intersect(x, y)
        error = angles(surface.normals_at(hits), normals)
        # An end may be open: counted as wrong, the normals of the far wall would favour tilts that hide it.
        is_end = surface.is_end_at(hits)
        far = surface.normals(x[is_end], y[is_end], far=True)
        error[is_end] = np.fmin(error[is_end], angles(far, normals[is_end]))
        error = np.nan_to_num(error, nan=ERROR_CAP_DEG)
        return float(np.minimum(error, ERROR_CAP_DEG).mean())


def fitted_surface(
    silhouette: SilhouetteSymmetry, accepted: np.ndarray, hopeless_error: float
) -> tuple[float, SurfaceOfRevolution] | None:
    """Return the least mean angle in degrees to the accepted normals (H, W, 3), and the surface.

    None: there are too few normals, or coarse steps give at least the hopeless error.
    """
    sample = _SampledNormals.of(accepted, silhouette.mask)
    if sample is None:
        return None
    enlarged = max(1.0, float(np.ptp(np.argwhere(silhouette.mask), axis=0).max()) / FITTED_LENGTH_PX)

    def mean_error(axis: int, tilt: float, step: float = FITTED_STEP_PX, stride: int = 1) -> float:
        return sample.mean_error(silhouette.surface(axis, tilt, enlarged * step), stride)

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
            if sample.mean_error(best) > COLLAPSED_ERROR_RATIO * least_error:
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
    # After a step, the neighbour on one side is the tilt before it, whose error `error_at` has kept.
    error, turn = error_at(tilt), np.radians(first_step)
    while turn > np.radians(last_step):
        neighbours = [angle for angle in (tilt - turn, tilt + turn) if abs(angle) <= np.radians(MAX_TILT_DEG)]
        neighbour_error, neighbour = min((error_at(angle), angle) for angle in neighbours)
        if neighbour_error < error:
            error, tilt = neighbour_error, neighbour
        else:
            turn /= 2
    return error, tilt
