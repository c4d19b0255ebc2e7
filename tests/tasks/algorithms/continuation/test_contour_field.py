from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.continuation import contour_field
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals
from glint.tasks.algorithms.labelling.weights import FieldWeights, LabellingOptions
from tests.tasks.algorithms.continuation.limbs import CONTOUR, limbs

WITH = LabellingOptions(field=FieldWeights(unreached=0.0), symmetry=False, flat_faces=False)
"""Without a bend at dark pixels, which turns the smooth field of these scenes out of the plane of their lights."""
WITHOUT = replace(WITH, inner_contours=False)


def clusters_of(normals: np.ndarray) -> Clusters:
    known, unknown = np.isfinite(normals[..., 0]), np.full(normals.shape[:3], np.nan)
    single = np.ones(normals.shape[:3])
    return Clusters(normals, single, unknown, known.astype(np.int32), known.sum(axis=0), normals[0], unknown)


def test_the_field_is_cut_where_a_limb_ends() -> None:
    candidates, mask, truth = limbs()
    beside = np.s_[10:-10, CONTOUR - 2 : CONTOUR + 5]
    cut, smooth = (
        angles(reconstruct_normals(clusters_of(candidates), mask, options).normals, truth)[beside].mean()
        for options in (WITH, WITHOUT)
    )
    assert cut < 0.5 * smooth


def test_every_second_pixel_of_a_large_object_suffices(monkeypatch: pytest.MonkeyPatch) -> None:
    candidates, mask, truth = limbs()
    mask, truth = mask.repeat(2, 0).repeat(2, 1), truth.repeat(2, 0).repeat(2, 1)
    candidates = candidates.repeat(2, 1).repeat(2, 2)
    beside = np.s_[20:-20, 2 * CONTOUR - 4 : 2 * CONTOUR + 10]
    monkeypatch.setattr(contour_field, "CUT_FIELD_NODES", mask.sum() / 3)
    cut, smooth = (
        angles(reconstruct_normals(clusters_of(candidates), mask, options).normals, truth)[beside].mean()
        for options in (WITH, WITHOUT)
    )
    assert cut < 0.7 * smooth


def test_one_limb_keeps_its_result() -> None:
    candidates, mask, _ = limbs(has_near=False)
    cut, smooth = (reconstruct_normals(clusters_of(candidates), mask, options).normals for options in (WITH, WITHOUT))
    assert np.nanmax(angles(cut, smooth)) < 5.0
    assert np.nanmean(angles(cut, smooth)) < 0.5


def test_wrong_lights_leave_the_field_as_it_is() -> None:
    candidates, mask, _ = limbs()
    candidates[0] = candidates[0][::-1, ::-1]
    rng = np.random.default_rng(1)
    candidates = np.where(rng.random((*candidates.shape[:3], 1)) < 0.1, candidates, np.nan)
    cut, smooth = (reconstruct_normals(clusters_of(candidates), mask, options).normals for options in (WITH, WITHOUT))
    assert np.array_equal(cut, smooth, equal_nan=True)
