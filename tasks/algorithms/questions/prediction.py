"""Predict what an answer would change: the normals if one patch of candidates had the opposite label, all else being
equal."""

import numpy as np

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.results import MARKED, OBSERVED, Reconstruction
from glint.tasks.algorithms.labelling.weights import MIN_FIELD_CONFIDENCE, FieldWeights
from glint.tasks.algorithms.prior.smooth_normals import ContourField
from glint.tasks.algorithms.sheets.patches import Patches

FIELD_NODES = 3_000
"""Grid nodes of the coarser field that predicts what hangs on a sheet."""
MAX_CHANGE_DEG = 45.0
"""Angles are clipped here: a worse normal is no more wrong."""


def accepted_pixels(result: Reconstruction) -> np.ndarray:
    """Return the pixels (H, W) bool whose accepted normals shape the field."""
    accepted = (result.provenance == OBSERVED) | (result.provenance == MARKED)
    return np.asarray(accepted & (result.confidence >= MIN_FIELD_CONFIDENCE))


class Prediction:
    """Predicts the normals if one patch had the opposite label, all else being equal."""

    def __init__(
        self,
        mask: np.ndarray,
        normals: np.ndarray,
        result: Reconstruction,
        patches: Patches,
        weights: FieldWeights,
    ) -> None:
        self.mask, self.normals, self.result, self.patches = mask, normals, result, patches
        self.accepted = accepted_pixels(result)
        self._field = ContourField.of(mask, weights.tension_length, weights.observed, weights.rim, FIELD_NODES)
        self.field = self._field.solve(self.accepted, result.normals)

    def change(self, number: int, exterior: bool) -> np.ndarray:
        """Return the angles (H, W), degrees, between the normals now and with the opposite label of a patch."""
        of_patch = self.patches.number == number
        layer, row, column = (index[of_patch] for index in (self.patches.layer, self.patches.row, self.patches.column))
        known, values = self.accepted.copy(), self.result.normals.copy()
        known[row, column] = not exterior
        if not exterior:
            values[row, column] = self.normals[layer, row, column]
        field = self._field.solve(known, values)
        # Accepted normals elsewhere stay what they are; all others follow the field.
        follows = self.mask & ~self.accepted
        change = np.where(follows, angles(field, self.field), 0.0)
        after = field if exterior else values
        change[row, column] = angles(after[row, column], self.result.normals[row, column])
        return np.minimum(np.nan_to_num(change), MAX_CHANGE_DEG)
