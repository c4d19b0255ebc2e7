import numpy as np

from glint.tasks.algorithms.continuation.inner_contours import inner_contours
from glint.tasks.algorithms.prior.lit_pixels import LitPixels
from glint.tasks.algorithms.prior.swept_normals import SweptNormals
from tests.tasks.algorithms.continuation.limbs import CONTOUR, RADIUS, limbs


def lit_pixels(candidates: np.ndarray, mask: np.ndarray) -> LitPixels:
    swept = SweptNormals.of(candidates)
    assert swept is not None
    return LitPixels(np.isfinite(candidates[..., 0]).any(axis=0), mask, RADIUS, swept)


def test_a_near_limb_ends_where_the_far_one_is_seen() -> None:
    candidates, mask, truth = limbs()
    contours = inner_contours(candidates[0], candidates, lit_pixels(candidates, mask))
    assert contours is not None
    beside = contours.right[:, CONTOUR - 3 : CONTOUR + 2]
    assert beside.any(axis=1).mean() > 0.95
    assert contours.right.sum() < 1.2 * len(mask)
    assert not contours.down.any()
    near = np.s_[:, CONTOUR + 1 : CONTOUR + 4]
    assert np.abs(contours.plane[near] - truth[near][..., :2]).max() < 0.2


def test_one_limb_has_no_contour_inside() -> None:
    candidates, mask, _ = limbs(has_near=False)
    contours = inner_contours(candidates[0], candidates, lit_pixels(candidates, mask))
    assert contours is not None
    assert not contours.right.any()
    assert not contours.down.any()


def test_nothing_continues_without_accepted_normals() -> None:
    candidates, mask, _ = limbs()
    assert inner_contours(np.full_like(candidates[0], np.nan), candidates, lit_pixels(candidates, mask)) is None
