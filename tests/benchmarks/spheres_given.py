"""Given circles of chrome spheres, right and wrong on purpose, and the circles that are used.

    python -m tests.benchmarks.spheres_given FIRST-LAST

Captures are numbered as those of `tests.benchmarks.spheres_found`. Each circle is given as it is, beside its place
(seeded directions), and too small or too large. A line per way of giving: how many used circles are off by more than
4% of the radius when highlights contradict a fit from three standard deviations, and from CORRECTION_DEVIATIONS.
"""

import argparse
from collections import Counter
from dataclasses import replace
from unittest.mock import patch

import numpy as np

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.stages import sphere_doubts
from tests.benchmarks.spheres_found import simulated

SHIFTS, RATIOS = (0.0, 0.02, 0.05, 0.1), (0.9, 0.95, 1.05, 1.1)
"""Distances from the true centre, in radii, and factors of the true radius."""
COUNTED_SHARE = 0.04
"""Error in radii from which a used circle counts as wrong."""
LIMITS = (3.0, sphere_doubts.CORRECTION_DEVIATIONS)


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


def is_wrong(frames: np.ndarray, given: Sphere, truth: Sphere, limit: float) -> bool:
    """Return whether the circle that is used for a given one is off."""
    with patch.object(sphere_doubts, "CORRECTION_DEVIATIONS", limit):
        ((used,), _) = sphere_doubts.confirm_given(frames, [given], None)
    return max(used.distance(truth) / truth.radius, abs(used.radius / truth.radius - 1.0)) > COUNTED_SHARE


def main() -> None:
    """Print the numbers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("numbers", metavar="FIRST-LAST")
    first, last = (int(number) for number in parser.parse_args().numbers.split("-"))
    wrong, count = Counter[tuple[str, float]](), 0
    for number in range(first, last + 1):
        for name, sample, truth in simulated(number):
            count += 1
            for kind, given in given_circles(truth, np.random.default_rng(number)).items():
                outcomes = {limit: is_wrong(sample.frames, given, truth, limit) for limit in LIMITS}
                wrong.update({(kind, limit): int(outcome) for limit, outcome in outcomes.items()})
                if any(outcomes.values()):
                    print(f"{name}, given {kind}: wrong {outcomes}", flush=True)
    for kind in given_circles(Sphere(0.0, 0.0, 1.0), np.random.default_rng(0)):
        print(f"{kind}: of {count} wrong " + ", ".join(f"{wrong[kind, limit]} ({limit})" for limit in LIMITS))


if __name__ == "__main__":
    main()
