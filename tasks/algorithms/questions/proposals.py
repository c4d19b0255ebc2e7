"""Which answers help the labelling most: sheets by the expected change of the normals if their label is wrong.

An answer changes nothing if it confirms the label, so its expected value is the probability that the label is wrong
times the change of the normals (angle times pixels) that would follow, in the sheet and in the smooth field that hangs
on it: expected model output change (Freytag, Rodner and Denzler 2014), by the confidence of the labelling itself.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.candidates.markup import Marks, mark_constraints
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.labelling.answers import mark_influence
from glint.tasks.algorithms.labelling.candidate_view import candidate_evidence
from glint.tasks.algorithms.labelling.readmission import (
    CONFIDENCE_RANGE,
    LabelledCandidates,
    surface_probability,
)
from glint.tasks.algorithms.labelling.results import Reconstruction
from glint.tasks.algorithms.labelling.weights import DEFAULT_OPTIONS, LabellingOptions
from glint.tasks.algorithms.prior.smooth_normals import contour_normals
from glint.tasks.algorithms.questions.prediction import MAX_CHANGE_DEG, Prediction, accepted_pixels
from glint.tasks.algorithms.sheets.patches import Patches, cut_patches
from glint.tasks.algorithms.sheets.sheet_graph import sheet_graph

if TYPE_CHECKING:
    from glint.tasks.algorithms.candidates.clusters import Clusters

OPEN_PROBABILITY = 0.25
"""Probability of being wrong from which a label counts as open."""
REMOVAL_GAIN = 0.05
"""Worth of a degree that a sheet's withdrawal changes against one that its acceptance changes: the field that fills the
hole may be no better than the sheet."""
ANSWERED_INFLUENCE = 0.2
"""Mean influence of marks on a sheet from which it counts as answered."""
PREDICTED = 24
"""Rejected sheets whose effect on the field is solved for, chosen by their own change alone, and half as many accepted
ones."""
ASKED_TURN_DEG = 10.0
"""Angle of a rejected sheet to the present normals from which it is asked about, degrees: others change little."""
SHARED_CHANGE = 0.5
"""Share of a sheet's change that also follows from a sheet proposed before, from which it is a near-duplicate."""
EXTERIOR_MARGIN_PX = 20.0
"""Width, in pixels, of the margin of the field that hangs on an accepted patch."""


@dataclass(frozen=True, slots=True)
class Question:
    """A sheet to ask about.

    layers, rows, columns: (N,) int of its nodes. exterior: its present label. wrong: probability that the label is
    wrong. change: degrees times pixels by which the normals would change if it is.
    """

    layers: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    exterior: bool
    wrong: float
    change: float

    @property
    def value(self) -> float:
        """Expected change of the normals, degrees times pixels, as far as it is an improvement."""
        return float(gain_of(self.exterior)) * self.wrong * self.change

    @property
    def is_open(self) -> bool:
        """True if the labelling itself is undecided about the sheet."""
        return self.wrong >= OPEN_PROBABILITY

    @property
    def urgency(self) -> int:
        """Rank before the value: 2 for a rejected sheet that may well be the surface, 1 for other open ones, else 0.

        Of accepted sheets few are false, however low their confidence, and confirming one changes little. A sheet whose
        label is not open (0) is rarely wrong, whatever would change if it were.
        """
        return (1 if self.exterior else 2) if self.is_open else 0


def gain_of(exterior: np.ndarray | bool) -> np.ndarray:
    """Return the worth (...) of a degree that follows if a sheet's label, exterior (...) or not, is wrong.

    A sheet that is withdrawn leaves a gap, which the field fills with normals that may be no better.
    """
    return np.where(exterior, REMOVAL_GAIN, 1.0)


def propose(
    clusters: "Clusters",
    mask: np.ndarray,
    result: Reconstruction,
    marks: Marks | None,
    count: int,
    options: LabellingOptions = DEFAULT_OPTIONS,
) -> list[Question]:
    """Propose at most `count` sheets, no near-duplicates of one another: by their urgency, then by their value.

    Args:
        clusters: candidates of the region as labelled, `normals` (K, H, W, 3).
        mask: (H, W) bool, the object.
        result: their labelling.
        marks: those that the labelling knew; sheets that they answer are left out.
        count: number of proposals.
        options: of the labelling.
    """
    normals = np.where(mask[None, :, :, None], clusters.normals, np.nan).astype(np.float32)
    inradius = inradius_of(mask)
    nodes, ties = sheet_graph(normals)
    patches = cut_patches(nodes, ties, result.labels, inradius)
    if patches.count == 0:
        return []
    influence = mark_influence(nodes, ties, mark_constraints(marks, normals, mask).labels, inradius)
    answered = patches.mean(np.abs(patches.of(influence))) > ANSWERED_INFLUENCE
    evidence = candidate_evidence(normals, clusters.shading, inradius, options.graph_cut)
    labelled = LabelledCandidates(normals, result.labels, evidence, clusters.observations)
    wrong = wrong_probability(patches, labelled, result)
    exterior = patches.exterior(result.labels)
    first = gain_of(exterior) * wrong * rough_change(patches, normals, result, mask, inradius)
    turn = patches.mean(patches.angles_to(normals, result.normals))
    first[answered | (~exterior & (turn < ASKED_TURN_DEG))] = 0.0
    order = np.lexsort((-first, wrong < OPEN_PROBABILITY))
    order = order[first[order] > 0]
    pool = max(PREDICTED, 2 * count)
    chosen = np.concatenate([order[~exterior[order]][:pool], order[exterior[order]][: pool // 2]])
    predict = Prediction(mask, normals, result, patches, options.field)
    maps = {int(number): predict.change(int(number), bool(exterior[number])) for number in chosen}
    candidates = [
        Question(
            patches.layer[patches.number == number],
            patches.row[patches.number == number],
            patches.column[patches.number == number],
            bool(exterior[number]),
            float(wrong[number]),
            float(maps[number].sum()),
        )
        for number in maps
    ]
    pairs = zip(candidates, maps.values(), strict=True)
    return _without_duplicates(sorted(pairs, key=lambda pair: (-pair[0].urgency, -pair[0].value)))[:count]


def _without_duplicates(ranked: list[tuple[Question, np.ndarray]]) -> list[Question]:
    """Return questions without those whose change (H, W) mostly follows from an earlier one that is as open."""
    taken: list[tuple[Question, np.ndarray]] = []
    for question, change in ranked:
        # That an improbable sheet is false says nothing of another one.
        rivals = (earlier for other, earlier in taken if other.is_open or not question.is_open)
        if not any(np.minimum(change, earlier).sum() > SHARED_CHANGE * change.sum() for earlier in rivals):
            taken.append((question, change))
    return [question for question, _ in taken]


def rough_change(
    patches: Patches, normals: np.ndarray, result: Reconstruction, mask: np.ndarray, inradius: float
) -> np.ndarray:
    """Estimate the change (count,), degrees times pixels, if the label of a patch were the opposite.

    A patch has the pixels that are nearer to it than to any confident normal or the contour: the field there follows
    it. They turn by the patch's angle to the present normals.

    normals: (K, H, W, 3), of the patches' nodes; mask: (H, W) bool; inradius: of the mask, in pixels.
    """
    own = np.minimum(patches.angles_to(normals, result.normals), MAX_CHANGE_DEG)
    own = np.where(patches.of(result.labels) > 0, MAX_CHANGE_DEG / 3.0, own)
    rim, _ = contour_normals(mask)
    known = (accepted_pixels(result) | rim) & mask
    distance = ndimage.distance_transform_edt(~known) if known.any() else np.full(mask.shape, inradius)
    # A false patch holds a disc as wide as its distance from what is known, an exterior one its pixels and a margin.
    reach = np.maximum(patches.mean(distance[patches.row, patches.column]), 0.0)
    pixels = np.bincount(patches.number, minlength=patches.count)
    held = pixels + np.pi * np.minimum(reach, inradius) ** 2
    lonely = np.sqrt(pixels) * EXTERIOR_MARGIN_PX
    held = np.where(patches.exterior(result.labels), pixels + lonely, held)
    return patches.mean(own) * held


def wrong_probability(patches: Patches, candidates: LabelledCandidates, result: Reconstruction) -> np.ndarray:
    """Return the probability (count,) that the label of a patch is wrong, by the confidence of the labelling.

    An exterior patch is wrong if its normals are; for a rejected one see `surface_probability`.
    """
    surface = surface_probability(patches, candidates, result.normals, result.confidence)
    confidence = np.clip(result.confidence[patches.row, patches.column], *CONFIDENCE_RANGE)
    exterior = patches.exterior(candidates.labels)
    return np.where(exterior, patches.mean(1.0 - confidence), surface)
