"""Triangle meshes: their largest component, and the normals that a view of one shows."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.multiview.mesh import largest_component
from glint.tasks.algorithms.multiview.raycast import raycast
from tests.tasks.algorithms.multiview.figurine import full_view, true_model


def test_the_component_of_the_largest_area_is_kept_without_degenerate_triangles() -> None:
    small, large = trimesh.creation.icosphere(2, 3.0), trimesh.creation.icosphere(1, 10.0)
    count = len(small.vertices)
    vertices = np.concatenate([small.vertices, large.vertices + 50.0])
    joining = [[0, 0, count], [count, 1, count]]
    triangles = np.concatenate([small.faces, large.faces + count, joining])
    kept, numbers = largest_component(vertices, triangles)
    assert np.array_equal(kept, large.vertices + 50.0) and np.array_equal(numbers, large.faces)
    with pytest.raises(UnusableCapture, match="no surface"):
        largest_component(vertices, np.array(joining))


def test_no_normal_that_a_view_shows_faces_away_from_it() -> None:
    """Those of a coarse mesh's vertices at its contour do."""
    sphere = trimesh.creation.icosphere(1, 30.0)
    sphere.apply_transform(trimesh.transformations.rotation_matrix(0.4, [1.0, 2.0, 0.5]))
    model = replace(true_model(sphere), normals=np.asarray(sphere.vertices) / 30.0)
    normals = raycast(model, full_view("view"))[1]
    shown = np.isfinite(normals[..., 0])
    assert shown.sum() > 2000 and normals[shown, 2].min() == 0.0
    assert np.allclose(np.linalg.norm(normals[shown], axis=1), 1.0, atol=1e-5)
