from collections.abc import Callable

import numpy as np

from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.prior.lit_pixels import LitPixels
from glint.tasks.algorithms.prior.smooth_normals import smooth_normal_field
from glint.tasks.algorithms.prior.unreached import _integrable, unreached_normals, with_unreached
from tests.tasks.algorithms.prior.swept_cones import INRADIUS, SWEEP_DEG, swept_cone, tilted


def groove() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mask, true normals and what the lights show of a plane with a groove that is deepest in its middle."""
    rows, columns = np.indices((91, 91)) - 45.0
    depth = 10.0 * np.exp(-((rows / 18.0) ** 2)) * np.exp(-((columns / 5.0) ** 2))
    across, up = 2.0 * columns / 25.0 * depth, -2.0 * rows / 324.0 * depth
    truth = unit(np.stack([-across, -up, np.ones(rows.shape)], axis=-1))
    return rows**2 + columns**2 < 44.0**2, truth, truth[..., 2] > np.cos(np.radians(SWEEP_DEG))


def solver(mask: np.ndarray, truth: np.ndarray, known: np.ndarray) -> Callable[[np.ndarray | None], np.ndarray]:
    surface = smooth_normal_field(mask)

    def solve(unreached: np.ndarray | None) -> np.ndarray:
        targets, weights = np.where(known[..., None], truth, np.nan), np.where(known, 0.1, 0.0)
        if unreached is not None:
            targets, weights = with_unreached(targets, weights, unreached, 0.1)
        return surface.solve(targets, weights)

    return solve


def test_walls_of_a_groove_are_steep_and_face_each_other() -> None:
    mask, truth, known = groove()
    solve = solver(mask, truth, known)
    field = solve(None)
    found = unreached_normals(field, known * 0.95, LitPixels(known, mask, INRADIUS, swept_cone()), solve)
    assert found is not None
    unreached, bent = found
    hidden = mask & ~known
    before, after = angles(field[hidden], truth[hidden]), angles(bent[hidden], truth[hidden])
    assert before.mean() > 25.0 and after.mean() < 0.7 * before.mean()
    dark = np.isfinite(unreached[..., 0])
    assert not (dark & known).any() and (dark & hidden).sum() > 0.7 * hidden.sum()
    assert (np.sign(unreached[dark][:, 0]) == np.sign(truth[dark][:, 0])).mean() > 0.9


def test_where_something_may_be_a_true_highlight_nothing_is_dark() -> None:
    mask, truth, known = groove()
    solve = solver(mask, truth, known)
    assert unreached_normals(solve(None), known * 0.95, LitPixels(mask, mask, INRADIUS, swept_cone()), solve) is None


def test_where_most_is_dark_darkness_says_nothing() -> None:
    mask, truth, known = groove()
    solve = solver(mask, truth, known)
    few = known & (np.random.default_rng(0).random(mask.shape) < 0.4)
    assert unreached_normals(solve(None), few * 0.95, LitPixels(few, mask, INRADIUS, swept_cone()), solve) is None


def test_what_the_lights_show_stays_as_it_is() -> None:
    mask, truth, _ = groove()
    solve = solver(mask, truth, mask)
    assert unreached_normals(solve(None), mask * 0.95, LitPixels(mask, mask, INRADIUS, swept_cone()), solve) is None


def test_other_data_come_before_dark_pixels() -> None:
    targets, weights = np.zeros((1, 3, 3)), np.array([[0.1, 0.0, 0.0]])
    unreached = np.array([[tilted(50.0), tilted(50.0), np.full(3, np.nan)]])
    merged, pull = with_unreached(targets, weights, unreached, 0.03)
    assert pull.tolist() == [[0.1, 0.03, 0.0]]
    assert np.array_equal(merged[0], [targets[0, 0], unreached[0, 1], targets[0, 2]])


def test_integrable_normals_are_those_of_the_surface_that_accepted_ones_show() -> None:
    rows, columns = np.indices((61, 71)) - 30.0
    p, q = 0.4 * np.cos(columns / 15.0), 0.3 * np.sin(rows / 12.0)
    truth, mask = unit(np.stack([-p, -q, np.ones(p.shape)], axis=-1)), np.hypot(rows, columns) < 29.0
    inner = np.hypot(rows, columns) < 26.0
    found = _integrable(truth, np.ones(mask.shape), mask)
    assert angles(found, truth)[inner].max() < 1.0
    # What nothing tells bends to what accepted normals around it do.
    hole = np.hypot(rows - 5.0, columns) < 6.0
    field = np.where(hole[..., None], tilted(60.0), truth)
    bent = angles(_integrable(field, np.where(hole, 0.0, 1.0), mask), truth)
    assert bent[hole].mean() < 0.25 * angles(field, truth)[hole].mean() and bent[inner & ~hole].mean() < 0.5
