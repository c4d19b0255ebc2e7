"""Options of the alternating reconstruction: the weights of its terms, the hypotheses it may adopt, and its limits.

The paper states no weights; the defaults were chosen on simulated captures.
"""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.geometry.distance import distance_inside


@dataclass(frozen=True, slots=True)
class GraphCutWeights:
    """Terms of the graph cut's energy (see `graph_cut` and `integrability`).

    strength: cost in nats of labelling two identical neighbours differently; contrast: difference of unit normals at
    which that cost has fallen to 1/e; prior: share of the nodes that are exterior; shape_weight, shading_weight:
    factors of the log-likelihood ratios of the integrability and convexity prior and of the shading.
    """

    strength: float = 10.0
    contrast: float = 0.1
    prior: float = 0.5
    shape_weight: float = 1.0
    shading_weight: float = 1.0


@dataclass(frozen=True, slots=True)
class FieldWeights:
    """Data terms of the smooth normal field (see `smooth_normals`), as weights of a squared difference per pixel.

    rim: a pixel of the occluding contour; observed: an accepted normal; marked: one that was rejected before it was
    marked as true; mark_alone: a marked pixel without an accepted cluster, which must hold against its neighbours;
    expected: an expected normal; unreached: a dark pixel (see `unreached`). tension_length: distance from any data, in
    inradii, beyond which the thin plate becomes a membrane.
    """

    rim: float = 1.0
    observed: float = 0.1
    marked: float = 0.5
    mark_alone: float = 10.0
    expected: float = 0.03
    unreached: float = 0.05
    tension_length: float = 0.12


@dataclass(frozen=True, slots=True)
class FieldError:
    """Error model of the smooth field: its standard deviation in degrees, linear in the distance from known pixels.

    floor: at a known pixel; slope: added per local thickness of the object; ceiling: upper bound, since the field is
    smooth and not arbitrary.
    """

    floor: float = 4.0
    slope: float = 25.0
    ceiling: float = 30.0

    def spread(self, known: np.ndarray, thickness: np.ndarray | float) -> np.ndarray:
        """Return the standard deviation (H, W) in radians.

        known: (H, W) bool, pixels with a known normal; thickness: of the object, in pixels, (H, W) or one for all.
        """
        if not known.any():
            return np.full(known.shape, np.radians(self.ceiling))
        distance = distance_inside(~known)
        spread = np.minimum(self.floor + self.slope * distance / np.maximum(thickness, 1.0), self.ceiling)
        return np.asarray(np.radians(spread))


MIN_FIELD_CONFIDENCE = 0.5
"""Confidence from which accepted normals enter the field."""
DEFAULT_FIELD = FieldWeights()


@dataclass(frozen=True, slots=True)
class LabellingOptions:
    """What a reconstruction weighs, which hypotheses it may adopt, and when it ends.

    graph_cut, field, field_error: its weights. symmetry: whether a surface of revolution may be detected and become the
    expected field; flat_faces: whether a square vessel, a right prism, a faceted body or flat faces may be detected;
    readmission: whether rejected sheets may be readmitted. inner_contours: whether the field may be cut along contours
    inside the silhouette. min_confidence: accepted normals of lower confidence do not enter the field. max_iterations:
    limit each time that labels settle: at first, and again after whatever is detected, readmitted or marked.
    """

    graph_cut: GraphCutWeights = GraphCutWeights()
    field: FieldWeights = DEFAULT_FIELD
    field_error: FieldError = FieldError()
    symmetry: bool = True
    flat_faces: bool = True
    readmission: bool = True
    inner_contours: bool = True
    min_confidence: float = MIN_FIELD_CONFIDENCE
    max_iterations: int = 10


DEFAULT_OPTIONS = LabellingOptions()
