"""Winner takes all (Chen, Goesele and Seidel, Mesostructure from Specularity, CVPR 2006): every highlight is believed.

Wrong on glass, where most highlights are false, and so the paper's baseline; right on opaque shiny objects, whose
highlights are all on their surface.
"""

import numpy as np

from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.candidates.markup import Marks, mark_constraints
from glint.tasks.algorithms.labelling.confidence import field_confidence, field_growth, observed_confidence
from glint.tasks.algorithms.labelling.reconstruction import (
    FILLED,
    MARKED,
    OBSERVED,
    OUTSIDE,
    SILHOUETTE,
    Reconstruction,
    Round,
)
from glint.tasks.algorithms.prior.smooth_normals import contour_normals, inradius, smooth_normal_field


def reconstruct_winner(
    clusters: Clusters,
    mask: np.ndarray,
    initial: np.ndarray,
    *,
    marks: Marks | None = None,
    rim_weight: float = 1.0,
    normal_weight: float = 0.1,
    tension_length: float = 0.12,
) -> Reconstruction:
    """The winner of every observed pixel; the others are filled from the winners and the rim.

    clusters of the region's (H, W); mask (H, W) bool; initial (H, W, 3); the parameters are those of `rounds`.
    """
    marked, marked_normals, _ = mark_constraints(marks, clusters.normals, mask)
    seen = mask & np.isfinite(clusters.winner[..., 0])
    values = np.where(marked[..., None], marked_normals, np.where(seen[..., None], clusters.winner, np.nan))
    known = marked | seen
    rim, outward = contour_normals(mask)
    surface, scale = smooth_normal_field(mask, tension_length), inradius(mask)

    def field_of(kept: np.ndarray) -> np.ndarray:
        weights = np.where(kept, normal_weight, np.where(rim, rim_weight, 0.0))
        return surface.solve(np.where(kept[..., None], values, outward), weights)

    growth = field_growth(field_of, values, scale)
    sure = np.where(known, observed_confidence(values, scale), field_confidence(known, rim, growth, scale))
    sure = np.where(marked, 1.0, sure)
    labels = np.zeros(clusters.normals.shape[:3], np.uint8)
    labels[0] = seen
    provenance = np.select([~mask, marked, seen, rim], [OUTSIDE, MARKED, OBSERVED, SILHOUETTE], FILLED)
    return Reconstruction(
        labels=labels,
        normals=np.where(known[..., None], values, field_of(known)).astype(np.float32),
        initial=initial,
        provenance=provenance.astype(np.uint8),
        confidence=np.where(mask, sure, np.nan).astype(np.float32),
        rounds=(Round(int(known.sum()), int(known.sum())),),
    )
