"""The light's distance by the wall of a body of revolution, without and with it, for captures with a single sphere.

    python -m tests.benchmarks.wall_distance [SHAPE ...] [--seed 490000] [--count 20] [--dark 1] [--folder DIR]

The captures are those of `random_captures`, masks and spheres given, each with its first sphere. With `--dark 1` the
background shows nothing of the light, as a black cloth does not. Of each it prints the inverse distance in frame
widths, true, by the background, and with the wall, and median error, confident share and right share without and with
the wall; at last medians of the errors, and means of the shares.
"""

from contextlib import ExitStack
from pathlib import Path
from unittest.mock import patch

import numpy as np

from glint.storage.catalogue.loading import Capture
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.stages.capture_geometry import load_geometry
from tests.benchmarks.random_captures import Measured, measure, random_captures
from tests.benchmarks.simulated_captures import shapes_parser
from tests.benchmarks.table_lights import options_of, with_one_sphere

BODIES = "cylinder", "wine-glass", "water-glass", "tumbler", "coupe", "goblet", "flask", "mug"
"""Shapes that take turns where none is named."""


def measured_both(capture: Capture, folder: Path, *, is_dark: bool) -> tuple[Measured, Measured]:
    """Measure a capture without and with what its wall shows; is_dark: whether the background shows nothing."""
    with ExitStack() as withheld:
        if is_dark:
            withheld.enter_context(patch("glint.tasks.stages.light_distance.measure_falloff", return_value=None))
        after = measure(capture, folder / "with")
        withheld.enter_context(patch("glint.tasks.stages.labels.wall_distance", return_value=None))
        return measure(capture, folder / "without"), after


def inverse_distances(measured: Measured) -> tuple[float, float]:
    """Return the inverse distance of the light in frame widths, by the lights and with what the wall adds."""
    near, labels = measured.work.load("lights").record["near_light"], measured.work.load("labels").record
    width = load_geometry(measured.work).frame_size[0]
    before = 0.0 if near is None else 1.0 / near["distance"]
    return width * before, width * (before + labels["inverse_distance_change"])


def main() -> None:
    """Print a line per capture as it is measured."""
    arguments = shapes_parser(__doc__, seed=490000, count=20, dark=0).parse_args()
    arguments.shapes = arguments.shapes or BODIES
    figures = []
    for name, given, folder in random_captures(arguments, is_given=True):
        capture, true = with_one_sphere(given, given.spheres[0]), options_of(given).light_distance
        try:
            pair = measured_both(capture, folder, is_dark=bool(arguments.dark))
        except UnusableCapture as error:
            print(f"{name}: refused, {error}", flush=True)
            continue
        before, after = inverse_distances(pair[1])
        figures.append([(np.nanmedian(part.error[part.mask]), 100.0 * part.share, 100.0 * part.right) for part in pair])
        print(
            f"{name}: {0.0 if true is None else 1.0 / true:.3f}, background {before:.3f}, wall {after:.3f};"
            + " ->".join(" {:.2f} degrees, {:.1f}%, {:.1f}% right".format(*part) for part in figures[-1]),
            flush=True,
        )
    for name, rows in zip(("without", "with"), np.swapaxes(figures, 0, 1), strict=True):
        errors, share, right = rows.T
        print(f"{name} the wall: {np.median(errors):.2f} degrees, {share.mean():.1f}%, {right.mean():.1f}% right")


if __name__ == "__main__":
    main()
