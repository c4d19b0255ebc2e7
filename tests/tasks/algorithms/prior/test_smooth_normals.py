import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.prior.smooth_normals import contour_normals, smooth_normal_field


def disc(size: int = 101, radius: float = 45.0) -> tuple[np.ndarray, np.ndarray]:
    """Return mask and true normals of a hemisphere facing the camera."""
    rows, columns = np.indices((size, size)) - (size - 1) / 2
    inside = rows**2 + columns**2 < radius**2
    z = np.sqrt(np.maximum(radius**2 - rows**2 - columns**2, 0.0))
    return inside, np.where(inside[..., None], np.stack([columns, -rows, z], axis=-1) / radius, np.nan)


def test_contour_normals_point_outwards_in_the_image_plane() -> None:
    mask, truth = disc()
    contour, normals = contour_normals(mask)
    assert contour.sum() > 200 and not (contour & ~mask).any()
    outward = truth[contour][:, :2] / np.linalg.norm(truth[contour][:, :2], axis=1, keepdims=True)
    assert (normals[contour][:, :2] * outward).sum(axis=1).min() > np.cos(np.radians(6))
    assert np.all(normals[contour][:, 2] == 0) and np.isnan(normals[~contour]).all()


def test_a_cut_by_the_regions_border_is_no_contour() -> None:
    mask, truth = disc()
    mask, truth = mask[30:], truth[30:]
    contour, normals = contour_normals(mask)
    assert not contour[0].any()
    outward = truth[contour][:, :2] / np.linalg.norm(truth[contour][:, :2], axis=1, keepdims=True)
    assert (normals[contour][:, :2] * outward).sum(axis=1).min() > np.cos(np.radians(6))


def test_a_mask_that_fills_the_region_has_no_contour() -> None:
    assert not contour_normals(np.ones((20, 30), dtype=bool))[0].any()


def test_field_between_contour_normals_is_the_sphere() -> None:
    mask, truth = disc()
    contour, normals = contour_normals(mask)
    field = smooth_normal_field(mask).solve(normals, contour.astype(float))
    assert np.nanmean(((field - truth) ** 2).sum(axis=-1)) < 0.02
    assert np.isnan(field[~mask]).all()
    assert np.allclose(np.linalg.norm(field[mask], axis=1), 1.0, atol=1e-5) and field[mask][:, 2].min() >= 0


def test_accepted_normals_pull_the_field() -> None:
    mask, truth = disc()
    contour, normals = contour_normals(mask)
    known = mask & (truth[..., 2] > 0.8)
    targets = np.where(known[..., None], truth, normals)
    field = smooth_normal_field(mask).solve(targets, np.where(known, 0.1, contour * 1.0))
    assert np.nanmean(((field - truth) ** 2).sum(axis=-1)) < 0.003
    assert angles(field[known], truth[known]).max() < 1.0


@pytest.mark.parametrize("nodes", [500, 2000])
def test_a_coarser_grid_gives_nearly_the_same_field(nodes: int) -> None:
    mask, _ = disc()
    contour, normals = contour_normals(mask)
    fine = smooth_normal_field(mask).solve(normals, contour.astype(float))
    coarse = smooth_normal_field(mask, max_nodes=nodes).solve(normals, contour.astype(float))
    assert np.median(angles(fine[mask], coarse[mask])) < 3.0


def test_two_components_do_not_influence_one_another() -> None:
    mask, _ = disc()
    pair = np.hstack([mask, mask])
    contour, normals = contour_normals(pair)
    field = smooth_normal_field(pair)
    left = np.zeros_like(pair)
    left[:, :101] = contour[:, :101]
    alone = field.solve(normals, left.astype(float))
    together = field.solve(normals, contour.astype(float))
    assert np.allclose(alone[:, :101][mask], together[:, :101][mask], atol=1e-3)
