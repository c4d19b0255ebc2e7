"""The fit of a view to a model at a pose: silhouettes and normals compared, and the pose refined from a start.

Silhouettes are compared both ways, as in the chamfer matching of Barrow, Tenenbaum, Bolles and Wolf (1977), and refined
by nonlinear least squares on closest points (iterative closest points, Besl and McKay 1992).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from glint.tasks.algorithms.meshing.ray_casting import RayScene
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.raycast import visible
from glint.tasks.algorithms.multiview.view import View, sample

SILHOUETTE_PIXELS = 120
"""Pixels of the silhouette that are compared."""
COARSE_SILHOUETTE_ERROR_PX, COARSE_NORMAL_ERROR_DEG = 0.2, 10.0
"""Expected errors of a coarse model's silhouette and normals; a normal further off counts as an outlier."""
ROBUST_RESIDUAL = 5.0
"""Silhouette residual, in expected errors, beyond which the loss grows linearly."""
MIN_FIT_CONFIDENCE = 0.5
"""Evidence from which a view's normals are compared."""
MAX_RIM_COSINE = 0.3
"""Largest cosine between normal and view vector of a vertex that may lie on the silhouette."""
TYPICAL_NORMAL_ERROR_DEG = 5.0
"""Typical median error of normals at the true pose: it costs 1."""
UNKNOWN_NORMAL_ERROR_DEG = 10.0
"""Median error that is assumed where too few normals can be compared."""
MAX_NORMAL_ERROR_DEG = 30.0
"""Upper bound of the median error: larger ones mean wrong labels, not a wrong pose."""
MIN_FIT_VERTICES = 30
"""Vertices that a view must see confidently for its normals to be compared."""
POSE_STEP = 0.1
"""Degrees or pixels over which residuals are differentiated."""
MAX_FIT_EVALUATIONS = 12
"""Evaluations of the least-squares solver."""

Poses = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Rotation (3, 3) and translation (3,) as a function of unknowns (K,) in degrees and pixels."""


@dataclass(frozen=True, slots=True)
class PoseFit:
    """A pose and how well a view fits a model there.

    rotation (3, 3), translation (3,): world to camera; silhouette_px: mean pixels between the silhouettes; normals_deg:
    median degrees between the normals, NaN if too few can be compared; cost: both together; angle: degrees of the
    turntable, if the pose is on one.
    """

    rotation: np.ndarray
    translation: np.ndarray
    silhouette_px: float
    normals_deg: float
    cost: float
    angle: float | None = None

    def angle_to(self, second: "PoseFit") -> float:
        """Return the degrees between the rotations of two poses."""
        return float(np.degrees(Rotation.from_matrix(self.rotation @ second.rotation.T).magnitude()))


class PoseFitter:
    """Compare one view with one model from any pose."""

    def __init__(self, view: View, model: Model) -> None:
        self.view, self.model = view, model
        self.distance = view.silhouette.distance
        self.scene = RayScene((model.vertices, model.triangles))
        self.contour = np.column_stack(view.silhouette_pixels(SILHOUETTE_PIXELS))
        gradient = self.distance.gradient(*self.contour.T)[:, :2] * [1.0, -1.0]
        self.outward = gradient / np.maximum(np.linalg.norm(gradient, axis=1, keepdims=True), 1e-9)

    def evaluate(self, rotation: np.ndarray, translation: np.ndarray) -> PoseFit:
        """Measure the fit at a pose, rotation (3, 3) and translation (3,), world to camera."""
        posed = self.view.with_pose(rotation, translation)
        outer, inner, normal_errors = self._residuals(posed, *self._comparable(posed))
        enough = len(normal_errors) >= MIN_FIT_VERTICES
        degrees = COARSE_NORMAL_ERROR_DEG * float(np.median(normal_errors)) if enough else np.nan
        silhouettes = sum(float((part**2).mean()) for part in _robust(outer, inner, normal_errors)[:2])
        normals = min(degrees, MAX_NORMAL_ERROR_DEG) if np.isfinite(degrees) else UNKNOWN_NORMAL_ERROR_DEG
        cost = silhouettes + (normals / TYPICAL_NORMAL_ERROR_DEG) ** 2
        silhouette_px = COARSE_SILHOUETTE_ERROR_PX * float(outer.mean() + inner.mean()) / 2
        return PoseFit(rotation, translation, silhouette_px, degrees, cost)

    def refine(self, poses: Poses, start: np.ndarray) -> np.ndarray:
        """Return the unknowns (K,), near the start (K,), whose pose fits best."""
        # What can be compared is decided at the start: the number of residuals must stay the same.
        comparable = self._comparable(self.view.with_pose(*poses(start)))

        def residuals(unknowns: np.ndarray) -> np.ndarray:
            parts = _robust(*self._residuals(self.view.with_pose(*poses(unknowns)), *comparable))
            return np.concatenate([part / np.sqrt(max(len(part), 1)) for part in parts])

        def jacobian(unknowns: np.ndarray) -> np.ndarray:
            steps = POSE_STEP * np.eye(len(unknowns))
            columns = [residuals(unknowns + step) - residuals(unknowns - step) for step in steps]
            return np.stack(columns, axis=1) / (2 * POSE_STEP)

        solution = least_squares(residuals, start, jac=jacobian, max_nfev=MAX_FIT_EVALUATIONS, xtol=1e-4, ftol=1e-4)
        return np.asarray(solution.x)

    def _comparable(self, posed: View) -> tuple[np.ndarray, np.ndarray]:
        """Return indices of the vertices that may lie on the silhouette, and of those with a confident normal."""
        model = self.model
        cosine = (model.normals * posed.view_vectors(model.vertices)).sum(axis=1)
        grazing = np.flatnonzero(np.abs(cosine) < MAX_RIM_COSINE)
        observed = np.flatnonzero(visible(self.scene, model.vertices, model.normals, posed))
        columns, rows = posed.project(model.vertices[observed])
        return grazing, observed[sample(np.nan_to_num(posed.evidence), columns, rows) > MIN_FIT_CONFIDENCE]

    def _residuals(
        self, posed: View, grazing: np.ndarray, confident: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return residuals in expected errors.

        (G,) how far grazing vertices lie outside the view's silhouette; (R,) how far the view's silhouette pixels lie
        outside the model's vertices; (S,) the difference of the normals of confident vertices.
        """
        columns, rows = posed.project(self.model.vertices)
        outer = np.maximum(self.distance.at(columns[grazing], rows[grazing]), 0.0)
        positions = np.column_stack([columns, rows])
        nearest = positions[cKDTree(positions).query(self.contour)[1]]
        inner = np.maximum(((self.contour - nearest) * self.outward).sum(axis=1), 0.0)
        normals = posed.to_world(posed.normals_at(columns[confident], rows[confident]))
        errors = np.linalg.norm(normals - self.model.normals[confident], axis=1)
        return (
            outer / COARSE_SILHOUETTE_ERROR_PX,
            inner / COARSE_SILHOUETTE_ERROR_PX,
            errors / np.radians(COARSE_NORMAL_ERROR_DEG),
        )


def _robust(
    outer: np.ndarray, inner: np.ndarray, normal_errors: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Apply robust losses: pseudo-Huber to silhouette residuals, Geman-McClure to those of normals."""

    def pseudo_huber(residuals: np.ndarray) -> np.ndarray:
        return ROBUST_RESIDUAL * np.sqrt(2.0 * (np.sqrt(1.0 + (residuals / ROBUST_RESIDUAL) ** 2) - 1.0))

    return pseudo_huber(outer), pseudo_huber(inner), normal_errors / np.sqrt(1.0 + normal_errors**2)
