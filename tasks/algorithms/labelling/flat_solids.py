"""Solids of flat faces, and square vessels, as explanations of labels: which of them candidates show.

Confident normals may refute them.
"""

from operator import itemgetter

import numpy as np

from glint.tasks.algorithms.continuation.inner_contours import has_candidate
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.alternation import Alternation
from glint.tasks.algorithms.labelling.final_confidence import final_confidence
from glint.tasks.algorithms.labelling.results import CONFIDENT, blended_normals
from glint.tasks.algorithms.prisms.polyhedron import PolyhedralNormals
from glint.tasks.algorithms.revolution.symmetry import RotationalNormals

MIN_SOLID_NATS, CONTRADICTED_NATS = 10.0, 50.0
"""Evidence for a prism or a faceted body from which it is adopted, and how much more it takes if accepted normals all
over the mask contradict it, as those of what is seen through its faces do."""
CONTRADICTED_DEG = 6.0
"""Angle from which an accepted normal contradicts a solid, and up to which a surface explains a candidate."""
MIN_EXPLAINED_RATIO = 0.65
"""Pixels with a candidate that a solid explains, relative to the field's: 0.73 or more on solids, 0.59 on domes."""
MIN_ROUNDED_RATIO = 0.2
"""Pixels with a candidate that a rounded prism explains, relative to another surface's: where only its edges show the
light, 0.3 or more on blocks, and 0.08 at most on cylinders."""
MAX_DOUBTED_SHARE, MIN_VESSEL_GAIN = 0.45, 1.08
"""Pixels with a candidate that a surface of revolution explains, as a share of all, from which no vessel of another
section is looked for; and those that such a vessel explains relative to another shape: 1.1 or more on vessels, up to
1.05 on solid blocks, whose far walls may be taken for those of an opening."""
SAME_SOLID_DEG = 8.0
"""Mean angle between two solids up to which they are the same."""
MAX_CONTRADICTED_SHARE, MIN_REFUTED_SHARE = 0.3, 0.05
"""Share of a solid's face that confident normals may contradict, and share of the mask from which a face is checked."""


def likely_solids(state: Alternation) -> list[PolyhedralNormals]:
    """Return the solids that candidates show, likeliest first, if they outweigh accepted normals that contradict them.

    A rounded prism comes before another solid that explains no more candidates, and after one that does.
    """
    solids, rounded = _sharp_solids(state), state.view.rounded.best
    if rounded is None or not is_rounded_prism(blended_normals(state.values, state.smooth), state):
        return solids
    is_second = bool(solids) and _explained(solids[0].normals, state) > _explained(rounded.normals, state)
    return [*solids[:is_second], rounded, *solids[is_second:]]


def is_rounded_prism(normals: np.ndarray, state: Alternation) -> bool:
    """Return whether candidates show a rounded prism that explains not far fewer of them than normals (H, W, 3)."""
    rounded = state.view.rounded.best
    if rounded is None or _margin(rounded, state) < 0.0:
        return False
    return _explained(rounded.normals, state) >= MIN_ROUNDED_RATIO * _explained(normals, state)


def is_angular_vessel(normals: np.ndarray, state: Alternation) -> bool:
    """Return whether normals (H, W, 3) explain few candidates, and a square or rectangular vessel more."""
    view, explained = state.view, _explained(normals, state)
    if explained > MAX_DOUBTED_SHARE * np.isfinite(view.normals[..., 0]).any(axis=0).sum():
        return False
    vessel = view.angular.best
    return vessel is not None and _explained(vessel.normals, state) > MIN_VESSEL_GAIN * explained


def likely_vessel(solids: list[PolyhedralNormals], state: Alternation) -> RotationalNormals | None:
    """Return the square or rectangular vessel that candidates show, and none of the likely solids; None without."""
    vessel = state.view.angular.best
    if vessel is None:
        return None
    explained = _explained(vessel.normals, state)
    if explained < MIN_EXPLAINED_RATIO * _explained(blended_normals(state.values, state.smooth), state):
        return None
    return vessel if all(explained > MIN_VESSEL_GAIN * _explained(solid.normals, state) for solid in solids) else None


def _sharp_solids(state: Alternation) -> list[PolyhedralNormals]:
    """Return the solids with sharp edges that candidates show, likeliest first.

    They explain nearly as many candidates as the smooth field; a dome's facets do so near their middles alone. Those of
    rounded edges lie where only such edges have them, and need not.
    """
    view, prism = state.view, state.view.prism.best
    weighed = [(_margin(solid, state), solid) for solid in (*view.facets.likeliest, prism) if solid is not None]
    likely = [solid for nats, solid in sorted(weighed, key=itemgetter(0), reverse=True) if nats >= 0.0]
    if not likely:
        return []
    least = MIN_EXPLAINED_RATIO * _explained(blended_normals(state.values, state.smooth), state)
    solids = [solid for solid in likely if _explained(solid.normals, state) >= least]
    prism = next((solid for solid in solids if solid is prism), None)
    # Of the same solid, the lines of its contour place a prism more exactly.
    if prism is not None and angles(prism.normals, solids[0].normals)[view.mask].mean() < SAME_SOLID_DEG:
        return [prism, *(solid for solid in solids if solid is not prism)]
    return solids


def _explained(normals: np.ndarray, state: Alternation) -> int:
    """Return how many pixels have a candidate near normals (H, W, 3)."""
    return int(has_candidate(state.view.normals, normals, CONTRADICTED_DEG).sum())


def _margin(solid: PolyhedralNormals, state: Alternation) -> float:
    """Return how much more candidates speak for a solid than they must, nats."""
    contradicted = state.known & (angles(state.values, solid.normals) > CONTRADICTED_DEG)
    return float(solid.log_ratio - MIN_SOLID_NATS - CONTRADICTED_NATS * contradicted.sum() / state.view.mask.sum())


def first_unrefuted(solids: list[PolyhedralNormals], state: Alternation) -> PolyhedralNormals | None:
    """Return the first solid none of whose faces confident normals largely contradict, as they do if an end is wrong.

    state: explained by flat faces, if there are any.
    """
    if not solids:
        return None
    mask, normals = state.view.mask, blended_normals(state.values, state.smooth)
    is_confident = final_confidence(state, normals) >= CONFIDENT

    def is_refuted(solid: PolyhedralNormals) -> bool:
        contradicted = is_confident & (angles(normals, solid.normals) > CONTRADICTED_DEG)
        faces = (pixels for pixels in solid.faces_in(mask) if pixels.sum() >= MIN_REFUTED_SHARE * mask.sum())
        return any(contradicted[pixels].mean() > MAX_CONTRADICTED_SHARE for pixels in faces)

    return next((solid for solid in solids if not is_refuted(solid)), None)
