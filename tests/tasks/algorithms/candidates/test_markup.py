import numpy as np

from glint.tasks.algorithms.candidates.markup import Marks, mark_constraints


def test_a_true_mark_labels_the_clusters_of_its_pixel() -> None:
    normals = np.full((2, 3, 3, 3), np.nan)
    normals[0, 1, 1], normals[1, 1, 1] = (0, 0, 1), (0.6, 0, 0.8)
    marks = Marks(np.array([[1, 1]]), np.array([[0.6, 0, 0.8]]), np.array([1]))
    marked, values, labels = mark_constraints(marks, normals, np.ones((3, 3), bool))
    assert marked[1, 1] and marked.sum() == 1 and labels[:, 1, 1].tolist() == [-1, 1]
    np.testing.assert_allclose(values[1, 1], [0.6, 0, 0.8])
