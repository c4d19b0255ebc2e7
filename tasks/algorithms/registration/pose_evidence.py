"""Evidence for the poses of few views, of which no two show the same part of the object with confidence.

Views 90 degrees apart share no confident normals: a highlight shows normals up to 45 degrees from the camera's axis.
But each view can be held against a model of all others. It must fit that model best at its own pose, and its normals
must lie nearer to those of a model made without them than they do where the turntable turned the other way. Leaving one
view out is cross-validation (Stone, Cross-Validatory Choice and Assessment of Statistical Predictions, 1974).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.multiview.raycast import raycast
from glint.tasks.algorithms.multiview.reconstruction import coarse_model
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.normal_consistency import MIN_COMPARED_CONFIDENCE
from glint.tasks.algorithms.registration.pose_alternatives import silhouette_alternatives
from glint.tasks.algorithms.registration.pose_fit import PoseFitter
from glint.tasks.algorithms.registration.turntable import Turntable

MIN_COMPARED_PIXELS = 30
"""Confident pixels from which a view's normals are compared."""
MIN_LOG_RATIO = 0.6
"""Sum over the views of the logarithms of the ratios of misfits beyond which poses are distinguished."""
FIRST_TURNS_DEG = (0.0, -15.0, 15.0, -7.0, 7.0)
"""Turns from which the pose of a view is refined on a model of the others."""
MAX_BEST_TURN_DEG = 5.0
"""Degrees from its own angle at which a view may fit a model of the others best: 3 and less at right angles, 7 and more
where one of four is wrong by 10."""
MIN_HELD_VIEWS, MAX_HELD_VIEWS = 4, 6
"""Views from which a model of all but one is good enough (two others leave its shape, and so the angle, open), and up
to which each is held against one: more views are compared with each other."""


@dataclass(frozen=True, slots=True)
class PoseEvidence:
    """What the views say of their poses, each held against a model of all others.

    log_ratio: how much worse the best of the alternatives is, see MIN_LOG_RATIO; NaN if one cannot be compared, inf if
    the silhouettes exclude all; alternative: what is different there; turns (V,): degrees from its own angle at which
    each view fits best, NaN unless all alternatives are excluded.
    """

    log_ratio: float
    alternative: str | None
    turns: np.ndarray

    @property
    def is_sufficient(self) -> bool:
        """Whether all alternatives are excluded, and each view fits at its own angle."""
        return bool(self.log_ratio >= MIN_LOG_RATIO and (np.abs(self.turns) <= MAX_BEST_TURN_DEG).all())

    @property
    def better_alternative(self) -> str | None:
        """The alternative that explains the normals better, None if none does."""
        return self.alternative if self.log_ratio <= -MIN_LOG_RATIO else None


def pose_evidence(views: Sequence[View], table: Turntable | None) -> PoseEvidence:
    """Hold each view against a model of all others, at its pose and at those of the usual mistakes.

    table: the turntable on which the first views stand; None: they have matrices. Where some have matrices beside it,
    and with other numbers of views, nothing is known.
    """
    unknown = np.full(len(views), np.nan)
    if not MIN_HELD_VIEWS <= len(views) <= MAX_HELD_VIEWS or (table is not None and len(table.angles) < len(views)):
        return PoseEvidence(np.nan, None, unknown)
    alternatives = silhouette_alternatives(views, table)
    own = left_out_misfits(views) if alternatives else unknown
    ratios = [(log_ratio(own, left_out_misfits(posed)), description) for description, posed in alternatives]
    least, alternative = likeliest_alternative(ratios)
    turns = best_turns(views, is_on_table=table is not None) if least >= MIN_LOG_RATIO else unknown
    return PoseEvidence(least, alternative, turns)


def likeliest_alternative(ratios: Sequence[tuple[float, str]]) -> tuple[float, str | None]:
    """Return the least log-likelihood ratio of poses against their alternatives, and that alternative.

    It is infinite without any. An alternative that cannot be compared (NaN) is not excluded: the ratio is NaN then, but
    for one that explains the normals better.
    """
    known = [ratio for ratio in ratios if not np.isnan(ratio[0])]
    least, alternative = min(known, default=(np.inf, None))
    if len(known) < len(ratios) and least > -MIN_LOG_RATIO:
        return np.nan, None
    return least, alternative


def left_out_misfits(views: Sequence[View]) -> np.ndarray:
    """Return the misfit (V,) of each view's confident normals to a model made of all silhouettes and others' normals.

    It is their median angle in degrees; NaN where too few can be compared.
    """
    misfits = np.full(len(views), np.nan)
    for number, view in enumerate(views):
        is_confident = np.nan_to_num(view.evidence) >= MIN_COMPARED_CONFIDENCE
        if is_confident.sum() < MIN_COMPARED_PIXELS:
            continue
        blind = view.with_normals(view.normals, np.where(np.isfinite(view.evidence), np.float32(0.0), view.evidence))
        model = coarse_model([*views[:number], blind, *views[number + 1 :]])
        expected = raycast(model, view)[1]
        is_confident &= np.isfinite(expected[..., 0])
        if is_confident.sum() >= MIN_COMPARED_PIXELS:
            misfits[number] = np.median(angles(expected[is_confident], view.normals[is_confident]))
    return misfits


def log_ratio(misfits: np.ndarray, alternative: np.ndarray) -> float:
    """Return the sum over the views of log(alternative / misfits), both (V,); NaN where no view can be compared."""
    ratios = np.log(alternative / misfits)
    return float(np.nansum(ratios)) if np.isfinite(ratios).any() else np.nan


def best_turns(views: Sequence[View], is_on_table: bool) -> np.ndarray:
    """Return the `best_turn` (V,) of each view, in degrees."""
    return np.array([best_turn(views, number, is_on_table) for number in range(len(views))])


def best_turn(views: Sequence[View], number: int, is_on_table: bool) -> float:
    """Return the degrees from its pose at which a view, by its number, fits a model of all others best.

    is_on_table: whether the views stand on a turntable, so that it turns about its axis alone, the world's y axis;
    otherwise it turns about the axes of its image, through the model's centre.
    """
    view, model = views[number], coarse_model([*views[:number], *views[number + 1 :]])
    fitter = PoseFitter(view, model)
    axes = np.array([[0.0, 1.0, 0.0]]) if is_on_table else view.rotation[:2]
    centre = np.zeros(3) if is_on_table else model.vertices.mean(axis=0)
    return max((_turn_about(fitter, axis, centre) for axis in axes), key=abs)


def _turn_about(fitter: PoseFitter, axis: np.ndarray, centre: np.ndarray) -> float:
    """Return the degrees of the best turn of a view about an axis (3,), world, unit, through a centre (3,)."""
    view = fitter.view

    def pose(unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turned = view.rotation @ Rotation.from_rotvec(unknowns[0] * axis, degrees=True).as_matrix()
        return turned, view.translation + (view.rotation - turned) @ centre

    turns = [fitter.refine(pose, np.array([turn])) for turn in FIRST_TURNS_DEG]
    return float(min(turns, key=lambda unknowns: fitter.evaluate(*pose(unknowns)).cost)[0])
