"""Given circles of chrome spheres, right and wrong on purpose, and the circles that are used.

    python -m tests.benchmarks.spheres_given FIRST-LAST [--tables DIR]

Captures are numbered as those of `tests.benchmarks.spheres_found`, or are the scenes of `tests.benchmarks.table_scenes`
in DIR. Each circle is given as it is, beside its place (seeded directions), and too small or too large. A line per way
of giving and rule: how many used circles are off by more than 4% and 8% of the radius, the mean error in radii, the
mean stated standard deviation (the larger of centre's and radius's), and the RMS ratio of both. The rules: as it is;
highlights contradict a fit only from three standard deviations; the clearer circle is used, however far from the given
one it lies; and no rim decides.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.sphere_checks import given_circle
from glint.tasks.stages import sphere_confirmation
from tests.benchmarks.spheres_found import simulated
from tests.benchmarks.table_scenes import table_scenes

SHIFTS, RATIOS = (0.0, 0.02, 0.05, 0.1), (0.9, 0.95, 1.05, 1.1)
"""Distances from the true centre, in radii, and factors of the true radius."""
WRONG, VERY_WRONG = 0.04, 0.08
"""Errors in radii from which a used circle counts as wrong, and as very wrong."""
RULES = {
    "as it is": (),
    "from three deviations": ((sphere_confirmation, "CORRECTION_DEVIATIONS", 3.0),),
    "by contrast alone": ((given_circle, "LEAST_WEIGHT", 1.0),),
    "by edges alone": ((sphere_confirmation, "settled_rim", lambda *_: None),),
}
"""What of the program is changed under each rule."""


def given_circles(truth: Sphere, generator: np.random.Generator) -> dict[str, Sphere]:
    """Return the circles that are given, by name."""
    circles = {}
    for shift in SHIFTS:
        turn = generator.uniform(0.0, 2.0 * np.pi)
        along = shift * truth.radius * np.array([np.cos(turn), np.sin(turn)])
        circles[f"{shift:.0%} beside"] = replace(truth, x=truth.x + along[0], y=truth.y + along[1])
    return circles | {
        f"{ratio - 1:+.0%} of the radius": replace(truth, radius=ratio * truth.radius) for ratio in RATIOS
    }


def used_error(frames: np.ndarray, given: Sphere, truth: Sphere, rule: str) -> tuple[float, float]:
    """Return error and stated deviation, in radii, of the circle that is used for a given one under a rule."""
    with ExitStack() as changes:
        for module, name, value in RULES[rule]:
            changes.enter_context(patch.object(module, name, value))
        ((used,), _) = sphere_confirmation.confirm_given(frames, [given], None)
    error = max(used.distance(truth), abs(used.radius - truth.radius))
    return error / truth.radius, max(used.centre_sd, used.radius_sd) / truth.radius


def captures(numbers: str, tables: Path | None) -> Iterator[tuple[str, np.ndarray, Sphere]]:
    """Yield name, frames and a true circle of each capture in a range of numbers, FIRST-LAST."""
    if tables is not None:
        for scene in table_scenes(numbers, tables):
            yield from ((scene.name, scene.sample.frames, sphere) for sphere in scene.spheres)
        return
    first, last = (int(number) for number in numbers.split("-"))
    for number in range(first, last + 1):
        yield from ((name, sample.frames, truth) for name, sample, truth in simulated(number))


def main() -> None:
    """Print the numbers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("numbers", metavar="FIRST-LAST")
    parser.add_argument("--tables", type=Path, help="folder of scenes on tables")
    arguments = parser.parse_args()
    measured = defaultdict[tuple[str, str], list[tuple[float, float]]](list)
    for order, (name, frames, truth) in enumerate(captures(arguments.numbers, arguments.tables)):
        for kind, given in given_circles(truth, np.random.default_rng(order)).items():
            outcomes = {rule: used_error(frames, given, truth, rule) for rule in RULES}
            for rule, outcome in outcomes.items():
                measured[kind, rule].append(outcome)
            if max(error for error, _ in outcomes.values()) > WRONG:
                texts = [f"{error:.3f}" for error, _ in outcomes.values()]
                print(f"{name}, given {kind}: {', '.join(texts)}", flush=True)
    for (kind, rule), values in measured.items():
        errors, deviations = np.array(values).T
        wrong, very_wrong = (int((errors > limit).sum()) for limit in (WRONG, VERY_WRONG))
        ratio = np.sqrt(((errors / deviations) ** 2).mean())
        print(
            f"{kind}, {rule}: of {len(values)} wrong {wrong}, {very_wrong} very; mean error {errors.mean():.3f},"
            f" deviation {deviations.mean():.3f}, ratio {ratio:.2f}"
        )


if __name__ == "__main__":
    main()
