"""Alternating reconstruction of one view: label candidate normals, fit the smooth field, repeat until labels settle.

Extends sections 4.1 and 4.2 of the paper, which initialises and labels once. A *sheet* is a smooth surface that
candidates of neighbouring pixels form: one kind of light path (direct reflection, in and out, total reflection) maps
the image smoothly to half vectors, so true and false candidates form different sheets. Each iteration labels whole
sheets by a graph cut against the present field (`graph_cut`), then solves the field again from the accepted normals of
sufficient confidence and the occluding contour (`smooth_normals`). The first field knows the contour alone. If the
converged normals show a surface of revolution, it becomes the expected field and the iterations continue (`symmetry`);
else, if candidates prove a square vessel, a right prism or a faceted body, that one does (`angular_bodies`, `prisms`,
`facets`); else flat faces that candidates prove count as true (`faces.proven_faces`), those that accepted normals show
become part of the field, and the iterations continue likewise (`faces.flat_faces`). Then rejected sheets that may well
be the surface are readmitted (`readmission`) and the iterations continue from them, unless the expected field is given;
what follows is kept if the labels are more likely than before (`explanations`). Without an expected field, the smooth
one is bent away from the lights where nothing flashed (`unreached`), and cut along contours inside the silhouette
(`contour_field`).
"""

from copy import copy
from typing import TYPE_CHECKING

import numpy as np

from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.continuation.contour_field import field_with_contours
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.alternation import Alternation
from glint.tasks.algorithms.labelling.answers import contradictions
from glint.tasks.algorithms.labelling.candidate_view import CandidateView
from glint.tasks.algorithms.labelling.explanations import explain
from glint.tasks.algorithms.labelling.final_confidence import final_confidence
from glint.tasks.algorithms.labelling.results import (
    DETAIL_DEG,
    FILLED,
    MARKED,
    OBSERVED,
    OUTSIDE,
    SILHOUETTE,
    BodyWall,
    Reconstruction,
    blended_normals,
)
from glint.tasks.algorithms.labelling.weights import DEFAULT_OPTIONS, LabellingOptions
from glint.tasks.algorithms.prior.lit_pixels import LitPixels
from glint.tasks.algorithms.prior.swept_normals import SweptNormals
from glint.tasks.algorithms.prior.unreached import unreached_normals

if TYPE_CHECKING:
    from glint.tasks.algorithms.candidates.clusters import Clusters

PLAUSIBLE_NATS = 1.0
"""Evidence of a rejected candidate from which it may be a true highlight."""


def reconstruct_normals(
    clusters: "Clusters",
    mask: np.ndarray,
    options: LabellingOptions = DEFAULT_OPTIONS,
    *,
    marks: Marks | None = None,
    expected: np.ndarray | None = None,
    camera: np.ndarray | None = None,
) -> Reconstruction:
    """Reconstruct the exterior normals of one view from its candidate normals.

    Args:
        clusters: candidates of the region; `normals` (K, H, W, 3), unit, camera frame, NaN where there is none, and
            their `shading`. Under a perspective camera they, and all normals below, are relative to the view rays.
        mask: (H, W) bool, the object.
        options: weights, hypotheses and limits; with expected normals, no other surface is detected or readmitted.
        marks: true and false highlights marked by a user.
        expected: (H, W, 3) normals known beforehand, as from a visual hull, finite in the mask; they replace the
            occluding contour as data of the field.
        camera: (3, 3), the perspective camera's matrix in pixels of the mask; None for parallel rays.

    Raises:
        ValueError: clusters and mask differ in size, or the expected normals have gaps in the mask.
    """
    return conclude(explain(settle(clusters, mask, options, expected=expected, camera=camera)), marks)


def settle(
    clusters: "Clusters",
    mask: np.ndarray,
    options: LabellingOptions = DEFAULT_OPTIONS,
    *,
    expected: np.ndarray | None = None,
    camera: np.ndarray | None = None,
    is_draft: bool = False,
) -> Alternation:
    """Label the candidates until the labels settle: what `explain` goes on from.

    Args:
        is_draft: whether to save time by a coarser field; for the rest see `reconstruct_normals`.

    Raises:
        ValueError: clusters and mask differ in size, or the expected normals have gaps in the mask.
    """
    view = CandidateView.of(clusters, mask, options, camera=camera, is_draft=is_draft)
    if expected is not None and not np.isfinite(expected[mask]).all():
        raise ValueError("the expected normals leave pixels of the mask out")
    state = Alternation(view, options, expected)
    state.iterate()
    return state


def conclude(explained: Alternation, marks: Marks | None = None) -> Reconstruction:
    """Apply marks, and return the result.

    Marks come last, once the labels have settled and are explained: from the start, a single mark could tip sheets that
    it does not lie on, and the surface that explains the rest.

    Args:
        explained: result of `explain`. If it is a draft, so is the result: confidence is that of the accepted normals
            alone, NaN between them.
        marks: true and false highlights marked by a user.
    """
    state = copy(explained)
    if marks is not None:
        state.take_marks(marks)
        is_contradicted = contradictions(state.marks.labels, state.labels).any()
        state.iterate()
        if is_contradicted:
            state = explain(state)
    pixels = _lit_pixels(state) if state.expected is None else None
    if pixels is not None:
        _bend_dark_pixels(state, pixels)
        if state.options.inner_contours and state.faces is None and not state.view.is_draft:
            state.smooth = _with_inner_contours(state, pixels)

    view = state.view
    accepted = np.isfinite(state.confidence)
    provenance = np.select(
        [~view.mask, state.marks.pixels, accepted, view.rim], [OUTSIDE, MARKED, OBSERVED, SILHOUETTE], FILLED
    )
    normals = blended_normals(state.values, state.smooth).astype(np.float32)
    confidence = state.confidence if view.is_draft else final_confidence(state, normals)
    return Reconstruction(
        labels=state.labels.astype(np.uint8),
        normals=normals,
        initial=state.initial,
        provenance=provenance.astype(np.uint8),
        confidence=np.where(view.mask, confidence, np.nan).astype(np.float32),
        iterations=tuple(state.history),
        body_depth=_followed_depth(state, normals),
        wall=_body_wall(state),
    )


def _lit_pixels(state: Alternation) -> LitPixels | None:
    """Return the pixels with an accepted normal of the field, or a rejected one that may well be true.

    None without any candidate.
    """
    view, swept = state.view, SweptNormals.of(state.view.normals)
    if swept is None:
        return None
    # An accepted normal that is too uncertain for the field counts as little as an implausible rejected one.
    evidence = np.where(state.labels | np.isnan(state.evidence), -np.inf, state.evidence).max(axis=0)
    return LitPixels(state.known | (evidence > PLAUSIBLE_NATS), view.mask, view.inradius, swept)


def _bend_dark_pixels(state: Alternation, pixels: LitPixels) -> None:
    """Bend the field away from the lights where pixels are dark."""

    def solve(unreached: np.ndarray) -> np.ndarray:
        bent = copy(state)
        bent.unreached = unreached
        return bent.solve_field(state.known, state.values, faces=state.faces)

    confidence = np.where(state.known, state.confidence, 0.0)
    estimate = unreached_normals(state.smooth, confidence, pixels, solve)
    if estimate is not None:
        state.unreached, state.smooth = estimate


def _with_inner_contours(state: Alternation, pixels: LitPixels) -> np.ndarray:
    """Return the field (H, W, 3), cut along contours inside the silhouette."""
    weights = state.options.field
    return field_with_contours(
        state.smooth,
        state.known_values,
        state.view.normals,
        state.constraints(state.known, state.values),
        pixels,
        dark_weight=weights.unreached,
        tension_length=weights.tension_length,
    )


def _body_wall(state: Alternation) -> BodyWall | None:
    """Return the wall of the surface of revolution that explains the labels; None without."""
    tangents = None if state.body_fit is None else state.body_fit.tangents
    if state.expected is None or tangents is None:
        return None
    return BodyWall(np.where(np.isfinite(tangents), state.expected, np.nan).astype(np.float32), tangents)


def _followed_depth(state: Alternation, normals: np.ndarray) -> np.ndarray | None:
    """Return the depth (H, W) of the body that explains the labels, NaN where normals (H, W, 3) contradict it."""
    if state.body_depth is None or state.expected is None:
        return None
    return np.where(angles(normals, state.expected) < DETAIL_DEG, state.body_depth, np.nan).astype(np.float32)
