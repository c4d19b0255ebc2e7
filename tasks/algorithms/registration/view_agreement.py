"""Agreement of views: where two of them show the same point of a model with confidence, its normals must be the same.

Silhouettes leave much undetermined: along parallel rays a body and its mirror image that turns the other way show the
same ones, and few silhouettes agree at wrong angles too. The normals of right poses do not contradict each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.normal_fusion import fuse_normals
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.normal_consistency import MIN_COMPARED_CONFIDENCE, MIN_SHARED_VERTICES

AGREEING_DEG = 10.0
"""Degrees between the normals of two views up to which they agree: each of them may be 5 degrees off."""
MIN_CONSISTENT_SHARE = 0.5
"""Share of a view's normals that must agree with other views: 0.66 and more do at right poses, 0.4 and less where poses
are wrong by ten degrees or the turntable turned the other way."""
MIN_TOTAL_SHARE = 0.6
"""Share of all compared normals below which the views contradict each other even if none stands out: 0.86 and more
agree at right poses."""
USUAL_AGREEING_SHARE, USUAL_TOTAL_SHARE = 0.65, 0.8
"""Share of a view's normals, and of all, from which they are trusted in full: some confident normals are false
highlights at right poses too."""
MAX_CONTRADICTING_SHARE = 1.0 / 3.0
"""Share of the views that may contradict the others; where more do, no pose is known to be right."""


@dataclass(frozen=True, slots=True)
class ViewAgreement:
    """At how many vertices of a model two of V views have confident normals, and at how many these agree.

    shared, agreeing (V, V) int, symmetric, 0 on the diagonal; pairs with fewer than MIN_SHARED_VERTICES are 0.
    """

    shared: np.ndarray
    agreeing: np.ndarray

    @property
    def is_known(self) -> bool:
        """Whether any two views can be compared."""
        return bool(self.shared.any())

    @property
    def share(self) -> float:
        """The share of all compared normals that agree; NaN if none can be compared."""
        return float(_ratio(self.agreeing.sum(), self.shared.sum()))

    def shares(self, numbers: Sequence[int]) -> np.ndarray:
        """Return the share (len(numbers),) of each view's normals that agrees with the others of `numbers`, or NaN."""
        chosen = np.ix_(numbers, numbers)
        return _ratio(self.agreeing[chosen].sum(axis=1), self.shared[chosen].sum(axis=1))

    def contradicting(self) -> list[int]:
        """Return the views that contradict the others, the worst first; all, where too many do to tell which."""
        remaining, worst = list(range(len(self.shared))), list[int]()
        while remaining:
            shares = np.nan_to_num(self.shares(remaining), nan=1.0)
            if shares.min() >= MIN_CONSISTENT_SHARE:
                break
            number = remaining[int(shares.argmin())]
            partners = [other for other in remaining if self.shared[number, other]]
            # Of two views that contradict each other alone, either may be wrong.
            for doubted in [number, *partners] if len(partners) == 1 else [number]:
                worst.append(doubted)
                remaining.remove(doubted)
        is_nobodys = not worst and self.share < MIN_TOTAL_SHARE
        if is_nobodys or len(worst) > MAX_CONTRADICTING_SHARE * len(self.shared):
            return list(range(len(self.shared)))
        return worst

    def trust(self) -> np.ndarray:
        """Return the factors (V,) in 0..1 by which the confidence of the views' normals falls.

        A view is judged by the others, and all are judged by what the whole agrees: a wrong one spoils the shape.
        """
        if not self.is_known:
            return np.ones(len(self.shared))
        everyone, worst = list(range(len(self.shared))), self.contradicting()
        rest = [number for number in everyone if number not in worst]
        own = self.shares(everyone)
        own[rest] = self.shares(rest)
        factors = np.nan_to_num(own / USUAL_AGREEING_SHARE, nan=1.0)
        return np.minimum(np.minimum(factors, self.share / USUAL_TOTAL_SHARE), 1.0)


def view_agreement(views: Sequence[View], model: Model) -> ViewAgreement:
    """Compare the confident normals of V views at the vertices of a model made of them."""
    fused = fuse_normals(views, model.vertices, model.triangles)
    is_confident = fused.evidences >= MIN_COMPARED_CONFIDENCE
    shared, agreeing = np.zeros((2, len(views), len(views)), int)
    for first in range(len(views)):
        for second in range(first):
            is_shared = is_confident[first] & is_confident[second]
            if is_shared.sum() >= MIN_SHARED_VERTICES:
                angle = angles(fused.per_view[first][is_shared], fused.per_view[second][is_shared])
                shared[first, second] = shared[second, first] = is_shared.sum()
                agreeing[first, second] = agreeing[second, first] = (angle <= AGREEING_DEG).sum()
    return ViewAgreement(shared, agreeing)


def _ratio(part: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """Return part / whole, NaN where there is nothing."""
    return np.where(whole > 0, part / np.maximum(whole, 1), np.nan)
