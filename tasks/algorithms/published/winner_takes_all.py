"""Winner takes all (Chen, Goesele and Seidel, Mesostructure from Specularity, CVPR 2006): every highlight is accepted.

This is the paper's baseline (section 5): wrong on glass, where most highlights are false, and on opaque objects
no better than the labelling of sheets.
"""

import numpy as np

from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.candidates.markup import Marks, mark_constraints
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.labelling.confidence import field_confidence, field_error_slope, observed_confidence
from glint.tasks.algorithms.labelling.results import (
    FILLED,
    MARKED,
    OBSERVED,
    OUTSIDE,
    SILHOUETTE,
    Iteration,
    Reconstruction,
)
from glint.tasks.algorithms.labelling.weights import DEFAULT_FIELD, FieldWeights
from glint.tasks.algorithms.prior.smooth_normals import ContourField


def reconstruct_winner(
    clusters: Clusters,
    mask: np.ndarray,
    initial: np.ndarray,
    *,
    marks: Marks | None = None,
    field_weights: FieldWeights = DEFAULT_FIELD,
) -> Reconstruction:
    """Take the winner of every observed pixel; fill the remaining pixels from winners and occluding contour.

    Args:
        clusters: candidates of the region; `winner` (H, W, 3), unit, camera frame, NaN where there is none.
        mask: (H, W) bool, the object.
        initial: (H, W, 3) normals from the silhouette, returned unchanged.
        marks: true highlights marked by a user replace the winner.
        field_weights: `rim`, `observed` and `tension_length` of the filling.
    """
    marked, marked_normals, _ = mark_constraints(marks, clusters.normals, mask)
    observed = mask & np.isfinite(clusters.winner[..., 0])
    values = np.where(marked[..., None], marked_normals, np.where(observed[..., None], clusters.winner, np.nan))
    known = marked | observed
    field = ContourField.of(mask, field_weights.tension_length, field_weights.observed, field_weights.rim)
    inradius = inradius_of(mask)
    slope = field_error_slope(lambda kept: field.solve(kept, values), values, inradius)
    confidence = np.where(
        known, observed_confidence(values, inradius), field_confidence(known, field.rim, slope, inradius)
    )
    confidence = np.where(marked, 1.0, confidence)
    labels = np.zeros(clusters.normals.shape[:3], np.uint8)
    labels[0] = observed
    provenance = np.select([~mask, marked, observed, field.rim], [OUTSIDE, MARKED, OBSERVED, SILHOUETTE], FILLED)
    return Reconstruction(
        labels=labels,
        normals=np.where(known[..., None], values, field.solve(known, values)).astype(np.float32),
        initial=initial,
        provenance=provenance.astype(np.uint8),
        confidence=np.where(mask, confidence, np.nan).astype(np.float32),
        iterations=(Iteration(int(known.sum()), int(known.sum())),),
    )
