import numpy as np

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


def test_without_normals_there_are_no_patches() -> None:
    mask = np.ones((20, 20), bool)
    assert BorderPatches.of(np.full((20, 20, 3), np.nan), mask, 10.0).count == 0
    assert BorderPatches.of(np.full((20, 20, 3), [0.0, 0.0, 1.0]), mask, 10.0).count == 0
