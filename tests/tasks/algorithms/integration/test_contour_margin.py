import numpy as np
import pytest

from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.integration.contour_margin import contour_of, least_cosines, with_margin


def ball(radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Height, mask and distances to the contour of a sphere."""
    size = int(radius) + 6
    y, x = np.mgrid[-size : size + 1, -size : size + 1] + 0.3
    mask = x**2 + y**2 <= radius**2
    return np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0.0)), mask, radius - np.hypot(x, y)


@pytest.mark.parametrize("radius", [20.4, 80.7])
def test_distances_to_the_contour_of_a_disc(radius: float) -> None:
    _, mask, distance = ball(radius)
    near = mask & (distance < 3.0)
    error = contour_of(mask).distance[near] - distance[near]
    assert abs(error.mean()) < 0.15 and error.std() < 0.15


@pytest.mark.parametrize("radius", [20.4, 80.7])
def test_the_margin_of_a_sphere_follows_from_what_lies_inside(radius: float) -> None:
    height, mask, distance = ball(radius)
    margin = mask & (distance < 1.0)
    damaged = np.where(margin, height - 0.7 * radius, height)
    repaired, extrapolated = with_margin(damaged, mask)
    error = repaired[margin] - height[margin]
    assert extrapolated[margin].all() and not extrapolated[mask & (distance > 2.0)].any()
    assert np.abs(error).max() < 0.12 * radius
    assert np.array_equal(repaired[mask & (distance > 2.0)], height[mask & (distance > 2.0)])


def test_a_flat_plate_stays_flat_and_a_thin_wire_as_it_is() -> None:
    mask = np.zeros((40, 40), bool)
    mask[8:32, 8:32] = True
    assert np.allclose(with_margin(np.full((40, 40), 3.0), mask)[0][mask], 3.0)
    wire = np.zeros((40, 40), bool)
    wire[19:21] = True
    height = np.random.default_rng(0).normal(size=(40, 40))
    repaired, extrapolated = with_margin(height, wire)
    assert np.array_equal(repaired, height) and not extrapolated.any()


def test_a_strip_stays_flat_though_its_margins_meet_the_samples() -> None:
    strip = np.zeros((40, 40), bool)
    strip[16:23] = True
    for level in (-3.0, 3.0):
        height, extrapolated = with_margin(np.full((40, 40), level), strip)
        assert extrapolated.any() and np.allclose(height[strip], level)


def test_a_dish_does_not_rise_towards_its_contour() -> None:
    _, mask, distance = ball(30.4)
    repaired, extrapolated = with_margin(-2.0 * distance, mask)
    assert np.abs(repaired[extrapolated] + 2.0 * 3.0).max() < 1.0


def test_the_edge_of_the_array_is_no_contour() -> None:
    _, mask, _ = ball(30.4)
    cropped = mask[mask.shape[0] // 2 :]
    distance = contour_of(cropped).distance
    assert distance[0, cropped.shape[1] // 2] > 4.0 and contour_of(np.ones((20, 20), bool)).distance.min() > 4.0


def test_a_rise_is_at_most_that_of_the_largest_circle() -> None:
    mask = np.zeros((60, 60), bool)
    mask[10:50, 10:50] = True
    rows = np.minimum(np.arange(60) - 10, 49 - np.arange(60)).astype(float)
    steep = 20.0 * np.minimum(rows[:, None], rows[None])
    drop = 0.5 * (steep[12, 30] + steep[13, 30]) - with_margin(steep, mask)[0][10, 30]
    assert 0.0 < drop < 2.0 * np.sqrt(2.0 * inradius_of(mask))


def test_the_least_cosine_at_the_rim_follows_from_the_largest_circle_inside() -> None:
    mask = np.zeros((55, 200), bool)
    mask[5:, 10:190] = True
    least = least_cosines(mask)
    assert least[5, 100] == least[-1, 100] == pytest.approx(1 / np.sqrt(1 + 25), rel=0.03)
    assert least[7, 100] == least[30, 100] < 0.02
