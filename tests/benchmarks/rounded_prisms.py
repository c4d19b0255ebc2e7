"""Right prisms with rounded edges: errors of their normals without the hypothesis of rounded prisms, and with it.

    python -m tests.benchmarks.rounded_prisms [--seed 600000] [--count 24] [--folder DIR]

Boxes, and prisms of three to six sides. Their sizes, the radius of their edges (8 to 40% of the smallest half width),
and how far the camera looks down on them follow from each capture's seed, like all else (see `random_captures`); mask
and spheres are given. Of each it prints the mean error in degrees, the share of the mask at confidence 0.95, and of
these the share within 5 degrees; at last the geometric means of the errors.
"""

import random

import numpy as np

from glint.tasks.algorithms.meshing.implicit import ImplicitFunction
from glint.tasks.algorithms.prisms.rounded_contour import distances_from_polygon
from glint.tasks.algorithms.simulation.solids import Solid, from_implicit
from tests.benchmarks.right_prisms import ROUNDED, comparison_parser, print_comparisons

CELL = 2.0
"""Edge of the cells in which a solid is meshed."""


def rounded_prism(section: np.ndarray, half_height: float, radius: float) -> ImplicitFunction:
    """Return the distance from a prism about the y axis that a ball has grown.

    section: (N, 2), corners of the section that the ball has not grown, x and z, counter-clockwise. half_height: of the
    whole solid.
    """

    def function(points: np.ndarray) -> np.ndarray:
        beyond = np.maximum(np.abs(points[:, 1]) - half_height + radius, 0.0)
        return np.hypot(distances_from_polygon(points[:, [0, 2]], section), beyond) - radius

    return function


def random_solid(seed: int) -> tuple[str, list[Solid], float]:
    """Return the name of a rounded prism, its solid, and the tilt in degrees at which the camera looks down on it."""
    draw = random.Random(seed)
    half_height, turn = draw.uniform(40.0, 100.0), draw.uniform(0.0, 2.0 * np.pi)
    sides = draw.choice([4, 4, 4, 3, 5, 6])
    if sides == 4:
        half = draw.uniform(45.0, 100.0), draw.uniform(45.0, 100.0)
        corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) * half
    else:
        half = (draw.uniform(45.0, 80.0),) * 2
        angles = 2.0 * np.pi * np.arange(sides) / sides
        corners = np.column_stack([np.cos(angles), np.sin(angles)]) * half[0] / np.cos(np.pi / sides)
    least = min(*half, half_height)
    radius = draw.uniform(0.08, 0.4) * least
    cosine, sine = np.cos(turn), np.sin(turn)
    # Towards the axis by the radius, along the diagonals.
    inward = 1.0 - radius / np.array(half)
    section = (corners * inward) @ np.array([[cosine, sine], [-sine, cosine]])
    reach = float(np.linalg.norm(corners, axis=1).max())
    box = np.array([reach, half_height + CELL, reach])
    solid = from_implicit(rounded_prism(section, half_height, radius), -box, box, CELL)
    return "box" if sides == 4 else f"prism of {sides} sides", [solid], draw.uniform(8.0, 45.0)


def main() -> None:
    """Compare rounded prisms."""
    print_comparisons(random_solid, comparison_parser(__doc__, seed=600000).parse_args(), ROUNDED)


if __name__ == "__main__":
    main()
