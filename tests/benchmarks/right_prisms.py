"""Right prisms of random polygons: errors of their normals without the hypotheses of solids of flat faces, and with.

    python -m tests.benchmarks.right_prisms [--seed 77000] [--count 24] [--lean 0] [--folder DIR]

Three to eight sides, their distances from the axis, the height, the rounding of the edges, and how far the camera looks
down on the prism or up to it follow from each capture's seed, like all else (see `random_captures`); mask and spheres
are given. With `--lean 8` the sides lean inwards by 8 to 25 degrees, so that the solids are frusta and no right prisms.
Of each it prints the mean error in degrees, the share of the mask at confidence 0.95, and of these the share within 5
degrees; at last the geometric means of the errors.
"""

import argparse
import random
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from unittest.mock import patch

import numpy as np

from glint.tasks.algorithms.facets.faceted_normals import FacetSearch
from glint.tasks.algorithms.meshing.implicit import polyhedron
from glint.tasks.algorithms.prisms.prismatic_normals import PrismSearch
from glint.tasks.algorithms.prisms.rounded_normals import RoundedPrismSearch
from glint.tasks.algorithms.simulation import shapes
from glint.tasks.algorithms.simulation.solids import Solid, from_implicit
from tests.benchmarks.random_captures import Measured, measure, random_capture

SHAPE = "hexagonal-prism"
"""Shape whose solid and tilt are replaced."""
HALF_SIDE, CELL = 150.0, 2.5
"""Half the side of the box in which a solid is meshed, and the edge of its cells."""
Searches = Mapping[type, tuple[str, object]]
"""Searches for solids: the name of what they find, and its value where they find nothing."""
ROUNDED: Searches = {RoundedPrismSearch: ("best", None)}
ALL_SEARCHES: Searches = {**ROUNDED, PrismSearch: ("best", None), FacetSearch: ("likeliest", [])}


def random_solid(seed: int, lean_deg: float) -> tuple[list[Solid], float]:
    """Return a prism, or with a lean a frustum, and the tilt in degrees at which the camera looks down on it."""
    draw = random.Random(seed)
    sides, start = draw.choice([3, 4, 4, 5, 6, 6, 8]), draw.uniform(0.0, 360.0)
    elevation = np.radians(draw.uniform(lean_deg, 25.0)) if lean_deg else 0.0
    faces = []
    for side in range(sides):
        irregular = 0.0 if sides == 4 else draw.uniform(-0.18, 0.18)
        turn = np.radians(start + 360.0 * (side + irregular) / sides)
        distance = {3: 40.0, 4: (60.0, 48.0)[side % 2]}.get(sides, draw.uniform(52.0, 72.0))
        faces.append((np.sin(turn) * np.cos(elevation), np.sin(elevation), np.cos(turn) * np.cos(elevation), distance))
    half_height, rounding = draw.uniform(35.0, 75.0), draw.choice([1.2, 1.2, 2.5, 4.0])
    ends = [(0.0, 1.0, 0.0, half_height), (0.0, -1.0, 0.0, half_height)]
    tilt = draw.uniform(12.0, 62.0) * draw.choice([1.0, 1.0, 1.0, -1.0])
    box = np.full(3, HALF_SIDE)
    return [from_implicit(polyhedron([*faces, *ends], rounding), -box, box, CELL)], tilt


@contextmanager
def replaced_shape(solids: list[Solid], tilt: float) -> Iterator[None]:
    """Let SHAPE consist of other solids, seen at another tilt in degrees."""
    with patch.dict(shapes.MAKERS, {SHAPE: lambda: solids}), patch.dict(shapes.TILT_DEG, {SHAPE: tilt}):
        shapes.untransformed_solids.cache_clear()
        yield
    shapes.untransformed_solids.cache_clear()


def compare(solids: list[Solid], tilt: float, seed: int, folder: Path, searches: Searches) -> tuple[Measured, Measured]:
    """Return the results of a capture without these hypotheses of solids of flat faces, and with them."""
    with replaced_shape(solids, tilt):
        capture = random_capture(SHAPE, seed, folder, is_given=True)
    with ExitStack() as stack:
        for search, (name, nothing) in searches.items():
            stack.enter_context(patch.object(search, name, nothing))
        without = measure(capture, folder / "without")
    return without, measure(capture, folder / "with")


def print_comparisons(
    solid_of: Callable[[int], tuple[str, list[Solid], float]],
    arguments: argparse.Namespace,
    searches: Searches = ALL_SEARCHES,
) -> None:
    """Print a line per capture as it is measured, and the geometric means of the errors.

    solid_of: returns the name, the solids and the tilt of a seed. arguments: first seed, count and folder. searches:
    hypotheses without and with which captures are measured.
    """
    errors = []
    with tempfile.TemporaryDirectory() as temporary:
        for seed in range(arguments.seed, arguments.seed + arguments.count):
            name, solids, tilt = solid_of(seed)
            results = compare(solids, tilt, seed, (arguments.folder or Path(temporary)) / str(seed), searches)
            errors.append([measured.mean_error for measured in results])
            texts = [f"{m.mean_error:.1f} deg, {m.share:.0%}, {m.right:.1%} right" for m in results]
            print(f"{name}, seed {seed}: without {texts[0]}; with {texts[1]}", flush=True)
    before, after = np.exp(np.log(errors).mean(axis=0))
    print(f"geometric mean of {len(errors)}: without {before:.1f}, with {after:.1f} degrees")


def comparison_parser(description: str | None, seed: int) -> argparse.ArgumentParser:
    """Return a parser of the first seed, with this default, of how many captures, and of their folder."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=seed)
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--folder", type=Path, help="folder for captures and stores; a temporary one by default")
    return parser


def main() -> None:
    """Compare prisms, or frusta."""
    parser = comparison_parser(__doc__, seed=77000)
    parser.add_argument("--lean", type=float, default=0.0)
    arguments = parser.parse_args()
    name = "frustum" if arguments.lean else "prism"
    print_comparisons(lambda seed: (name, *random_solid(seed, arguments.lean)), arguments)


if __name__ == "__main__":
    main()
