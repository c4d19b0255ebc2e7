import numpy as np

from glint.tasks.algorithms.meshing.depth_mesh import Surface, mesh_from_depth
from glint.tasks.algorithms.meshing.shading import RELIGHT_DIRECTIONS, draw_surface, relit, relit_pictures


def sphere(size: int = 41, radius: float = 18.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normals (NaN outside), mask and depth of a sphere."""
    rows, columns = np.indices((size, size))
    x, y = columns - (size - 1) / 2, (size - 1) / 2 - rows
    mask = np.hypot(x, y) < radius
    z = np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0.0))
    normals = np.where(mask[..., None], np.stack([x, y, z], axis=-1) / radius, np.nan)
    return normals, mask, np.where(mask, z, np.nan).astype(np.float32)


def meshed() -> Surface:
    normals, mask, depth = sphere()
    return mesh_from_depth(depth, mask, normals)


def test_relit_pictures_are_brightest_where_the_normal_is_the_light() -> None:
    normals, mask, _ = sphere()
    pictures = relit_pictures(normals, mask)
    assert pictures.keys() == RELIGHT_DIRECTIONS.keys()
    for name, light in RELIGHT_DIRECTIONS.items():
        picture = pictures[name]
        assert picture.dtype == np.uint8 and picture.shape == mask.shape
        row, column = np.unravel_index(picture.argmax(), picture.shape)
        assert normals[row, column] @ np.array(light) > 0.99
        assert (picture[~mask] == 0).all()
    assert (pictures["relit_left"][:, :12].sum()) > pictures["relit_left"][:, -12:].sum()
    for name in ("relit_left", "relit_right"):
        assert pictures[name][:12].sum() > pictures[name][-12:].sum(), "the light comes from above"


def test_normals_turned_from_the_light_and_missing_ones_are_black() -> None:
    normals = np.array([[[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [np.nan, np.nan, np.nan]]])
    assert relit(normals, np.ones((1, 3), bool), (0.0, 0.0, 1.0)).tolist() == [[255, 0, 0]]


def test_normals_outside_the_mask_are_black() -> None:
    assert relit(np.full((1, 2, 3), (0.0, 0.0, 1.0)), np.array([[True, False]]), (0.0, 0.0, 1.0)).tolist() == [[255, 0]]


def test_the_drawn_surface_covers_its_silhouette() -> None:
    picture = draw_surface(meshed(), size=101)
    assert picture.dtype == np.uint8 and picture.shape == (101, 101)
    drawn = picture < 255
    assert drawn[50, 50] and not drawn[0, 0]
    assert drawn.sum() > 0.4 * drawn.size
    left, right = picture[:, :50][drawn[:, :50]].mean(), picture[:, 51:][drawn[:, 51:]].mean()
    assert left > right


def test_turning_the_viewer_shows_the_side_and_the_back() -> None:
    mesh = meshed()
    front, side, back = (draw_surface(mesh, azimuth=angle, size=101) for angle in (0, 90, 180))
    assert (side < 255).sum() < 0.75 * (front < 255).sum()
    # The dome is narrower towards the camera: to the left when seen from the right, below when seen from above.
    widths = (side < 255).sum(axis=0)
    first, last = np.nonzero(widths)[0][[0, -1]]
    assert widths[first + (last - first) // 4] < widths[last - (last - first) // 4] - 4
    assert back[back < 255].max() < front[front < 255].mean() / 2
    heights = (draw_surface(mesh, elevation=90, size=101) < 255).sum(axis=1)
    first, last = np.nonzero(heights)[0][[0, -1]]
    assert heights[last - (last - first) // 4] < heights[first + (last - first) // 4] - 4
