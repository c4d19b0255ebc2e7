import numpy as np

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.prior.cut_field import cut_field
from glint.tasks.algorithms.prior.smooth_normals import smooth_normal_field

ROWS, COLUMNS = np.indices((40, 60))
MASK = (ROWS - 19.5) ** 2 / 18.0**2 + (COLUMNS - 29.5) ** 2 / 28.0**2 < 1.0


def two_planes() -> tuple[np.ndarray, np.ndarray]:
    """Normals of two planes that meet at column 30, and weights that leave a gap between them."""
    tilt = np.where(COLUMNS < 30, -0.4, 0.4)
    normals = np.stack([tilt, 0.0 * tilt, np.sqrt(1.0 - tilt**2)], axis=-1)
    return normals, np.where(MASK & (np.abs(COLUMNS - 29.5) > 6), 0.1, 0.0)


def test_nothing_is_smooth_across_a_contour() -> None:
    normals, weights = two_planes()
    right, down = np.zeros((2, *MASK.shape), bool)
    right[:, 29] = True
    error = angles(cut_field(MASK, right, down, 0.12).solve(normals, weights), normals)
    assert np.nanmax(error) < 0.5
    error = angles(cut_field(MASK, down, down, 0.12).solve(normals, weights), normals)
    assert np.nanmax(error) > 15.0


def test_without_contours_it_is_the_smooth_field() -> None:
    normals, weights = two_planes()
    uncut = np.zeros(MASK.shape, bool)
    field = cut_field(MASK, uncut, uncut, 0.12).solve(normals, weights)
    smooth = smooth_normal_field(MASK, 0.12).solve(normals, weights)
    assert np.nanmax(angles(field, smooth)) < 0.1
