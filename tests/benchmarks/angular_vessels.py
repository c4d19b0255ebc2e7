"""Square and rectangular vessels: errors of their normals without the hypothesis of such vessels, and with it.

    python -m tests.benchmarks.angular_vessels [--seed 653000] [--count 16] [--folder DIR]

Tumblers, whose walls lean outwards by up to 5 degrees, and bottles with a round neck take turns. Their sizes, the
rounding of their corners, how thick the tumblers' walls are, and how far the camera looks down on them follow from each
capture's seed, like all else (see `random_captures`); mask and spheres are given. Of each it prints the mean error in
degrees, the share of the mask at confidence 0.95, and of these the share within 5 degrees; at last the geometric means
of the errors.
"""

import random
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.angular_bodies.angular_normals import AngularVesselSearch
from glint.tasks.algorithms.meshing.implicit import ImplicitFunction
from glint.tasks.algorithms.simulation.solids import Solid, from_implicit
from tests.benchmarks.right_prisms import Searches, comparison_parser, print_comparisons
from tests.tasks.algorithms.prisms.rendered import rounded_box_distance

CELL = 2.0
"""Edge of the cells in which a solid is meshed."""
ANGULAR: Searches = {AngularVesselSearch: ("best", None)}


@dataclass(frozen=True, slots=True)
class Section:
    """Rounded rectangle about the y axis: half its sides, radius of its corners, and its turn in radians."""

    half: tuple[float, float]
    radius: float
    turn: float

    def distance(self, points: np.ndarray, wall: float = 0.0) -> np.ndarray:
        """Return the distances (N,) of points (N, 2), x and z, from the inner side of a wall of this thickness."""
        radius = max(self.radius - wall, 2.0)
        cosine, sine = np.cos(self.turn), np.sin(self.turn)
        beyond = np.abs(points @ np.array([[cosine, -sine], [sine, cosine]])) - np.array(self.half) + wall + radius
        return rounded_box_distance(beyond, radius)


def smooth_maximum(first: np.ndarray, second: np.ndarray, radius: float) -> np.ndarray:
    """Return the larger of both (N,), rounded where they differ by less than the radius."""
    near = np.maximum(radius - np.abs(first - second), 0.0)
    return np.asarray(np.maximum(first, second) + near**2 / (4.0 * radius))


def tumbler(draw: random.Random) -> tuple[ImplicitFunction, np.ndarray, float]:
    """Return a square tumbler, the half sides (3,) of a box about it, and the tilt at which the camera sees it."""
    half_height, half = draw.uniform(40.0, 75.0), draw.uniform(42.0, 60.0)
    section = Section((half, half), draw.uniform(0.15, 0.5) * half, draw.uniform(0.0, 2.0 * np.pi))
    taper, wall, base = np.tan(np.radians(draw.uniform(0.0, 5.0))), draw.uniform(4.0, 8.0), draw.uniform(8.0, 20.0)
    foot = draw.uniform(2.0, 6.0)

    def function(points: np.ndarray) -> np.ndarray:
        around, height = points[:, [0, 2]] / (1.0 + taper * points[:, 1:2] / half), points[:, 1]
        outside = smooth_maximum(section.distance(around), np.abs(height) - half_height, foot)
        hollow = smooth_maximum(section.distance(around, wall), base - half_height - height, 4.0)
        return smooth_maximum(outside, -hollow, 0.6 * wall)

    return function, np.array([1.6 * half, half_height + 2.0 * CELL, 1.6 * half]), draw.uniform(10.0, 35.0)


def bottle(draw: random.Random) -> tuple[ImplicitFunction, np.ndarray, float]:
    """Return a square or rectangular bottle, as `tumbler`."""
    half_height, half = draw.uniform(60.0, 90.0), draw.uniform(30.0, 45.0)
    sides = half, half * draw.choice([1.0, 1.0, draw.uniform(0.6, 1.0)])
    section = Section(sides, draw.uniform(0.15, 0.5) * min(sides), draw.uniform(0.0, 2.0 * np.pi))
    radius, length, foot = draw.uniform(0.3, 0.48) * min(sides), draw.uniform(18.0, 35.0), draw.uniform(3.0, 8.0)
    shoulder = draw.uniform(6.0, 20.0)

    def function(points: np.ndarray) -> np.ndarray:
        height = points[:, 1]
        body = smooth_maximum(section.distance(points[:, [0, 2]]), np.abs(height) - half_height, foot)
        along = np.abs(height - half_height - length / 2.0) - length / 2.0 - 10.0
        neck = smooth_maximum(np.hypot(points[:, 0], points[:, 2]) - radius, along, 3.0)
        return -smooth_maximum(-body, -neck, shoulder)

    return function, np.array([1.5 * half, half_height + length + 8.0 * CELL, 1.5 * half]), draw.uniform(6.0, 25.0)


def random_solid(seed: int) -> tuple[str, list[Solid], float]:
    """Return the name of a vessel, its solid, and the tilt in degrees at which the camera looks down on it."""
    make = (tumbler, bottle)[seed % 2]
    function, box, tilt = make(random.Random(seed))
    return make.__name__, [from_implicit(function, -box, box, CELL)], tilt


def main() -> None:
    """Compare vessels."""
    print_comparisons(random_solid, comparison_parser(__doc__, seed=653000).parse_args(), ANGULAR)


if __name__ == "__main__":
    main()
