import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.prior.smooth_normals import field_spread, inradius, rim_normals, smooth_field


def disc(size: int = 101, radius: float = 45.0) -> tuple[np.ndarray, np.ndarray]:
    """Mask and true normals of a hemisphere facing the camera."""
    rows, columns = np.indices((size, size)) - (size - 1) / 2
    inside = rows**2 + columns**2 < radius**2
    z = np.sqrt(np.maximum(radius**2 - rows**2 - columns**2, 0.0))
    return inside, np.where(inside[..., None], np.stack([columns, -rows, z], axis=-1) / radius, np.nan)


def test_rim_normals_point_outwards_in_the_image_plane() -> None:
    mask, truth = disc()
    rim, normals = rim_normals(mask)
    assert rim.sum() > 200 and not (rim & ~mask).any()
    outward = truth[rim][:, :2] / np.linalg.norm(truth[rim][:, :2], axis=1, keepdims=True)
    assert (normals[rim][:, :2] * outward).sum(axis=1).min() > np.cos(np.radians(6))
    assert np.all(normals[rim][:, 2] == 0) and np.isnan(normals[~rim]).all()


def test_where_the_region_cuts_the_object_there_is_no_rim() -> None:
    mask, truth = disc()
    mask, truth = mask[30:], truth[30:]
    rim, normals = rim_normals(mask)
    assert not rim[0].any()
    outward = truth[rim][:, :2] / np.linalg.norm(truth[rim][:, :2], axis=1, keepdims=True)
    assert (normals[rim][:, :2] * outward).sum(axis=1).min() > np.cos(np.radians(6))


def test_a_mask_that_fills_the_region_has_no_rim() -> None:
    assert not rim_normals(np.ones((20, 30), dtype=bool))[0].any()


def test_field_between_rim_normals_is_the_sphere() -> None:
    mask, truth = disc()
    rim, normals = rim_normals(mask)
    field = smooth_field(mask).solve(normals, rim.astype(float))
    assert np.nanmean(((field - truth) ** 2).sum(axis=-1)) < 0.02
    assert np.isnan(field[~mask]).all()
    assert np.allclose(np.linalg.norm(field[mask], axis=1), 1.0, atol=1e-5) and field[mask][:, 2].min() >= 0


def test_accepted_normals_pull_the_field() -> None:
    mask, truth = disc()
    rim, normals = rim_normals(mask)
    known = mask & (truth[..., 2] > 0.8)
    targets = np.where(known[..., None], truth, normals)
    field = smooth_field(mask).solve(targets, np.where(known, 0.1, rim * 1.0))
    assert np.nanmean(((field - truth) ** 2).sum(axis=-1)) < 0.003
    assert angles(field[known], truth[known]).max() < 1.0


@pytest.mark.parametrize("nodes", [500, 2000])
def test_a_coarser_grid_gives_nearly_the_same_field(nodes: int) -> None:
    mask, _ = disc()
    rim, normals = rim_normals(mask)
    fine = smooth_field(mask).solve(normals, rim.astype(float))
    coarse = smooth_field(mask, max_nodes=nodes).solve(normals, rim.astype(float))
    assert np.median(angles(fine[mask], coarse[mask])) < 3.0


def test_two_components_do_not_feel_each_other() -> None:
    mask, _ = disc()
    both = np.hstack([mask, mask])
    rim, normals = rim_normals(both)
    field = smooth_field(both)
    left = np.zeros_like(both)
    left[:, :101] = rim[:, :101]
    alone = field.solve(normals, left.astype(float))
    together = field.solve(normals, rim.astype(float))
    assert np.allclose(alone[:, :101][mask], together[:, :101][mask], atol=1e-3)


def test_spread_grows_with_the_distance_and_stops() -> None:
    known = np.zeros((5, 200), dtype=bool)
    known[:, 0] = True
    spread = np.degrees(field_spread(known, scale=50.0, near=4.0, growth=25.0, most=30.0))
    assert np.allclose(spread[:, 0], 4.0) and np.allclose(spread[:, 50], 29.0) and np.allclose(spread[:, 150], 30.0)
    assert np.allclose(np.degrees(field_spread(np.zeros((3, 3), dtype=bool), 10.0, most=30.0)), 30.0)


def test_inradius_of_a_disc_is_its_radius() -> None:
    assert abs(inradius(disc()[0]) - 45.0) < 1.0
