"""Rounds of labelling and re-interpolation: from clusters and silhouette to normals (METHOD 4, 6 and "Sheets").

Each round labels sheets against the present field, then interpolates the field afresh from the accepted normals that
can be believed and the rim. The first field knows the rim alone; the rounds end when the labels stand still. If what
they found shows a turned object, they go on with its body as the expected field: see `symmetry`.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from glint.tasks.algorithms.candidates.markup import Marks, mark_constraints
from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.labelling.confidence import (
    field_confidence,
    field_growth,
    observed_confidence,
    sheet_confidence,
)
from glint.tasks.algorithms.labelling.graph_cut import CERTAIN, evidence, label_sheets, one_per_pixel
from glint.tasks.algorithms.labelling.integrability import shape_evidence
from glint.tasks.algorithms.labelling.segments import connected_sheets, sheet_means, surprise
from glint.tasks.algorithms.prior.smooth_normals import (
    SmoothNormalField,
    contour_normals,
    field_spread,
    inradius,
    smooth_normal_field,
    thickness,
)
from glint.tasks.algorithms.prior.symmetry import surface_of_revolution_normals

if TYPE_CHECKING:
    from glint.tasks.algorithms.candidates.clusters import Clusters

PROVENANCE = ("outside", "observed", "marked", "silhouette", "filled")
"""Names of the codes in `Reconstruction.provenance`."""
OUTSIDE, OBSERVED, MARKED, SILHOUETTE, FILLED = range(len(PROVENANCE))
ALIKE, APART = 3.0, 6.0
"""Degrees up to which an accepted normal's distance from the field is noise, and from which it is the surface's own."""
COARSE = 5_000
"""Grid nodes of the field where it is asked to predict what is withheld."""


@dataclass(frozen=True, slots=True)
class Round:
    """What one round did: how many pixels have an exterior node, and how many changed their labels."""

    exterior: int
    changed: int


@dataclass(frozen=True, slots=True)
class Reconstruction:
    """Labels and normals of one view.

    labels (K, H, W) uint8, 1 = exterior; normals and initial (the silhouette's field) (H, W, 3) float32, unit, NaN
    outside the mask; provenance (H, W) uint8, codes of PROVENANCE; confidence (H, W) float32, the probability that the
    angular error is below 5 degrees, NaN outside.
    """

    labels: np.ndarray
    normals: np.ndarray
    initial: np.ndarray
    provenance: np.ndarray
    confidence: np.ndarray
    rounds: tuple[Round, ...]


def reconstruct_normals(
    clusters: "Clusters",
    mask: np.ndarray,
    *,
    marks: Marks | None = None,
    expected: np.ndarray | None = None,
    symmetry: bool = True,
    rounds: int = 10,
    settled: float = 0.002,
    strength: float = 10.0,
    contrast: float = 0.1,
    prior: float = 0.5,
    shape_weight: float = 1.0,
    rim_weight: float = 1.0,
    normal_weight: float = 0.1,
    marked_weight: float = 0.5,
    mark_weight: float = 10.0,
    expected_weight: float = 0.03,
    tension_length: float = 0.12,
    near: float = 4.0,
    growth: float = 25.0,
    most: float = 30.0,
    believed: float = 0.5,
) -> Reconstruction:
    """Exterior normals of one view from its clusters (region's H, W) and mask (H, W) bool.

    expected (H, W, 3): normals known beforehand, as from a visual hull, finite in the mask; they take the place of the
    rim. symmetry: whether the silhouette of a turned object may tell them where they are not given.
    rounds: at most so many; settled: share of the mask whose labels may still change at the end; strength, contrast,
    prior: see `sheets`; shape_weight: of `shape_evidence`; rim_weight, normal_weight, marked_weight, mark_weight,
    expected_weight: pull on the field of a rim pixel, an accepted normal, a marked one, a mark without cluster, one
    expected; tension_length, near, growth, most (degrees): see `field`; believed: least confidence of an accepted
    normal that may pull on the field.
    """
    normals = np.asarray(clusters.normals, dtype=np.float32)
    if normals.shape[1:3] != mask.shape:
        raise ValueError(f"clusters of {normals.shape[1:3]} pixels do not fit a mask of {mask.shape}")
    if expected is not None and not np.isfinite(expected[mask]).all():
        raise ValueError("the expected normals leave pixels of the mask out")
    normals = np.where(mask[None, :, :, None], normals, np.nan)
    scale, local_scale = inradius(mask), thickness(mask)
    surface = smooth_normal_field(mask, tension_length)
    rim, outward = contour_normals(mask)
    shape = shape_weight * shape_evidence(normals, scale)
    marked, marked_normals, pins = mark_constraints(marks, normals, mask)
    labels = np.zeros(normals.shape[:3], dtype=bool)

    def field_of(known: np.ndarray, values: np.ndarray, surface: SmoothNormalField = surface) -> np.ndarray:
        if expected is None:
            targets, weights = outward, np.where(rim, rim_weight, 0.0)
        else:
            targets, weights = expected, np.full(mask.shape, expected_weight)
        weights = np.where(known, normal_weight, weights)
        weights = np.where(marked & known, np.where(labels.any(axis=0), marked_weight, mark_weight), weights)
        return surface.solve(np.where(known[..., None], values, targets), weights, expected)

    known, values, sure = marked, marked_normals, np.where(marked, 1.0, np.nan)
    initial = field = field_of(known, values)
    history: list[Round] = []
    while True:
        for _ in range(rounds):
            told = known & labels.any(axis=0)
            spread = field_spread(told if expected is not None else rim | told, local_scale, near, growth, most)
            ratios = np.where(pins != 0, pins * CERTAIN, evidence(normals, field, spread, prior) + shape)
            previous, labels = labels, one_per_pixel(label_sheets(normals, ratios, strength, contrast), ratios)
            values = _values(normals, labels, marked_normals)
            sure = np.where(marked, 1.0, observed_confidence(values, scale))
            known = sure >= believed
            field = field_of(known, values)
            changed = int((previous != labels).any(axis=0).sum())
            history.append(Round(int(labels.any(axis=0).sum()), changed))
            if changed <= settled * mask.sum():
                break
        if expected is None and symmetry:
            plain = surface.solve(outward, np.where(rim, rim_weight, 0.0))
            counted = np.where(marked, marked_weight / normal_weight, 1.0)
            expected = surface_of_revolution_normals(
                mask, np.where(known[..., None], values, np.nan), normals, plain, counted
            )
            if expected is not None:
                field = field_of(known, values)
                continue
        break

    accepted = np.isfinite(sure)
    coarse = smooth_normal_field(mask, tension_length, COARSE)
    sheets = connected_sheets(values)
    shown = np.take_along_axis(shape, labels.argmax(axis=0)[None], axis=0)[0]
    told = surprise(sheets, values, known, rim, mask, scale, lambda kept: field_of(kept, values, coarse))
    sure = np.where(marked, 1.0, sheet_confidence(values, sheet_means(sheets, shown), told, scale))
    growing = field_growth(lambda kept: field_of(kept, values), np.where(known[..., None], values, np.nan), scale)
    confidence = np.where(accepted, sure, field_confidence(known & (sure >= believed), rim, growing, scale))
    provenance = np.select([~mask, marked, accepted, rim], [OUTSIDE, MARKED, OBSERVED, SILHOUETTE], FILLED)
    return Reconstruction(
        labels=labels.astype(np.uint8),
        normals=np.where(accepted[..., None], _without_noise(values, field), field).astype(np.float32),
        initial=initial,
        provenance=provenance.astype(np.uint8),
        confidence=np.where(mask, confidence, np.nan).astype(np.float32),
        rounds=tuple(history),
    )


def _values(normals: np.ndarray, labels: np.ndarray, marked: np.ndarray) -> np.ndarray:
    """The accepted normal of each pixel (H, W, 3), NaN where there is none: of its exterior node, of a mark, or, where
    both are, midway between them."""
    chosen = np.take_along_axis(normals, labels.argmax(axis=0)[None, :, :, None], axis=0)[0]
    chosen = np.where(labels.any(axis=0)[..., None], chosen, np.nan)
    return unit(np.where(np.isnan(chosen), marked, np.where(np.isnan(marked), chosen, chosen + marked)))


def _without_noise(values: np.ndarray, field: np.ndarray) -> np.ndarray:
    """Accepted normals (H, W, 3) freed of the sparse sweep's noise: the field's (H, W, 3) where they agree."""
    share = np.clip((APART - angles(values, field)) / (APART - ALIKE), 0.0, 1.0)[..., None]
    return unit(share * field + (1.0 - share) * values)
