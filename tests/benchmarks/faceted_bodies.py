"""Random faceted bodies: errors of their normals without the hypotheses of solids of flat faces, and with them.

    python -m tests.benchmarks.faceted_bodies [--seed 93000] [--count 24] [--folder DIR]

Blocks, bottles with a round neck, and open tumblers take turns. Three to ten equal sides and their lean, the height,
shoulders, walls, the rounding of the edges, the turn, and how far the camera looks down follow from each capture's
seed, like all else (see `random_captures`); mask and spheres are given. Of each it prints the mean error in degrees,
the share of the mask at confidence 0.95, and of these the share within 5 degrees; at last the geometric means.
"""

import random

import numpy as np

from glint.tasks.algorithms.meshing.implicit import ImplicitFunction, capsule, polyhedron, union
from glint.tasks.algorithms.simulation.solids import Solid, from_implicit
from tests.benchmarks.right_prisms import comparison_parser, print_comparisons

KINDS = ("block", "bottle", "tumbler")
HALF_WIDTH, CELL = 125.0, 1.8
"""Half the sides of the box across the axis in which a solid is meshed, and the edge of its cells."""


def random_solid(kind: str, seed: int) -> tuple[list[Solid], float]:
    """Return a faceted body, and the tilt in degrees at which the camera looks down on it."""
    draw = random.Random(seed)
    sides, turn = draw.choice([3, 4, 4, 5, 6, 6, 8, 8, 10]), draw.uniform(0.0, 360.0)
    half_height, rounding = draw.uniform(45.0, 85.0), draw.choice([0.8, 1.2, 2.0])
    lean = {"block": draw.uniform(-14.0, 24.0), "bottle": draw.uniform(-3.0, 5.0), "tumbler": draw.uniform(-10.0, 0.0)}
    faces = [*_ring(sides, turn, lean[kind], 55.0), (0.0, -1.0, 0.0, half_height), (0.0, 1.0, 0.0, half_height)]
    tilt, top = draw.uniform(12.0, 40.0), half_height
    solid: ImplicitFunction
    if kind == "bottle":
        shoulder, neck = draw.uniform(30.0, 60.0), draw.uniform(13.0, 22.0)
        faces += _ring(sides, turn, shoulder, (half_height - 20.0) * np.sin(np.radians(shoulder)) + 40.0)
        top = half_height + draw.uniform(25.0, 50.0)
        solid = union([polyhedron(faces, rounding), capsule((0, 0, 0), (0, top - neck, 0), neck, neck)], 1.5)
    elif kind == "tumbler":
        base = -half_height + draw.uniform(12.0, 30.0)
        outside, hollow = polyhedron(faces, rounding), capsule((0, base + 40.0, 0), (0, 200.0, 0), 40.0, 46.0)
        solid = _difference(outside, hollow)
    else:
        solid = polyhedron(faces, rounding)
    low, high = np.array([-HALF_WIDTH, -half_height - 6.0, -HALF_WIDTH]), np.array([HALF_WIDTH, top + 6.0, HALF_WIDTH])
    return [from_implicit(solid, low, high, CELL)], tilt


def _ring(sides: int, turn: float, lean: float, distance: float) -> list[tuple[float, ...]]:
    """Return the faces (n_x, n_y, n_z, distance) of a ring about the y axis; angles in degrees."""
    up, out = np.sin(np.radians(lean)), np.cos(np.radians(lean))
    azimuths = np.radians(turn + 360.0 * np.arange(sides) / sides)
    return [(float(out * np.sin(angle)), float(up), float(out * np.cos(angle)), distance) for angle in azimuths]


def _difference(outside: ImplicitFunction, hollow: ImplicitFunction) -> ImplicitFunction:
    """Return the first solid without the second."""

    def function(points: np.ndarray) -> np.ndarray:
        return np.maximum(outside(points), -hollow(points))

    return function


def main() -> None:
    """Compare blocks, bottles and tumblers in turns."""

    def solid_of(seed: int) -> tuple[str, list[Solid], float]:
        kind = KINDS[seed % len(KINDS)]
        return kind, *random_solid(kind, seed)

    print_comparisons(solid_of, comparison_parser(__doc__, seed=93000).parse_args())


if __name__ == "__main__":
    main()
