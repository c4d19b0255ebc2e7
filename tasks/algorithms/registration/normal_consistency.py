"""Normal consistency of turntable angles: two views of the same surface point must give it the same normal.

Turning a view changes which of its pixels shows a vertex and how that pixel's normal is oriented in the world. On a
surface of revolution about the turntable's axis the two effects cancel, and normals leave the angle undetermined. The
disagreement of all pairs of views is approximated by a quadratic in the angles, one Gauss-Newton step (Nocedal and
Wright, Numerical Optimization, 2006, section 10.3), with Geman-McClure weights (Geman and McClure 1987).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.multiview.normal_fusion import FusedNormals
from glint.tasks.algorithms.multiview.view import View

MIN_COMPARED_CONFIDENCE = 0.8
"""Evidence from which normals are compared: extrapolated normals turn with the view and would resist its turning."""
SYSTEMATIC_ERROR_DEG = 1.0
"""Degrees by which the confident normals of a view may be wrong in common."""
MIN_SHARED_VERTICES = 30
"""Vertices that two views must both see for their normals to be compared."""
OUTLIER_ANGLE_DEG = 8.0
"""Degrees between the normals of two views around which a pair of them counts as an outlier."""


@dataclass(frozen=True, slots=True)
class NormalConsistency:
    """Quadratic approximation of the disagreement between all pairs of V views.

    After turning the views by x (V,) degrees, half the squared disagreement in units of the normals' errors is
    x' hessian x / 2 + gradient' x and a constant. hessian (V, V), gradient (V,), float64.
    """

    hessian: np.ndarray
    gradient: np.ndarray

    def residuals(self) -> tuple[np.ndarray, np.ndarray]:
        """Return matrix (V, V) and vector (V,) of residuals, matrix x + vector, whose squares form the quadratic."""
        values, vectors = np.linalg.eigh(self.hessian)
        # A direction in which the normals leave the angles undetermined must not divide by zero.
        root = np.sqrt(np.maximum(values, 1e-6 * max(values[-1], 1.0)))
        return root[:, None] * vectors.T, (vectors.T @ self.gradient) / root


def normal_consistency(
    views: Sequence[View], turned: Sequence[tuple[View, View, float]], vertices: np.ndarray, fused: FusedNormals
) -> NormalConsistency:
    """Measure how the normals of V views agree at the vertices (N, 3) of a model, and how turning changes it.

    turned: by view, the view turned forward and backward, and the degrees between the two; fused: the normals of all
    views at the vertices.
    """
    weights = np.where(fused.evidences >= MIN_COMPARED_CONFIDENCE, fused.evidences, 0.0)
    # Derivatives of the normals with respect to the angle, per degree, by central differences.
    changes = [
        (_normals_at(forward, vertices) - _normals_at(backward, vertices)) / degrees
        for forward, backward, degrees in turned
    ]
    hessian, gradient = np.zeros((len(views), len(views))), np.zeros(len(views))
    for first in range(len(views)):
        for second in range(first):
            shared = np.flatnonzero((weights[first] > 0) & (weights[second] > 0))
            if len(shared) < MIN_SHARED_VERTICES:
                continue
            difference = fused.per_view[first][shared] - fused.per_view[second][shared]
            angle = np.degrees(np.linalg.norm(difference, axis=1))
            weight = np.minimum(weights[first], weights[second])[shared]
            weight = weight / (1.0 + (angle / OUTLIER_ANGLE_DEG) ** 2) ** 2
            # Errors are common to a view, not independent by vertex: a pair of views weighs as one observation.
            weight /= weight.sum() * np.radians(SYSTEMATIC_ERROR_DEG) ** 2
            pair = np.stack([changes[first][shared], -changes[second][shared]])
            hessian[np.ix_([first, second], [first, second])] += np.einsum("anc,bnc,n->ab", pair, pair, weight)
            gradient[[first, second]] += np.einsum("anc,nc,n->a", pair, difference, weight)
    return NormalConsistency(hessian, gradient)


def _normals_at(view: View, points: np.ndarray) -> np.ndarray:
    """Return the normals (N, 3), world, that a view shows at points (N, 3)."""
    return view.to_world(view.normals_at(*view.project(points)))
