"""Given circles of chrome spheres against fits that lie elsewhere: which of the two is the contour.

    python -m tests.benchmarks.spheres_rivals CATALOGUE .. [--scenes FOLDER] [--shifts 0 0.05 0.1]

The catalogues state the true circles; FOLDER holds scene-*/video.mp4 and truth.json (balls). Each sphere is given as it
is, and shifted sideways by shares of its radius. Of each it prints the error of the fit (centre and radius, percent of
the radius), the contrast of the given circle relative to the fit's, and whether the fit replaces it; the error of the
circle that is used, and the standard deviation that it is said to have.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from glint.tasks.algorithms.lighting.pyramid import spread
from glint.tasks.algorithms.lighting.sphere_detection import FIT_FRAMES
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.sphere_checks.given_circle import confirm_sphere
from tests.benchmarks.spheres_refined import of_catalogue, of_scenes


def lines(frames: np.ndarray, truth: Sphere, shifts: list[float]) -> Iterator[str]:
    """Yield a line per shift of a sphere's given circle."""
    percent = 100.0 / truth.radius
    for shift in shifts:
        confirmed = confirm_sphere(spread(frames, FIT_FRAMES), replace(truth, x=truth.x + shift * truth.radius))
        fit, used = confirmed.fit, confirmed.sphere
        yield (
            f"given {shift:.0%} beside it: fit {percent * fit.distance(truth):.1f}% and"
            f" {percent * (fit.radius - truth.radius):+.1f}% off, relative contrast {confirmed.given_contrast:.2f},"
            f" {'replaces it' if confirmed.is_corrected else 'does not replace it'}; used circle"
            f" {percent * used.distance(truth):.1f}% off, said to be {percent * used.centre_sd:.1f}%"
        )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("catalogues", nargs="*", type=Path)
    parser.add_argument("--scenes", type=Path)
    parser.add_argument("--shifts", type=float, nargs="+", default=[0.0, 0.05, 0.1])
    arguments = parser.parse_args()
    sources = [(str(path), of_catalogue(path)) for path in arguments.catalogues]
    if arguments.scenes is not None:
        sources.append((str(arguments.scenes), of_scenes(arguments.scenes)))
    for name, spheres in sources:
        for frames, truth in spheres:
            for line in lines(frames, truth, arguments.shifts):
                print(f"{name}, radius {truth.radius:.1f}: {line}", flush=True)


if __name__ == "__main__":
    main()
