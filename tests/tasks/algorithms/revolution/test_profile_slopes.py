"""Slopes of a profile that most candidates of a circle show, among false ones."""

from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.revolution.profile_slopes import (
    CHANCE_SHARE,
    COUNTED_SLOPES_DEG,
    ShownSlopes,
    with_shown_slopes,
)
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from glint.tasks.algorithms.silhouettes.reflection_axes import ReflectionAxis

UPRIGHT = ReflectionAxis(np.zeros(2), np.array([1.0, 0.0]), 1.0)


def vase(tilt: float = 12.0) -> SurfaceOfRevolution:
    """Return a vase whose wall waves by about ten degrees."""
    heights = np.arange(-60.0, 60.5, 0.5)
    radii = 40.0 + 2.0 * np.sin(heights / 11.0)
    radii[[0, -1]] = 0.0
    return SurfaceOfRevolution(UPRIGHT, np.radians(tilt), heights, radii**2, np.gradient(radii**2, heights) / 2.0)


def with_flat_wall(surface: SurfaceOfRevolution, slope_deg: float = 0.0) -> SurfaceOfRevolution:
    """Return the surface with the same slope all along its wall, as far as its normals tell."""
    radii, wall = np.sqrt(surface.squared_radii), np.abs(surface.heights) < 59.0
    return replace(surface, half_slopes=np.where(wall, -radii * np.tan(np.radians(slope_deg)), surface.half_slopes))


class Wall:
    """Pixels on the wall of a vase, its true normals, and the angle of each pixel around the axis."""

    def __init__(self) -> None:
        self.vase = vase()
        columns, rows = np.meshgrid(np.arange(140) - 69.5, np.arange(200) - 99.5)
        x, y = columns.ravel(), -rows.ravel()
        hits = self.vase.intersect(x, y)
        inside = np.abs(np.nan_to_num(hits.heights, nan=99.0)) < 55.0
        self.x, self.y = x[inside], y[inside]
        self.normals = self.vase.normals(self.x, self.y)
        self.upward, self.heights = hits.upward[inside], hits.heights[inside]
        self.azimuth = np.arctan2(hits.across[inside], hits.forward[inside])

    def tilted(self, degrees: float | np.ndarray) -> np.ndarray:
        """Return the normals turned towards the axis by an angle, for all pixels or each."""
        flat = unit(self.normals - (self.normals * self.upward).sum(axis=1)[:, None] * self.upward)
        slope = np.arcsin((self.normals * self.upward).sum(axis=1)) + np.radians(degrees)
        return np.asarray(np.cos(slope)[:, None] * flat + np.sin(slope)[:, None] * self.upward)

    def error(self, surface: SurfaceOfRevolution) -> float:
        """Return the mean angle in degrees of a surface's normals to the true ones."""
        return float(angles(surface.normals(self.x, self.y), self.normals).mean())

    def corrected(self, candidates: np.ndarray, start: SurfaceOfRevolution | None = None) -> float:
        """Return the error of a surface whose slopes candidates (K, N, 3) correct."""
        return self.error(self.with_slopes(candidates, start or with_flat_wall(self.vase)))

    def with_slopes(self, candidates: np.ndarray, start: SurfaceOfRevolution) -> SurfaceOfRevolution:
        """Return a surface with the slopes that candidates (K, N, 3) show on it."""
        return with_shown_slopes(start, ShownSlopes.on(start, self.x, self.y, candidates))

    def rivalry(self, candidates: np.ndarray) -> float:
        """Return the median rivalry of other slopes than the true ones, half a radius around the middle of the wall."""
        shown = ShownSlopes.on(self.vase, self.x, self.y, candidates)
        return float(np.median(shown.rivalry(self.vase.slope_angles)[np.abs(self.vase.heights) < 30.0]))


@pytest.fixture(scope="module")
def wall() -> Wall:
    return Wall()


def noisy(normals: np.ndarray, degrees: float) -> np.ndarray:
    return unit(normals + np.random.default_rng(0).normal(0.0, np.radians(degrees), normals.shape))


def test_noisy_candidates_give_the_slope_of_a_whole_circle(wall: Wall) -> None:
    shown = np.where((np.abs(wall.azimuth) < 0.7)[:, None], noisy(wall.normals, 1.5), np.nan)
    assert wall.error(with_flat_wall(wall.vase)) > 6.0
    assert wall.corrected(shown[None]) < 0.7


@pytest.mark.parametrize("is_first", [True, False])
def test_a_false_sheet_that_changes_around_the_axis_does_not_bend_the_profile(wall: Wall, is_first: bool) -> None:
    true, false = noisy(wall.normals, 1.0), wall.tilted(20.0 * np.cos(2.0 * wall.azimuth))
    sheets = np.stack([false, true] if is_first else [true, false])
    assert wall.corrected(sheets) < 0.8


def test_a_false_sheet_of_fewer_pixels_does_not_bend_the_profile(wall: Wall) -> None:
    is_shown = np.random.default_rng(1).random(len(wall.x)) < 0.4
    false = np.where(is_shown[:, None], wall.tilted(9.0), np.nan)
    true = np.where((np.random.default_rng(2).random(len(wall.x)) < 0.6)[:, None], noisy(wall.normals, 1.0), np.nan)
    assert wall.corrected(np.stack([false, true])) < 1.5


def test_normals_beside_the_plane_through_the_axis_show_no_slope(wall: Wall) -> None:
    sideways = np.cross(wall.upward, wall.normals)
    turned = unit(wall.tilted(15.0) + 0.25 * sideways)
    assert wall.corrected(np.stack([turned, noisy(wall.normals, 1.0)])) < 0.8


def test_stray_candidates_change_a_circle_at_most(wall: Wall) -> None:
    stray = np.full((1, *wall.normals.shape), np.nan)
    stray[0, ::300] = wall.tilted(20.0)[::300]
    start = with_flat_wall(wall.vase)
    corrected = wall.with_slopes(stray, start)
    changed = angles(corrected.normals(wall.x, wall.y), start.normals(wall.x, wall.y)) > 0.1
    assert changed.mean() < 0.02


def test_candidates_far_from_the_contours_slope_belong_to_another_wall(wall: Wall) -> None:
    start = with_flat_wall(wall.vase, -45.0)
    assert wall.corrected(wall.tilted(30.0)[None], start) == pytest.approx(wall.error(start), abs=0.5)


def test_radii_and_flat_ends_stay(wall: Wall) -> None:
    corrected = wall.with_slopes(wall.tilted(8.0)[None], wall.vase)
    assert np.array_equal(corrected.squared_radii, wall.vase.squared_radii)
    assert np.array_equal(corrected.half_slopes[[0, -1]], wall.vase.half_slopes[[0, -1]])


def test_no_candidate_at_all_leaves_the_contours_slopes(wall: Wall) -> None:
    nothing = np.full((2, len(wall.x), 3), np.nan)
    corrected = wall.with_slopes(nothing, wall.vase)
    assert np.allclose(corrected.half_slopes, wall.vase.half_slopes)
    none = with_shown_slopes(wall.vase, ShownSlopes.on(wall.vase, np.zeros(0), np.zeros(0), np.zeros((3, 0, 3))))
    assert np.allclose(none.half_slopes, wall.vase.half_slopes)


def test_a_second_sheet_of_the_same_symmetry_is_a_rival(wall: Wall) -> None:
    true, second = noisy(wall.normals, 1.0), noisy(wall.tilted(12.0), 1.0)
    half = np.where((np.arange(len(second)) % 2 == 0)[:, None], second, np.nan)
    assert wall.rivalry(true[None]) < 0.1
    assert wall.rivalry(np.stack([true, half])) == pytest.approx(0.5, abs=0.1)
    assert wall.rivalry(np.stack([true, second])) == pytest.approx(1.0, abs=0.1)


def test_a_sheet_that_changes_around_the_axis_is_none(wall: Wall) -> None:
    false = wall.tilted(40.0 * np.cos(3.0 * wall.azimuth))
    assert wall.rivalry(np.stack([noisy(wall.normals, 1.0), false])) < 0.35


@pytest.mark.parametrize("step", [0.25, 1.0, 2.0])
def test_shares_are_those_of_a_circles_pixels_however_dense_the_samples(wall: Wall, step: float) -> None:
    heights = np.arange(-60.0, 60.5, step)
    radii = np.where(np.abs(heights) < 60.0, 40.0, 0.0)
    cylinder = SurfaceOfRevolution(UPRIGHT, 0.2, heights, radii**2, np.gradient(radii**2, heights) / 2.0)
    is_hit = np.isfinite(cylinder.intersect(wall.x, wall.y).heights)
    x, y = wall.x[is_hit], wall.y[is_hit]
    inside = np.abs(cylinder.intersect(x, y).heights) < 50.0
    x, y = x[inside], y[inside]
    normals = cylinder.normals(x, y)
    half = np.where((np.arange(len(x)) % 2 == 0)[:, None], normals, np.nan)
    middle = np.abs(heights) < 40.0
    level = COUNTED_SLOPES_DEG == 0
    # Half of the pixels show nothing: they are no pixels of the circle.
    for shown in (normals, half):
        shares = ShownSlopes.on(cylinder, x, y, shown[None]).shares
        assert shares[middle][:, level] == pytest.approx(1.0, abs=0.02)
        assert shares[middle][:, np.abs(COUNTED_SLOPES_DEG) > 12].max() < 0.01
    both = np.stack([normals, half])
    assert ShownSlopes.on(cylinder, x, y, both).shares[middle][:, level].max() == 1.0


def test_a_circle_of_few_pixels_shows_small_shares() -> None:
    few = ShownSlopes(np.zeros(1), np.ones(1), np.array([50]), np.bincount([50], minlength=101), 0.5)
    assert few.shares.max() < CHANCE_SHARE


def test_few_normals_move_the_mean_slope_a_part_of_the_way() -> None:
    def residual(count: int) -> np.ndarray:
        slopes, samples = np.full(count, 0.05), np.full(count, 50)
        return ShownSlopes(slopes, np.ones(count), samples, np.zeros(101), 0.5).mean_residual(np.zeros(101))

    one, many = residual(1), residual(1000)
    assert 0.0 < one[50] < 0.005 and 0.049 < many[50] < 0.05
    assert one.argmax() == 50 and (one >= 0.0).all() and one[40] == 0.0


def test_the_mean_slope_is_smoothed_over_the_same_length_whatever_the_step() -> None:
    def width(step: float) -> float:
        samples = np.full(5, round(10.0 / step))
        shown = ShownSlopes(np.full(5, 0.05), np.ones(5), samples, np.zeros(round(20.0 / step) + 1), step)
        residual = shown.mean_residual(np.zeros(len(shown.circles)))
        return step * float((residual > residual.max() / 2.0).sum())

    assert width(0.1) == pytest.approx(width(0.2), abs=0.3)
