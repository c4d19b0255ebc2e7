"""Spheres that are found in random captures and used: how far off they are, and which are missed.

    python -m tests.benchmarks.used_spheres [SHAPE ...] [--seed 680000] [--count 46] [--folder DIR]

The captures are those of `tests.benchmarks.random_captures`; a third has a near camera, whose matrix is given, a third
two spheres, and three in five lights are near. Of each true sphere it prints the error of the circle that is found and
of the one that is used (centre and radius, percent of the radius) with the stated standard deviations; at last how many
are missed or wrong, and the errors in stated deviations.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.lighting.sphere_detection import find_spheres
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.parameters import SurveyParameters
from glint.tasks.stages.sphere_confirmation import confirm_found
from tests.benchmarks.random_captures import random_captures
from tests.benchmarks.simulated_captures import shapes_parser
from tests.benchmarks.spheres_scenes import read_sample

MAX_DISTANCE = 0.5
"""Distance from the true centre, in radii, from which a circle is not that of the sphere."""
WRONG_PERCENT = 4.0
"""Error of centre or radius, percent of the radius, from which a circle is wrong."""


def nearest(circles: Sequence[Sphere], truth: Sphere) -> Sphere | None:
    """Return the circle of a true sphere; None: it is missed."""
    best = min(circles, key=truth.distance, default=None)
    return None if best is None or best.distance(truth) > MAX_DISTANCE * truth.radius else best


def errors(circle: Sphere, truth: Sphere) -> np.ndarray:
    """Return errors of centre and radius, and the stated standard deviations of both, percent of the radius (4,)."""
    off = circle.distance(truth), abs(circle.radius - truth.radius), circle.centre_sd, circle.radius_sd
    return 100.0 * np.array(off) / truth.radius


def line(circle: Sphere | None, truth: Sphere) -> str:
    """Return the errors of a circle in words."""
    if circle is None:
        return "missed"
    centre, radius, centre_sd, radius_sd = errors(circle, truth)
    return f"{centre:.1f}% ({centre_sd:.1f}), {radius:.1f}% ({radius_sd:.1f})"


def main() -> None:
    """Find the spheres of each capture, and print a line for each and the errors of all."""
    used_errors, missed, refused = list[np.ndarray](), 0, 0
    arguments = shapes_parser(__doc__, seed=680000, count=46).parse_args()
    for name, capture, _ in random_captures(arguments, is_given=True):
        sample = read_sample(Path(capture.frames), SurveyParameters().sample)
        camera = None if capture.camera is None else np.array(capture.camera.matrix)
        try:
            circles = find_spheres(sample.frames, sample.peak, camera)
            used, warnings = confirm_found(sample.frames, circles, camera)
        except UnusableCapture as error:
            print(f"{name}: refused, {error}", flush=True)
            refused += 1
            continue
        for given in capture.spheres:
            truth = Sphere(given.x, given.y, given.radius)
            circle = nearest(used, truth)
            missed += circle is None
            if circle is not None:
                used_errors.append(errors(circle, truth))
            shown = f"found {line(nearest(circles, truth), truth)}; used {line(circle, truth)}"
            print(f"{name}, radius {truth.radius:.0f}: {shown}; {len(warnings)} warnings", flush=True)
    centre, radius, centre_sd, _ = np.stack(used_errors, axis=1)
    # The error of a centre has two axes.
    deviations = centre / (np.sqrt(2.0) * centre_sd)
    wrong = int((np.maximum(centre, radius) > WRONG_PERCENT).sum())
    print(f"{refused} captures refused; {len(centre)} spheres used, {missed} missed, {wrong} wrong")
    print(f"centre {_root_mean_square(centre):.2f}% RMS, {np.median(centre):.2f}% median")
    print(f"in stated deviations {_root_mean_square(deviations):.2f} RMS, {deviations.max():.1f} at most")
    print(f"radius {_root_mean_square(radius):.2f}% RMS, {np.median(radius):.2f}% median")


def _root_mean_square(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


if __name__ == "__main__":
    main()
