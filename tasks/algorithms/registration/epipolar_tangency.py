"""Silhouette coherence: the ray through each silhouette pixel of a view must touch the hull of all other views.

The distance by which a ray misses that hull, or by which it would have to run inside all other silhouettes, is zero for
consistent poses at frontier points (epipolar tangency: Cipolla, Astrom and Giblin 1995), whatever the object's shape.
Averaged over all rays it measures silhouette coherence (Hernandez, Schmitt and Cipolla, Silhouette Coherence for Camera
Calibration under Circular Motion, TPAMI 2007).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares
from scipy.special import expit

from glint.tasks.algorithms.multiview.silhouette_distance import silhouette_distance
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.multiview.visual_hull import bounding_sphere

RAYS_PER_VIEW = 48
"""Rays per silhouette by which a view is judged."""
CALIBRATION_RAYS = 120
"""Rays per silhouette in the calibration: enough to average out the staircase of the pixels."""
SILHOUETTE_ERROR_PX = 0.15
"""Expected residual of a ray in pixels."""
OUTLIER_RESIDUAL_PX = 1.0
"""Residual in pixels beyond which the loss grows linearly."""
HINGE_WIDTH_PX = 0.05
"""Width in pixels of the smooth transition at which a ray leaves the hull and begins to count."""
COARSE_RAY_SAMPLES, FINE_RAY_SAMPLES = 40, 9
"""Samples along a ray: first through the whole bounding sphere, then around the best."""
DIFFERENCE_STEP = 0.1
"""Step of numerical derivatives of what is fitted: degrees, or percent of a size."""
MAX_EVALUATIONS = 12
"""Evaluations of the least-squares solver."""


@dataclass(frozen=True, slots=True)
class SilhouetteRays:
    """Rays through R silhouette pixels of each of V views, and the point of each that is deepest in all other views.

    columns, rows (V, R): the pixels; depth (V, R): that point's position on the ray, world units; nearest_view (V, R):
    the view whose silhouette is nearest there; distance (V, R): to that silhouette, in pixels of the ray's own view,
    positive outside.
    """

    columns: np.ndarray
    rows: np.ndarray
    depth: np.ndarray
    nearest_view: np.ndarray
    distance: np.ndarray

    def distances(self, views: Sequence[View], pixel_sizes: np.ndarray) -> np.ndarray:
        """Return the distances (V, R) for views moved slightly: to first order the deepest points stay on their rays.

        pixel_sizes (V,): world units of each view's pixels.
        """
        points = np.stack(
            [
                _points_on_rays(view, self.columns[number], self.rows[number], self.depth[number])
                for number, view in enumerate(views)
            ]
        )
        distances = np.zeros(self.nearest_view.shape)
        for number, view in enumerate(views):
            is_nearest = self.nearest_view == number
            distances[is_nearest] = silhouette_distance(view, points[is_nearest])
        return distances / pixel_sizes[:, None]

    def derivatives(
        self, views_at: Callable[[np.ndarray], Sequence[View]], unknowns: np.ndarray, pixel_sizes: np.ndarray
    ) -> np.ndarray:
        """Return the derivatives (V * R, U) of the robust residuals by U unknowns at which the rays were traced.

        views_at(unknowns): the views that follow from them; pixel_sizes: as of `distances`.
        """
        slope = robust_residuals(self.distance)[1]
        columns = []
        for change in DIFFERENCE_STEP * np.eye(len(unknowns)):
            # The deepest points stay on their rays to first order, so they need not be searched again.
            forward, backward = (
                self.distances(views_at(unknowns + sign * change), pixel_sizes) for sign in (1.0, -1.0)
            )
            columns.append(slope * (forward - backward).ravel() / (2 * DIFFERENCE_STEP))
        return np.stack(columns, axis=1)


def trace_silhouette_rays(views: Sequence[View], rays_per_view: int) -> SilhouetteRays:
    """Trace rays through the silhouette pixels of all views against the silhouettes of the other views."""
    columns, rows = np.moveaxis(np.array([view.silhouette_pixels(rays_per_view) for view in views]), 1, 0)
    sphere = bounding_sphere(views)
    depth, nearest_view, distance = zip(
        *(_deepest_points(views, number, columns[number], rows[number], sphere) for number in range(len(views))),
        strict=True,
    )
    return SilhouetteRays(columns, rows, np.array(depth), np.array(nearest_view), np.array(distance))


def silhouette_residuals(views: Sequence[View], rays_per_view: int = RAYS_PER_VIEW) -> np.ndarray:
    """Return the distances (V, rays_per_view), pixels, by which the rays of each view miss the hull of the others."""
    return np.maximum(trace_silhouette_rays(views, rays_per_view).distance, 0.0)


def robust_residuals(distances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return residuals (N,) of rays at signed distances (V, R), pixels, and their derivatives (N,) per pixel.

    Rays inside the hull have zero residual (a smooth hinge); beyond OUTLIER_RESIDUAL_PX the squared residual grows
    linearly (pseudo-Huber loss, Charbonnier et al. 1997).
    """
    flat = distances.ravel()
    outside = HINGE_WIDTH_PX * np.logaddexp(0.0, flat / HINGE_WIDTH_PX)
    root = np.sqrt(1.0 + (outside / OUTLIER_RESIDUAL_PX) ** 2)
    scale = np.sqrt(2.0 / (root + 1.0))
    residuals = outside * scale / SILHOUETTE_ERROR_PX
    return residuals, expit(flat / HINGE_WIDTH_PX) / (root * scale) / SILHOUETTE_ERROR_PX


def fit_silhouettes(
    views_at: Callable[[np.ndarray], Sequence[View]],
    scales: np.ndarray,
    pixel_sizes: np.ndarray,
    further_residuals: Callable[[np.ndarray], np.ndarray],
    further_derivatives: np.ndarray,
) -> tuple[np.ndarray, float]:
    """Fit unknowns to the coherence of silhouettes and to further residuals, by nonlinear least squares.

    Args:
        views_at: the views that follow from unknowns (U,), which start at zero, in degrees or percent of a size.
        scales: (U,), sizes that the unknowns may have.
        pixel_sizes: (V,), world units of each view's pixels.
        further_residuals: residuals (P,), linear in the unknowns, such as their priors.
        further_derivatives: (P, U), of these.

    Returns:
        The unknowns (U,), and the cost of the fit in nats.
    """

    # The solver evaluates residuals and derivatives at the same unknowns, one after the other.
    @lru_cache(maxsize=1)
    def rays_at(*unknowns: float) -> SilhouetteRays:
        return trace_silhouette_rays(views_at(np.array(unknowns)), CALIBRATION_RAYS)

    def residuals(unknowns: np.ndarray) -> np.ndarray:
        distances = rays_at(*unknowns.tolist()).distance
        return np.concatenate([robust_residuals(distances)[0], further_residuals(unknowns)])

    def jacobian(unknowns: np.ndarray) -> np.ndarray:
        rays = rays_at(*unknowns.tolist())
        return np.vstack([rays.derivatives(views_at, unknowns, pixel_sizes), further_derivatives])

    start = np.zeros(len(scales))
    solution = least_squares(
        residuals, start, jac=jacobian, x_scale=scales, max_nfev=MAX_EVALUATIONS, xtol=1e-4, ftol=1e-4
    )
    return solution.x, float(solution.cost)


def _deepest_points(
    views: Sequence[View],
    number: int,
    columns: np.ndarray,
    rows: np.ndarray,
    sphere: tuple[np.ndarray, float],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return `depth`, `nearest_view` and `distance` (R,) of the rays of view `number`.

    sphere: centre (3,) and radius of a bounding sphere of the object.
    """
    remaining = np.array([index for index in range(len(views)) if index != number])
    starts, directions = views[number].rays(columns, rows)

    def distances_at(depth: np.ndarray) -> np.ndarray:
        points = _points_on_rays(views[number], columns, rows, depth)
        return np.stack([silhouette_distance(views[index], points) for index in remaining])

    # The hull's implicit function is the maximum over the views; minimise it along each ray, coarse to fine.
    centre, radius = sphere
    depth = ((centre - starts) * directions).sum(axis=1)[:, None] + np.linspace(-radius, radius, COARSE_RAY_SAMPLES)
    step = 2 * radius / (COARSE_RAY_SAMPLES - 1)
    for _ in range(2):
        best = np.take_along_axis(depth, distances_at(depth).max(axis=0).argmin(axis=1)[:, None], axis=1)
        depth = best + np.linspace(-step, step, FINE_RAY_SAMPLES)
        step *= 2 / (FINE_RAY_SAMPLES - 1)
    best = np.take_along_axis(depth, distances_at(depth).max(axis=0).argmin(axis=1)[:, None], axis=1)
    distances = distances_at(best)[..., 0]
    pixel_size = views[number].footprint(centre[None])
    return best[:, 0], remaining[distances.argmax(axis=0)], distances.max(axis=0) / pixel_size


def _points_on_rays(view: View, columns: np.ndarray, rows: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Return points (R, 3) or (R, N, 3) at distances (R,) or (R, N) along the rays through pixels (R,)."""
    starts, directions = view.rays(columns, rows)
    extra = (None,) * (depth.ndim - 1)
    return starts[:, *extra] + depth[..., None] * directions[:, *extra]
