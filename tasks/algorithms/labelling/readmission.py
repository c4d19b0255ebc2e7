"""Rejected sheets that may well be the surface: readmitted, so that the field can show what follows from them.

The alternation settles where labels and field confirm each other, which need not be the best labels: the silhouette
says nothing of a limb in front of the body, and once its sheet is rejected, the field never follows it. But how far the
field can be trusted at a place is known, and so is the sheet's own evidence; together they give the probability that
the sheet is the surface. The paper has no such step; see `reconstruction`.
"""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.labelling.alternation import Alternation
from glint.tasks.algorithms.labelling.confidence import TOLERANCE_RAD
from glint.tasks.algorithms.labelling.graph_cut import OBSERVABLE_SOLID_ANGLE, keep_best_per_pixel
from glint.tasks.algorithms.labelling.results import blended_normals
from glint.tasks.algorithms.sheets.patches import Patches, cut_patches

READMITTED_PROBABILITY = 0.2
"""Probability of being the surface from which a rejected sheet is readmitted: a false one mostly is rejected again."""
LIT_SHARE_POWER = -1.5
"""Power, in the odds that a rejected candidate is the surface, of the number of frames in which its pixel is lit,
relative to the median: where light crosses the glass along many paths, most highlights are false (fitted to presets, as
the next two)."""
SLANT_NATS_PER_DEG = 0.1
"""Rise of the log-odds with the candidate's slant: the field is right where the surface faces the camera."""
REJECTED_NATS = -4.0
"""Log-odds of a rejected candidate that faces the camera, before its evidence."""
CONFIDENCE_RANGE, EXTERIOR_SHARE_RANGE = (0.01, 0.99), (0.1, 0.9)
"""Bounds of the confidence in a normal, and of the share of exterior nodes, in odds: nothing is certain."""
WRONG_SPREAD_RAD = np.radians(25.0)
"""Standard deviation per axis of the error of normals that are not within the tolerance, radians."""


@dataclass(frozen=True, slots=True)
class LabelledCandidates:
    """Candidates as they were labelled, and what speaks for each.

    normals (K, H, W, 3): unit, camera frame, NaN without cluster. labels (K, H, W): nonzero = exterior. evidence (K, H,
    W): of shape and shading, and of marks and refuted faces where there are any, nats. observations (H, W): number of
    frames in which a pixel is lit.
    """

    normals: np.ndarray
    labels: np.ndarray
    evidence: np.ndarray
    observations: np.ndarray


def plausible_sheets(state: Alternation) -> np.ndarray:
    """Find rejected sheets, none readmitted before, that contradict the present normals and may well be the surface.

    Returns:
        (K, H, W) their probability, at most at one node of a pixel, 0 elsewhere.
    """
    view, result = state.view, np.zeros(state.labels.shape)
    patches = cut_patches(*view.sheets, state.labels, view.inradius)
    if patches.count == 0:
        return result
    normals = blended_normals(state.values, state.smooth)
    confidence = np.where(np.isfinite(state.confidence), state.confidence, state.field_confidence(state.known))
    candidates = LabelledCandidates(view.normals, state.labels, state.evidence, view.observations)
    probability = surface_probability(patches, candidates, normals, confidence)
    angle = np.radians(patches.mean(patches.angles_to(view.normals, normals)))
    probability[patches.exterior(state.labels) | (angle < TOLERANCE_RAD) | (probability < READMITTED_PROBABILITY)] = 0.0
    result[patches.layer, patches.row, patches.column] = probability[patches.number]
    result[state.readmitted > 0.0] = 0.0
    return np.where(keep_best_per_pixel(result > 0.0, result), result, 0.0)


def surface_probability(
    patches: Patches, candidates: LabelledCandidates, normals: np.ndarray, confidence: np.ndarray
) -> np.ndarray:
    """Return the probability (count,) that a patch of rejected candidates is the surface.

    It can be only where the present normal is wrong: its log-likelihood ratio is that of the labelling
    (`graph_cut.unary_log_ratio`), but with the spread that the confidence implies. Nodes of a sheet share their errors,
    so that ratios are averaged.

    Args:
        patches: of the candidates.
        candidates: all of the view.
        normals: (H, W, 3) unit, camera frame, the present normals.
        confidence: (H, W) probability that they are right.
    """
    confidence = np.clip(confidence[patches.row, patches.column], *CONFIDENCE_RANGE)
    # The present normal is right within the tolerance with its confidence; else it says little, but not nothing.
    angle = np.radians(patches.angles_to(candidates.normals, normals))
    likelihood = confidence * _angular_density(angle, TOLERANCE_RAD / 2.0)
    likelihood += (1.0 - confidence) * _angular_density(angle, WRONG_SPREAD_RAD)
    ratio = np.log(OBSERVABLE_SOLID_ANGLE * np.maximum(likelihood, 1e-30))
    share = np.clip((patches.of(candidates.labels) > 0).mean(), *EXTERIOR_SHARE_RANGE)
    ratio += np.log(share / (1.0 - share)) + patches.of(candidates.evidence)
    lit = np.maximum(patches.mean(candidates.observations[patches.row, patches.column].astype(float)), 1.0)
    slant = np.degrees(np.arccos(np.clip(patches.mean(patches.of(candidates.normals)[:, 2]), -1.0, 1.0)))
    nats = patches.mean(ratio) + LIT_SHARE_POWER * np.log(lit / np.median(lit)) + SLANT_NATS_PER_DEG * slant
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(nats + REJECTED_NATS, -50.0, 50.0))))


def _angular_density(angle: np.ndarray, spread: float) -> np.ndarray:
    """Return the density per steradian of normals at `angle` from the expected one; both in radians."""
    return np.asarray(np.exp(-(angle**2) / (2.0 * spread**2)) / (2.0 * np.pi * spread**2))
