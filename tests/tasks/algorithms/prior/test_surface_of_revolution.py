from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.prior.reflection_axes import Axis
from glint.tasks.algorithms.prior.surface_of_revolution import Turned, turned_body

UPRIGHT = Axis(np.zeros(2), np.array([1.0, 0.0]), 1.0)


def pixels() -> tuple[np.ndarray, np.ndarray]:
    columns, rows = np.meshgrid(np.arange(140) - 69.5, np.arange(200) - 99.5)
    return columns, -rows


def ribbed(tilt: float) -> Turned:
    """A vase whose wall waves by about seven degrees."""
    heights = np.arange(-60.0, 60.5, 0.5)
    radii = 40.0 + 0.8 * np.sin(heights / 6.0)
    radii[[0, -1]] = 0.0
    return Turned(UPRIGHT, np.radians(tilt), heights, radii**2, np.gradient(radii**2, heights) / 2.0)


def test_a_dome_goes_on_behind_its_shoulder() -> None:
    x, y = pixels()
    body = turned_body(np.hypot(x, y) < 65, UPRIGHT, np.radians(40.0))
    inner = np.hypot(x, y) < 55
    truth = np.stack([x, y, np.sqrt(np.maximum(65.0**2 - x**2 - y**2, 0.0))], axis=-1)[inner] / 65.0
    found = body.normals(x[inner], y[inner])
    assert np.median(angles(found, truth)) < 2.0
    assert np.percentile(angles(found, truth), 95) < 8.0


@pytest.mark.parametrize("tilt", [0.0, 25.0, -25.0])
def test_rays_enter_where_the_body_is_and_its_normals_lead_away(tilt: float) -> None:
    body = ribbed(tilt)
    x, y = (each.ravel() for each in pixels())
    entries, normals = body.entries(x, y), body.normals(x, y)
    inside = np.isfinite(entries.heights)
    assert 0.2 < inside.mean() < 0.8
    assert np.isnan(normals[~inside]).all()
    assert np.allclose(np.linalg.norm(normals[inside], axis=1), 1.0)
    assert (normals[inside, 2] > 0.0).mean() > 0.98
    place = entries.heights[:, None] * body.upward + entries.outward
    assert np.abs(place[inside, 0] - x[inside]).max() < 1e-6
    assert np.abs(place[inside, 1] - y[inside]).max() < 1e-6


def test_normals_on_the_near_side_turn_the_whole_circles_slopes() -> None:
    truth = ribbed(12.0)
    smooth = replace(truth, slopes=np.where(np.abs(truth.heights) < 59.0, 0.0, truth.slopes))
    x, y = (each.ravel() for each in pixels())
    right = truth.normals(x, y)
    inside = np.isfinite(right[:, 0]) & (np.abs(truth.entries(x, y).heights) < 55)
    near = inside & (right[:, 2] > np.cos(np.radians(40.0)))
    noisy = right + np.random.default_rng(0).normal(0, np.radians(1.0), right.shape)
    noisy /= np.linalg.norm(noisy, axis=1, keepdims=True)
    fitted = smooth.fitted_to(x[near], y[near], noisy[near], np.ones(near.sum()))
    beside = inside & ~near
    before, after = (angles(each.normals(x, y), right)[beside].mean() for each in (smooth, fitted))
    assert beside.sum() > 1000
    assert after < 0.25 * before
    assert np.array_equal(fitted.squares, truth.squares)


def test_heavier_normals_turn_slopes_further_and_others_of_another_wall_not_at_all() -> None:
    body = ribbed(0.0)
    x, y = np.zeros(3), np.array([-0.5, 0.0, 0.5])
    at = int(np.argmin(np.abs(body.heights)))
    normals = body.normals(x, y)

    def turned_by(degrees: float, weight: float) -> float:
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        seen = np.column_stack(
            [normals[:, 0], c * normals[:, 1] + s * normals[:, 2], c * normals[:, 2] - s * normals[:, 1]]
        )
        return float(abs(body.fitted_to(x, y, seen, np.full(3, weight)).slopes[at] - body.slopes[at]))

    assert turned_by(5.0, 5.0) > 1.5 * turned_by(5.0, 1.0) > 0.0
    assert turned_by(50.0, 5.0) == 0.0
