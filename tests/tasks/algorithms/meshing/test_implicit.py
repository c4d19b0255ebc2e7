import numpy as np

from glint.tasks.algorithms.meshing.implicit import revolved, surface_normals, torus


def test_a_revolved_profile_has_its_distances_inside_and_outside() -> None:
    cup = revolved([(0, -10), (8, -10), (8, 10), (6, 10), (6, -8), (0, -8)], 0.5)
    points = np.array([[0, -9, 0], [7, 0, 0], [0, 0, -7], [0, 0, 0], [3, 5, 0], [0, -13, 0], [0, 5, 10.0]])
    assert np.allclose(cup(points), [-1.5, -1.5, -1.5, 5.5, 2.5, 2.5, 1.5])


def test_its_normals_point_out_of_the_wall() -> None:
    cup = revolved([(0, -10), (8, -10), (8, 10), (6, 10), (6, -8), (0, -8)], 0.5)
    found = surface_normals(cup, np.array([[0, 0, 8.5], [5.5, 0, 0], [0, -10.5, 1.0]]))
    assert np.allclose(found, [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], atol=1e-6)


def test_a_torus_has_its_distances_in_tube_opening_and_outside() -> None:
    points = np.array([[10, 0, 0], [0, 0, -12], [0, 0, 0], [6, 4, 0], [0, 7, 10.0]])
    assert np.allclose(torus(10.0, 3.0)(points), [-3.0, -1.0, 7.0, 2.6568542, 4.0])
