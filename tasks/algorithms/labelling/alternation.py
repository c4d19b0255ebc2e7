"""State of the alternation of sections 4.1 and 4.2 of the paper: labels and field, which `reconstruction` drives."""

from dataclasses import dataclass, field, replace

import numpy as np

from glint.tasks.algorithms.candidates.markup import MarkConstraints, Marks, mark_constraints
from glint.tasks.algorithms.faces.flat_faces import FlatFaces
from glint.tasks.algorithms.labelling.answers import MARKED_SHEET_NATS, mark_influence, marked_confidence
from glint.tasks.algorithms.labelling.candidate_view import CandidateView
from glint.tasks.algorithms.labelling.confidence import (
    field_confidence,
    field_error_slope,
    observed_confidence,
    probability_within_tolerance,
)
from glint.tasks.algorithms.labelling.graph_cut import HARD_CONSTRAINT, keep_best_per_pixel, unary_log_ratio
from glint.tasks.algorithms.labelling.results import Iteration, accepted_normals
from glint.tasks.algorithms.labelling.weights import FieldError, LabellingOptions
from glint.tasks.algorithms.prior.smooth_normals import SmoothNormalField
from glint.tasks.algorithms.prior.unreached import with_unreached
from glint.tasks.algorithms.prisms.polyhedron import PolyhedralNormals
from glint.tasks.algorithms.vessels.body_fit import BodyFit

CONVERGED_SHARE = 0.002
"""Share of the mask whose labels may still change in the last iteration."""


@dataclass(slots=True)
class Alternation:
    """State of the alternation: what iterations and explanations replace, beside the view, which stays.

    Methods replace arrays and never change them in place, so a shallow copy can go on by itself; copies share the view.

    expected: (H, W, 3), the expected field, given or that of a body; None without.
    is_given: whether the expected field was given.
    labels: (K, H, W) bool, exterior nodes.
    marks: constraints of the user's marks.
    influence: (K, H, W), of marks on their sheets, see `mark_influence`.
    unmarked_labels: (K, H, W) bool, the labels when the marks were applied.
    own_evidence: (K, H, W) nats, that of the view, less what refuted faces take from it.
    face_evidence: (K, H, W) nats, of faces that candidates prove.
    readmitted: (K, H, W), probability of nodes that were rejected and then readmitted, 0 elsewhere.
    known: (H, W) bool, where accepted normals enter the field.
    values: (H, W, 3), accepted normals, NaN elsewhere.
    confidence: (H, W), that of accepted normals, NaN elsewhere.
    initial, smooth: (H, W, 3), first and present field.
    faces: flat faces of the field, if any.
    relief_fit: of the expected surface of revolution, 0 without relief.
    body_depth: (H, W), depth of the body that has the expected field, if there is one.
    body_fit: how well a surface of revolution or square vessel that has it explains candidates; None for any other.
    solid: the prism or faceted body that has the expected field, if it is one.
    seen_through: (K, H, W) bool, candidates that are seen through the faces of the solid.
    unreached: (H, W, 3), normals of dark pixels, NaN elsewhere.
    history: the iterations so far.
    """

    view: CandidateView
    options: LabellingOptions
    expected: np.ndarray | None = None
    is_given: bool = field(init=False)
    labels: np.ndarray = field(init=False)
    marks: MarkConstraints = field(init=False)
    influence: np.ndarray = field(init=False)
    unmarked_labels: np.ndarray = field(init=False)
    own_evidence: np.ndarray = field(init=False)
    face_evidence: np.ndarray = field(init=False)
    readmitted: np.ndarray = field(init=False)
    known: np.ndarray = field(init=False)
    values: np.ndarray = field(init=False)
    confidence: np.ndarray = field(init=False)
    initial: np.ndarray = field(init=False)
    smooth: np.ndarray = field(init=False)
    faces: FlatFaces | None = None
    relief_fit: float = 0.0
    body_depth: np.ndarray | None = None
    body_fit: BodyFit | None = None
    solid: PolyhedralNormals | None = None
    seen_through: np.ndarray = field(init=False)
    unreached: np.ndarray | None = None
    history: list[Iteration] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Solve the field once from the contour, or the expected normals."""
        nodes = self.view.normals.shape[:3]
        self.is_given = self.expected is not None
        self.own_evidence = self.view.evidence
        self.face_evidence, self.readmitted = np.zeros((2, *nodes))
        self.labels, self.seen_through = np.zeros((2, *nodes), dtype=bool)
        self.take_marks(None)
        self.forget_labels()
        self.smooth = self.initial = self.solve_field(self.known, self.values)

    def take_marks(self, marks: Marks | None) -> None:
        """Apply these marks from now on, instead of earlier ones; each confirms or contradicts its node's label."""
        self.unmarked_labels = self.labels
        self.marks = mark_constraints(marks, self.view.normals, self.view.mask, self.labels)
        self.influence = mark_influence(*self.view.sheets, self.marks.labels, self.view.inradius, self.labels)

    @property
    def evidence(self) -> np.ndarray:
        """Log-likelihood ratio (K, H, W) of a true against a false highlight, by all evidence but the field, nats."""
        return self.own_evidence + self.face_evidence + MARKED_SHEET_NATS * self.influence

    @property
    def known_values(self) -> np.ndarray:
        """Accepted normals (H, W, 3) that enter the field, NaN elsewhere."""
        return np.where(self.known[..., None], self.values, np.nan)

    def solve_field(
        self,
        known: np.ndarray,
        values: np.ndarray,
        surface: SmoothNormalField | None = None,
        faces: FlatFaces | None = None,
    ) -> np.ndarray:
        """Solve the field (H, W, 3) from its data, see `constraints`, and from dark pixels and flat faces.

        known: (H, W) bool, pixels with data; values: (H, W, 3), their normals; surface: the interpolant, None for that
        of the view.
        """
        targets, pull = self.constraints(known, values)
        if self.unreached is not None:
            targets, pull = with_unreached(targets, pull, self.unreached, self.options.field.unreached)
        if faces is not None:
            targets, pull = faces.constrain(targets, pull, known, self.marks.pixels)
        return (surface or self.view.surface).solve(targets, pull, self.expected)

    def constraints(self, known: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the field's targets (H, W, 3) and weights (H, W): `values` at `known` pixels, elsewhere the contour.

        An expected field takes the place of the contour. That of a body with a `body_fit` also counts beside what was
        observed, the more the better it explains the candidates: a false sheet must not bend the field that judges it.
        """
        weights, fit = self.options.field, self.body_fit
        if self.expected is None:
            targets, pull = self.view.outward, np.where(self.view.rim, weights.rim, 0.0)
        else:
            precision = 1.0 if fit is None else fit.precision
            targets, pull = self.expected, np.full(self.view.mask.shape, weights.expected * precision)
        # A mark says which sheet is true, not how exact it is: only what was rejected before it must bend the field.
        is_newly_exterior = self.labels & ~self.unmarked_labels
        influence = np.where(is_newly_exterior, self.influence, 0.0).max(axis=0, initial=0.0)
        measured = weights.observed + (weights.marked - weights.observed) * influence
        measured = np.where(self.marks.pixels & known & ~self.labels.any(axis=0), weights.mark_alone, measured)
        if fit is None:
            return np.where(known[..., None], values, targets), np.where(known, measured, pull)
        beside = weights.observed * fit.trust
        share = (measured / (measured + beside))[..., None]
        targets = np.where(known[..., None], share * values + (1.0 - share) * targets, targets)
        return targets, np.where(known, measured + beside, pull)

    def iterate(self, max_iterations: int | None = None) -> None:
        """Alternate labelling and field until the labels settle, or swing between two states.

        max_iterations: None for that of the options.
        """
        settled, before_last = CONVERGED_SHARE * self.view.mask.sum(), None
        for _ in range(self.options.max_iterations if max_iterations is None else max_iterations):
            last = self.labels
            changed = self.label()
            self.follow_labels()
            self.history = [*self.history, Iteration(int(self.labels.any(axis=0).sum()), changed)]
            if changed <= settled or (before_last is not None and self._changed_pixels(before_last) <= settled):
                break
            before_last = last

    def follow_labels(self) -> None:
        """Replace accepted normals, their confidence and the field by those of the present labels."""
        self.values = accepted_normals(self.view.normals, self.labels, self.marks.normals)
        readmitted = np.where(self.labels, self.readmitted, 0.0).max(axis=0, initial=0.0)
        self.confidence = self.with_marks(np.maximum(observed_confidence(self.values, self.view.inradius), readmitted))
        self.known = self.confidence >= self.options.min_confidence
        self.smooth = self.solve_field(self.known, self.values, faces=self.faces)

    def with_marks(self, confidence: np.ndarray) -> np.ndarray:
        """Return the confidence (H, W) of accepted normals, raised where a true mark lies on their sheet."""
        return marked_confidence(confidence, self.marks.pixels, np.where(self.labels, self.influence, 0.0).max(axis=0))

    def label(self) -> int:
        """Label all nodes against the present field; return the number of pixels whose labels changed."""
        ratios, previous = self.log_ratios(), self.labels
        self.labels = keep_best_per_pixel(self.view.graph.cut(ratios), ratios)
        return self._changed_pixels(previous)

    def _changed_pixels(self, labels: np.ndarray) -> int:
        """Return the number of pixels whose labels differ from earlier ones (K, H, W)."""
        return int((labels != self.labels).any(axis=0).sum())

    def log_likelihood(self) -> float:
        """Return how likely the present field makes the present exterior nodes: their summed log-likelihood ratio."""
        return float(np.where(self.labels, self.log_ratios(), 0.0).sum())

    def log_ratios(self) -> np.ndarray:
        """Compute the nodes' log-likelihood ratios (K, H, W), nats, under the present field."""
        observed = self.known & self.labels.any(axis=0)
        if self.faces is not None:
            observed |= self.faces.observed
        # The field is trusted near what shaped it: the contour too, unless expected normals took its place.
        sources = observed if self.expected is not None else self.view.rim | observed
        spread = self._field_error.spread(sources, self.view.thickness)
        ratios = unary_log_ratio(self.view.normals, self.smooth, spread, self.options.graph_cut.prior) + self.evidence
        return (
            np.where(self.marks.labels != 0, self.marks.labels * HARD_CONSTRAINT, ratios)
            if self.marks.labels.any()
            else ratios
        )

    @property
    def _field_error(self) -> FieldError:
        """Error model of the field: about a body with a `body_fit`, candidates scatter less than about a smooth one."""
        error = self.options.field_error
        return error if self.body_fit is None else replace(error, floor=self.body_fit.scatter_deg)

    def readmit(self, probability: np.ndarray) -> None:
        """Accept rejected nodes of this probability (K, H, W), 0 for all others, and let the field follow them."""
        chosen = probability > 0.0
        self.readmitted = np.where(chosen, probability, self.readmitted)
        self.labels = np.where(chosen.any(axis=0), chosen, self.labels)
        self.unreached = None
        self.follow_labels()

    def expect(self, normals: np.ndarray, depth: np.ndarray | None, fit: BodyFit | None = None) -> None:
        """Make normals (H, W, 3) the expected field.

        depth: (H, W), of the body that has them; fit: of a surface of revolution without a relief, or a square vessel.
        """
        self.expected, self.body_depth, self.body_fit = normals, depth, fit
        self.smooth = self.solve_field(self.known, self.values)

    def forget_labels(self) -> None:
        """Start again from nothing but marks: the next labels follow the field alone."""
        self.labels = np.zeros(self.view.normals.shape[:3], dtype=bool)
        self.known, self.values = self.marks.pixels, self.marks.normals
        self.confidence = np.full(self.view.mask.shape, np.nan)

    def field_confidence(self, known: np.ndarray) -> np.ndarray:
        """Return the confidence (H, W) of the field and its faces, for `known` pixels (H, W) that can be trusted."""
        accepted = self.known_values
        slope = field_error_slope(
            lambda kept: self.solve_field(kept, self.values, self.view.coarse), accepted, self.view.inradius
        )
        between = field_confidence(known, self.view.rim, slope, self.view.inradius)
        if self.faces is None:
            return between
        return np.where(np.isfinite(self.faces.spread), probability_within_tolerance(self.faces.spread), between)
