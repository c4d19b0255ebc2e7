"""Confidence of settled labels: each sheet is judged by its residual against the field of all the rest.

A false sheet can be smooth, and once it is accepted the field follows it, so that each seems to confirm the other.
Therefore a whole sheet is held out at a time and predicted from the occluding contour and all remaining sheets
(leave-one-out cross-validation with sheets as folds). Where a true sheet ends, a false one that crosses it can carry it
on, so that residual and evidence count within a window, not over the whole sheet. The paper has no such test.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from glint.tasks.algorithms.faces.flat_faces import APPARENT_DEG
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.alternation import Alternation
from glint.tasks.algorithms.labelling.confidence import (
    accepted_log_odds,
    face_confidence,
    place_confidence,
    sheet_confidence,
    solid_confidence,
)
from glint.tasks.algorithms.labelling.results import exterior_values
from glint.tasks.algorithms.sheets.segments import segment_sheets, sheet_means

SHEET_WINDOW_INRADII = 0.1
"""Standard deviation of the window over which residual and evidence of a sheet are averaged, in inradii."""
MIN_HELD_OUT_SHARE = 0.004
"""Sheets of at least this share of the mask are held out; each costs a solve, and smaller ones are many."""
SMALL_SHEET_RESIDUAL = 2.0
"""Residual given to smaller sheets, and to those that nothing else predicts: as large as that of most false sheets."""
MAX_RESIDUAL_DEG = 20.0
"""Limit to which angles to the prediction are clipped: beyond it, a sheet is no less likely to be true."""


def final_confidence(state: Alternation, normals: np.ndarray) -> np.ndarray:
    """Compute the confidence (H, W) of resulting normals (H, W, 3): by sheets where accepted, else by the field."""
    view, sheets = state.view, segment_sheets(state.values)
    window = max(SHEET_WINDOW_INRADII * view.inradius, 1.0)
    evidence = exterior_values(state.evidence, state.labels)

    # Without a ceiling, a sheet far from all else is not blamed for a poor prediction.
    error = replace(state.options.field_error, ceiling=np.inf)

    def predict(kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return state.solve_field(kept, state.values, view.coarse), error.spread(kept | view.rim, view.inradius)

    residual = held_out_residual(sheets, state.values, state.known, view.mask, window, predict)
    # What is seen through a face that flashed does not show how often false candidates are accepted.
    shown = np.isfinite(view.normals[..., 0]) & ~state.seen_through
    odds = accepted_log_odds(np.isfinite(state.confidence), shown.any(axis=0))
    means = sheet_means(sheets, evidence, window)
    observed = sheet_confidence(state.values, means, residual, view.inradius, odds)
    if state.solid is not None:
        observed = observed * solid_confidence(state.values, state.solid.normals)
    # Where as many candidates of a circle show another slope of the body, both its sheet and its field may be false.
    of_body = 1.0 if state.body_fit is None else state.body_fit.confidence
    observed = state.with_marks(observed * place_confidence(normals) * of_body)
    between = of_body * state.field_confidence(state.known & (observed >= state.options.min_confidence))
    if state.faces is not None:
        agrees = angles(state.values, state.faces.normals) < APPARENT_DEG
        observed = np.where(agrees, np.fmax(observed, face_confidence(state.faces.residual)), observed)
    return np.where(np.isfinite(state.confidence), observed, between)


def held_out_residual(
    sheets: np.ndarray,
    normals: np.ndarray,
    known: np.ndarray,
    mask: np.ndarray,
    window: float,
    predict: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
) -> np.ndarray:
    """Compute each sheet's held-out (leave-one-out) residual: its mean angle to the field of all remaining data.

    Args:
        sheets: (H, W) int, numbers of the sheets, -1 outside.
        normals: (H, W, 3) accepted normals.
        known: (H, W) bool, accepted normals of the field.
        mask: (H, W) bool, the object.
        window: standard deviation of the window over which a sheet's angles are averaged, in pixels.
        predict: maps known pixels (H, W) bool to the field (H, W, 3) from these normals, the contour and dark pixels,
            and to its expected error (H, W), radians.

    Returns:
        (H, W), in units of the field's mean expected error at that distance from the remaining data;
        SMALL_SHEET_RESIDUAL for small sheets and without remaining data, NaN outside sheets.
    """
    angle, expected = np.zeros(sheets.shape), np.zeros(sheets.shape)
    sizes = np.bincount(sheets[sheets >= 0])
    held_out = []
    for sheet in np.flatnonzero(sizes >= max(MIN_HELD_OUT_SHARE * mask.sum(), 1)):
        withheld = sheets == sheet
        field, spread = predict(known & ~withheld)
        if not np.isfinite(spread[withheld]).all():
            # A mask that fills the image has no contour: its only sheet is predicted by nothing.
            continue
        held_out.append(sheet)
        angle[withheld] = np.minimum(angles(field[withheld], normals[withheld]), MAX_RESIDUAL_DEG)
        expected[withheld] = np.degrees(spread[withheld])
    is_held_out = np.isin(sheets, held_out)
    large = np.where(is_held_out, sheets, -1)
    residual = sheet_means(large, angle, window) / sheet_means(large, expected, window)
    return np.where(is_held_out, residual, np.where(sheets >= 0, SMALL_SHEET_RESIDUAL, np.nan))
