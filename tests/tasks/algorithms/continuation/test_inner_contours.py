import numpy as np

from glint.tasks.algorithms.continuation.inner_contours import inner_contours
from glint.tasks.algorithms.prior.unreached import SweptNormals
from tests.tasks.algorithms.continuation.limbs import CONTOUR, RADIUS, limbs


def test_a_near_limb_ends_where_the_far_one_is_seen() -> None:
    candidates, mask, truth = limbs()
    swept = SweptNormals.of(candidates)
    assert swept is not None
    contours = inner_contours(candidates[0], candidates, mask, swept, RADIUS)
    assert contours is not None
    beside = contours.right[:, CONTOUR - 3 : CONTOUR + 2]
    assert beside.any(axis=1).mean() > 0.95
    assert contours.right.sum() < 1.2 * len(mask)
    assert not contours.down.any()
    near = np.s_[:, CONTOUR + 1 : CONTOUR + 4]
    assert np.abs(contours.plane[near] - truth[near][..., :2]).max() < 0.2


def test_one_limb_has_no_contour_inside() -> None:
    candidates, mask, _ = limbs(has_near=False)
    swept = SweptNormals.of(candidates)
    assert swept is not None
    contours = inner_contours(candidates[0], candidates, mask, swept, RADIUS)
    assert contours is not None
    assert not contours.right.any()
    assert not contours.down.any()


def test_nothing_continues_without_accepted_normals() -> None:
    candidates, mask, _ = limbs()
    swept = SweptNormals.of(candidates)
    assert swept is not None
    assert inner_contours(np.full_like(candidates[0], np.nan), candidates, mask, swept, RADIUS) is None
