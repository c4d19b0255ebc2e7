"""Pressed and cut glass: vessels whose walls carry the same relief all round. Implicit functions, y up."""

from collections.abc import Callable

import numpy as np

from glint.tasks.algorithms.meshing.implicit import ImplicitFunction, ellipsoid, revolved

Pattern = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Height of a relief, in units of the points, at angles about the axis (radians) and heights along it."""


def with_relief(solid: ImplicitFunction, pattern: Pattern) -> ImplicitFunction:
    """Return a solid that stands out by a pattern about the y axis; f approximates the distance where that is low."""

    def function(points: np.ndarray) -> np.ndarray:
        return solid(points) - pattern(np.arctan2(points[:, 0], points[:, 2]), points[:, 1])

    return function


def flat_below(solid: ImplicitFunction, height: float) -> ImplicitFunction:
    """Return what of a solid lies above a height; f is a bound of the distance from it where that of the solid is."""

    def function(points: np.ndarray) -> np.ndarray:
        return np.maximum(solid(points), height - points[:, 1])

    return function


def _between(height: np.ndarray, low: float, high: float, fade: float) -> np.ndarray:
    """Return 1 between two heights, 0 beyond them, with a smooth step of a width at both."""
    share = np.clip((np.minimum(height - low, high - height) + fade / 2) / fade, 0.0, 1.0)
    return np.asarray(share * share * (3.0 - 2.0 * share))


def hobnail_vase() -> ImplicitFunction:
    """Return a solid bellied vase with staggered rows of 16 round hobnails."""

    def hobnails(angle: np.ndarray, height: np.ndarray) -> np.ndarray:
        row = np.pi * height / 11.0
        bumps = 0.5 + 0.5 * np.cos(16.0 * angle) * np.cos(row)
        return 3.2 * bumps**2 * _between(height, -52.0, 44.0, 8.0)

    profile = ((0, -88), (40, -88), (42, -80), (34, -70), (50, -40), (56, 0), (48, 40), (32, 66), (38, 86), (0, 86))
    return with_relief(revolved(profile, 3.0), hobnails)


def ribbed_bottle() -> ImplicitFunction:
    """Return a solid bottle with 20 upright ribs on its body."""

    def ribs(angle: np.ndarray, height: np.ndarray) -> np.ndarray:
        return 1.6 * (1.0 + np.cos(20.0 * angle + 0.4)) * _between(height, -70.0, 18.0, 10.0)

    profile = ((0, -90), (50, -90), (54, -82), (54, 20), (40, 44), (16, 60), (15, 96), (0, 97))
    return with_relief(revolved(profile, 3.0), ribs)


def cut_bowl() -> ImplicitFunction:
    """Return a solid ball, flat below, cut with two crossing sets of 24 slanting grooves."""

    def diamonds(angle: np.ndarray, height: np.ndarray) -> np.ndarray:
        first, second = np.cos(24.0 * angle + 0.16 * height), np.cos(24.0 * angle - 0.16 * height)
        return -1.4 * (np.maximum(first, 0.0) ** 2 + np.maximum(second, 0.0) ** 2) * _between(height, -40.0, 34.0, 8.0)

    return flat_below(with_relief(ellipsoid((0, 0, 0), (72, 62, 72)), diamonds), -58.6)
