"""What normals say of a turntable's angles: two views that look at one place must see one normal there.

Turning a view changes which of its pixels shows a vertex as well as how its normal lies in the world; on a body that is
round about the axis the two cancel and the normals tell nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.multiview.normal_fusion import Fused
from glint.tasks.algorithms.multiview.view import View

SURE = 0.8
"""Confidence from which normals are compared: the smooth field's guesses lean with the view that made them."""
NORMAL_ERROR = 1.0
"""Degrees by which the confident normals of a view may be wrong all alike."""
FEWEST = 30
"""Vertices that two views must see for their normals to be compared."""
DIFFERENT = 8.0
"""Degrees between the normals of two views beyond which one of them is taken to be mistaken."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """Half the squared disagreement of all pairs of views after turning them by x (V,) degrees from where they are, in
    units of the normals' errors: x' curvature x / 2 + slope' x and a constant. curvature (V, V), slope (V,)."""

    curvature: np.ndarray
    slope: np.ndarray

    def residuals(self) -> tuple[np.ndarray, np.ndarray]:
        """Matrix (V, V) and vector (V,) of residuals matrix x + vector with these squares."""
        values, vectors = np.linalg.eigh(self.curvature)
        root = np.sqrt(np.maximum(values, 1e-6 * max(values[-1], 1.0)))
        return root[:, None] * vectors.T, (vectors.T @ self.slope) / root


def agreement(
    views: Sequence[View], turned: Sequence[tuple[View, View, float]], vertices: np.ndarray, fused: Fused
) -> Agreement:
    """How the normals of the views agree on the vertices (N, 3) of a model.

    turned: each view turned ahead and back, and the degrees between the two; fused: what the views say of the vertices.
    """
    weights = np.where(fused.sure >= SURE, fused.sure, 0.0)
    changes = [
        (_normals_at(ahead, vertices) - _normals_at(behind, vertices)) / apart for ahead, behind, apart in turned
    ]
    curvature, slope = np.zeros((len(views), len(views))), np.zeros(len(views))
    for one in range(len(views)):
        for other in range(one):
            both = np.flatnonzero((weights[one] > 0) & (weights[other] > 0))
            if len(both) < FEWEST:
                continue
            left = fused.each[one][both] - fused.each[other][both]
            apart = np.degrees(np.linalg.norm(left, axis=1))
            weight = np.minimum(weights[one], weights[other])[both] / (1.0 + (apart / DIFFERENT) ** 2) ** 2
            weight /= weight.sum() * np.radians(NORMAL_ERROR) ** 2
            pair = np.stack([changes[one][both], -changes[other][both]])
            at = np.ix_([one, other], [one, other])
            curvature[at] += np.einsum("anc,bnc,n->ab", pair, pair, weight)
            slope[[one, other]] += np.einsum("anc,nc,n->a", pair, left, weight)
    return Agreement(curvature, slope)


def _normals_at(view: View, points: np.ndarray) -> np.ndarray:
    """Normals (N, 3) of the world that a view shows at points (N, 3)."""
    return view.to_world(view.normals_at(*view.project(points)))
