"""Explanations of settled labels: a surface of revolution, a square vessel, a solid of flat faces, single faces.

Each explanation that is adopted changes the expected field or the evidence, and the alternation goes on from there; so
does each readmission of rejected sheets. The functions `_with_..` change the state that they are given; only the one
that they return is to be used afterwards.
"""

from copy import copy

import numpy as np

from glint.tasks.algorithms.faces.flat_faces import APPARENT_DEG, flat_faces, has_other_faces
from glint.tasks.algorithms.faces.proven_faces import face_evidence
from glint.tasks.algorithms.geometry.distance import distance_inside
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.alternation import Alternation
from glint.tasks.algorithms.labelling.flat_solids import (
    CONTRADICTED_DEG,
    first_unrefuted,
    is_angular_vessel,
    is_rounded_prism,
    likely_solids,
    likely_vessel,
)
from glint.tasks.algorithms.labelling.readmission import plausible_sheets
from glint.tasks.algorithms.labelling.results import exterior_values
from glint.tasks.algorithms.prisms.polyhedron import PolyhedralNormals
from glint.tasks.algorithms.revolution.symmetry import RotationalNormals
from glint.tasks.algorithms.vessels.body_fit import body_fit

MIN_KNOWN_SHARE = 0.05
"""Share of the mask that enters the field from which labels have a start of their own."""
MAX_READMISSIONS = 3
"""Rounds in which rejected sheets are readmitted: each may show the field of the next."""
MAX_ROUND_ERROR_DEG, MIN_RELIEF_NATS = 6.0, 40.0
"""Mean angle between accepted normals and a surface of revolution without its relief from which that relief may in fact
be facets, and evidence for a faceted body from which it is."""
MIN_SEEN_SHARE, MAX_SEEN_THROUGH, ROUNDED_INRADII = 0.05, 0.5, 0.1
"""Share of a solid's face that accepted normals must cover, and share of these that may contradict it, for all else on
it to count as seen through; distance from its edges, which are rounded, in inradii of the mask."""
MAX_REFUTATIONS = 3
"""Rounds in which flat faces are looked for, and false ones refuted."""
REFUTED_NATS = 10.0
"""What a refuted face takes from the evidence of its candidates."""


def explain(settled: Alternation) -> Alternation:
    """Explain labels that have settled by a surface that they show, and readmit plausible sheets."""
    if settled.is_given:
        return settled  # The expected normals explain the labels already.
    state = explained = _with_surface(copy(settled))
    for _ in range(MAX_READMISSIONS if state.options.readmission else 0):
        better = _readmitted(state)
        if better is None:
            break
        state = better
    # The readmitted may show what the others did not.
    return state if state is explained or state.expected is not None else _with_surface(state)


def _with_surface(state: Alternation) -> Alternation:
    """Return the state with a surface of revolution, else with flat faces, if there are any and none is known yet.

    What shows neither may still be likelier to be a surface of revolution than smooth.
    """
    symmetric = _with_symmetry(state) if state.expected is None and state.options.symmetry else None
    if symmetric is not None:
        state = symmetric
        state.iterate()
    elif state.expected is None and state.options.flat_faces:
        state = _with_faces(state)
    if state.expected is None and state.options.symmetry and state.faces is None and not state.face_evidence.any():
        state = _with_unproven_symmetry(state)
    if state.relief_fit > 0.0 and _adopt_symmetry(state):
        # Highlights that a relief explains show more of it.
        state.iterate()
    return state


def _with_faces(state: Alternation) -> Alternation:
    """Return the state with a square vessel, right prism or faceted body, else with flat faces, if there are any."""
    view, start, solids = state.view, copy(state), likely_solids(state)
    vessel = likely_vessel(solids, state)
    if vessel is not None:
        return _with_vessel(state, vessel)
    if not state.face_evidence.any():
        state.face_evidence = face_evidence(view.normals, view.mask, view.inradius, view.camera)
        if state.face_evidence.any():
            state.iterate()
    if _adopt_faces(state):
        state.iterate()
    solid = first_unrefuted(solids, state)
    return state if solid is None else _with_solid(start, solid)


def _with_vessel(state: Alternation, vessel: RotationalNormals) -> Alternation:
    """Return the state whose expected field is a vessel that candidates show; labels start again from it."""
    view = state.view
    state.forget_labels()
    state.expect(vessel.normals, vessel.depths, body_fit(vessel, view.normals, view.mask, view.inradius))
    state.iterate()
    return state


def _with_symmetry(state: Alternation) -> Alternation | None:
    """Return the state whose expected field is a surface of revolution, None if accepted normals support none.

    The field of a shallow bowl's silhouette on its stem contradicts all that is seen of it: where labels accept next to
    nothing, they start from the surface that the candidates show. Accepted normals then decide as always.
    """
    view = state.view
    has_start = state.known[view.mask].mean() >= MIN_KNOWN_SHARE
    normals = None if has_start else view.symmetry.supposed_normals(view.normals)
    if normals is not None:
        supposed = copy(state)
        supposed.expect(normals, None)
        supposed.iterate()
        if _adopt_symmetry(supposed):
            return supposed
    return state if _adopt_symmetry(state) else None


def _with_unproven_symmetry(state: Alternation) -> Alternation:
    """Return the state whose expected field is a surface of revolution, if that fits what was observed better.

    What the smooth field accepts of a fine relief shows neither that nor the surface below. Labels that follow it may.
    """
    normals = state.view.symmetry.unproven_normals(state.known_values, state.view.normals, state.initial)
    if normals is not None:
        state.expect(normals, None)
        state.iterate()
        if _adopt_symmetry(state):
            state.iterate()
    return state


def _adopt_symmetry(state: Alternation) -> bool:
    """Make a surface of revolution the expected field if accepted normals support it; return whether they do."""
    view, accepted = state.view, state.known_values
    rotational = view.symmetry.normals(accepted, view.normals, state.initial)
    if rotational is None or rotational.relief_fit < state.relief_fit:
        return False
    if state.options.flat_faces and is_angular_vessel(rotational.normals, state):
        return False
    if state.options.flat_faces and is_rounded_prism(rotational.normals, state):
        return False  # A block seen along an edge can have the silhouette of a body of revolution.
    lights = exterior_values(view.weights, state.labels)
    if has_other_faces(rotational.normals, accepted, lights, view.mask, view.inradius):
        return False  # A prism seen from its front has the silhouette of a cylinder, which has no flat faces.
    if rotational.relief_fit > 0.0 and rotational.round_error > MAX_ROUND_ERROR_DEG and _is_faceted(state):
        return False
    state.relief_fit = rotational.relief_fit
    fit = None if rotational.relief_fit > 0.0 else body_fit(rotational, view.normals, view.mask, view.inradius)
    state.expect(rotational.normals, rotational.depths, fit)
    return True


def _is_faceted(state: Alternation) -> bool:
    """Return whether candidates show facets so well that a relief, whose periods they are, does not explain them."""
    solids = state.view.facets.likeliest if state.options.flat_faces else []
    return bool(solids) and solids[0].log_ratio >= MIN_RELIEF_NATS


def _with_solid(state: Alternation, solid: PolyhedralNormals) -> Alternation:
    """Return the state whose expected field is a solid of flat faces.

    Labels start again from it: what was accepted before may be no more than what is seen through its faces.
    """
    state.forget_labels()
    state.solid = solid
    state.expect(solid.normals, solid.depths)
    state.iterate()
    state.seen_through = _seen_through(state, solid)
    if state.seen_through.any():
        state.own_evidence = state.own_evidence - REFUTED_NATS * state.seen_through
        state.iterate()
    return state


def _seen_through(state: Alternation, solid: PolyhedralNormals) -> np.ndarray:
    """Return the candidates (K, H, W) bool that contradict a face which most accepted normals on it confirm as flat."""
    view, contradicted = state.view, angles(state.values, solid.normals) > CONTRADICTED_DEG
    is_flat = np.zeros(view.mask.shape, bool)
    for pixels in solid.faces_in(view.mask):
        known = pixels & state.known
        is_shown = known.sum() >= max(MIN_SEEN_SHARE * pixels.sum(), 1.0)
        if is_shown and contradicted[known].mean() < MAX_SEEN_THROUGH:
            is_flat |= distance_inside(pixels) > ROUNDED_INRADII * view.inradius
    return is_flat & (angles(view.normals, solid.normals[None]) > CONTRADICTED_DEG)


def _adopt_faces(state: Alternation) -> bool:
    """Make flat faces part of the field if accepted normals show any; return whether field or evidence changed."""
    view = state.view
    for number in range(MAX_REFUTATIONS):
        lights = exterior_values(view.weights, state.labels)
        state.faces = flat_faces(state.known_values, lights, view.normals, state.smooth, view.mask, view.inradius)
        if state.faces is not None or number > 0:
            state.smooth = state.solve_field(state.known, state.values, faces=state.faces)
        if state.faces is None:
            return number > 0
        false = angles(view.normals, state.faces.refuted[None]) < APPARENT_DEG
        if not false.any():
            break
        # What a false face hid may be another one.
        state.own_evidence = state.own_evidence - REFUTED_NATS * false
        state.iterate(1)
    return True


def _readmitted(state: Alternation) -> Alternation | None:
    """Return what follows from readmitting plausible sheets, None if there are none or labels become less likely."""
    probability = plausible_sheets(state)
    if not probability.any():
        return None
    after = copy(state)
    after.readmit(probability)
    # The readmitted are not held: a false sheet that the field no longer needs to contradict is rejected again.
    after.iterate()
    return after if after.log_likelihood() > state.log_likelihood() else None
