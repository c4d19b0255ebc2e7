import numpy as np
import pytest
from scipy.spatial.distance import pdist

from glint.tasks.algorithms.continuation.border_patches import BorderPatches
from tests.tasks.algorithms.continuation.limbs import RADIUS, limbs


def test_a_cylinder_continues_to_its_contour() -> None:
    candidates, mask, truth = limbs(has_near=False)
    patches = BorderPatches.of(candidates[0], mask, RADIUS)
    right = np.flatnonzero(patches.centres[:, 1] > 26)
    rows = patches.centres[right, 0]
    columns = np.full(len(right), np.flatnonzero(mask[0]).max())
    continued = patches.at(right, rows, columns)
    assert len(right) > 10
    assert np.abs(continued[:, :2] - truth[rows, columns, :2]).max() < 0.12
    beside = patches.at(right, rows, patches.centres[right, 1])
    assert (continued[:, 2] > 2.0 * beside[:, 2]).all()


def test_pixels_of_a_border_belong_to_the_nearest_patch() -> None:
    candidates, mask, _ = limbs()
    patches = BorderPatches.of(candidates[0], mask, RADIUS)
    rows, columns = np.nonzero(patches.owner >= 0)
    distance = np.linalg.norm(np.stack([rows, columns], axis=1) - patches.centres[patches.owner[rows, columns]], axis=1)
    assert distance.max() <= 0.15 * RADIUS + 1e-9
    assert patches.inner[rows, columns].all()


def test_patches_of_a_border_lie_apart() -> None:
    candidates, mask, _ = limbs(has_near=False)
    patches = BorderPatches.of(candidates[0], mask, 2.0 * RADIUS)
    left = patches.centres[patches.centres[:, 1] < 26]
    assert len(left) > 4 and pdist(left).min() > 0.15 * 2.0 * RADIUS


def test_a_patch_is_the_linear_fit_that_weighs_near_pixels_more() -> None:
    inradius, rows, columns = 40.0, *np.indices((41, 41))
    # (n_x, n_y) bends across the window, so that the fit depends on the weights, and is rough.
    bend, noise = ((columns - 20).clip(0, 12) / 25.0) ** 2, 0.05 * (-1.0) ** (rows + columns)
    plane = np.stack([0.2 + 0.005 * columns + bend, -0.1 + 0.004 * rows + noise], axis=-1)
    normals = np.concatenate([plane, np.sqrt(1.0 - (plane**2).sum(axis=-1, keepdims=True))], axis=-1)
    normals[:, :20] = np.nan
    patches = BorderPatches.of(normals, np.ones((41, 41), bool), inradius)
    patch = int(np.abs(patches.centres[:, 0] - 20).argmin())
    row, column = patches.centres[patch]
    assert column == 20 and patches.window == 0.25 * inradius
    distance = np.hypot(rows - row, columns - column)
    used = (distance <= patches.window) & (columns >= 20)
    roots = np.exp(-0.25 * (distance[used] / (patches.window / 2.0)) ** 2)[:, None]
    offsets = np.stack([columns[used] - column, rows[used] - row], axis=-1) / patches.window
    design = np.concatenate([np.ones((len(offsets), 1)), offsets], axis=1)
    fit = np.linalg.lstsq(roots * design, roots * plane[used])[0]
    np.testing.assert_allclose(patches.values[patch], fit[0], atol=3e-3)
    # A slope of zero has a small weight as well.
    np.testing.assert_allclose(patches.slopes[patch], fit[1:], atol=8e-3)
    variance = ((roots * (design @ fit - plane[used])) ** 2).sum() / (roots**2).sum()
    assert patches.variances[patch] == pytest.approx(variance, rel=0.02) and variance > 0.02**2


def test_a_sheet_of_few_pixels_has_no_patches_and_a_hole_of_one_pixel_no_border() -> None:
    mask, normals = np.ones((20, 20), bool), np.full((20, 20, 3), np.nan)
    normals[8:11, 8:11] = normals[10, 11] = (0.0, 0.0, 1.0)
    assert BorderPatches.of(normals, mask, 10.0).count == 0
    normals[8:12, 8:11] = (0.0, 0.0, 1.0)
    assert BorderPatches.of(normals, mask, 10.0).count > 0
    normals[:] = (0.0, 0.0, 1.0)
    normals[10, 10] = np.nan
    assert BorderPatches.of(normals, mask, 10.0).count == 0


def test_without_normals_there_are_no_patches() -> None:
    mask = np.ones((20, 20), bool)
    assert BorderPatches.of(np.full((20, 20, 3), np.nan), mask, 10.0).count == 0
    assert BorderPatches.of(np.full((20, 20, 3), [0.0, 0.0, 1.0]), mask, 10.0).count == 0
