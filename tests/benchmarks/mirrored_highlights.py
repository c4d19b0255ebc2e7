"""Circles of chrome and of glass, compared without and with the highlights that a chrome sphere mirrors left out.

    python -m tests.benchmarks.mirrored_highlights FIRST-LAST

Captures are numbered as those of `tests.benchmarks.spheres_found`. Of each it prints the circles that the search
proposes and on which one light shows in half of the frames: the true one, or one of glass, and whether it is refused
for two lights or highlights of another size, without and with mirrored ones left out; then the numbers of all.
"""

import argparse
from collections import Counter
from unittest.mock import patch

import numpy as np

from glint.tasks.algorithms.lighting import sphere_tests
from glint.tasks.algorithms.lighting.sphere_detection import MIN_SPHERE_SCORE, clear_circles
from glint.tasks.algorithms.lighting.spheres import Sphere, outermost
from tests.benchmarks.spheres_found import simulated

TRUE_SHARE, APART_SHARE = 0.06, 0.3
"""Differences in radii up to which a circle is the true one, and beyond whose distance it is another body's."""


def refused(frames: np.ndarray, circle: Sphere, max_beside_share: float) -> bool | None:
    """Return whether a circle is refused for its highlights, with so many left out; None: for something else."""
    with patch.object(sphere_tests, "MAX_BESIDE_SHARE", max_beside_share):
        reason = sphere_tests.reason_against_chrome(frames, circle)
    if reason is None:
        return False
    return True if "as glass does" in reason or "as that of glass has" in reason else None


def main() -> None:
    """Print a line per circle, and the numbers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("numbers", metavar="FIRST-LAST")
    first, last = (int(number) for number in parser.parse_args().numbers.split("-"))
    counts = Counter[str]()
    for number in range(first, last + 1):
        for name, sample, truth in simulated(number):
            circles, _ = clear_circles(sample.frames, sample.peak, None)
            for circle in outermost([circle for circle in circles if circle.score >= MIN_SPHERE_SCORE]):
                distance = circle.distance(truth) / truth.radius
                difference = max(distance, abs(circle.radius / truth.radius - 1.0))
                without = refused(sample.frames, circle, 0.0)
                if without is None or (difference >= TRUE_SHARE and distance <= APART_SHARE):
                    continue
                kind = "chrome" if difference < TRUE_SHARE else "glass"
                remains = refused(sample.frames, circle, sphere_tests.MAX_BESIDE_SHARE)
                counts.update(
                    {kind: 1, f"{kind} refused without": int(without), f"{kind} refused with": int(bool(remains))}
                )
                print(f"{name}: {kind}, radius {circle.radius:.0f}: refused {without} -> {bool(remains)}", flush=True)
    print(", ".join(f"{name}: {count}" for name, count in counts.items()))


if __name__ == "__main__":
    main()
