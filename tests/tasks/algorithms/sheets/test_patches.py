"""Sheets cut into patches of one label and a bounded size."""

import numpy as np

from glint.tasks.algorithms.sheets.patches import MIN_PATCH_NODES, cut_patches
from glint.tasks.algorithms.sheets.sheet_graph import sheet_graph


def test_patches_have_one_label_and_a_bounded_size() -> None:
    normals = np.zeros((2, 40, 50, 3), np.float32)
    normals[0], normals[1] = (0.0, 0.0, 1.0), (0.6, 0.0, 0.8)
    normals[1, :, 30:] = np.nan
    normals[1, 39, 48:] = (0.6, 0.0, 0.8)  # too small for a patch
    labels = np.zeros((2, 40, 50), np.uint8)
    labels[0, 5:33, 7:45] = 1
    patches = cut_patches(*sheet_graph(normals), labels, inradius=20.0)
    assert (np.diff(patches.number) >= 0).all() and set(patches.number) == set(range(patches.count))
    assert len(patches.number) == 40 * 50 + 40 * 30
    assert np.bincount(patches.number).min() >= MIN_PATCH_NODES
    assert np.isin(patches.mean(patches.of(labels).astype(float)), (0.0, 1.0)).all()
    assert np.isin(patches.mean(patches.layer.astype(float)), (0.0, 1.0)).all()
    for index in (patches.row, patches.column):
        assert max(np.ptp(index[patches.number == number]) for number in range(patches.count)) < 12
    assert patches.exterior(labels).sum() == len({(r // 12, c // 12) for r in range(5, 33) for c in range(7, 45)})
