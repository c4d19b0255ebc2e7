"""Found circles of chrome spheres, by their rims and against the shapes of their highlights: which are replaced.

    python -m tests.benchmarks.spheres_found [--simulate 140-199] [CATALOGUE ..] [--scenes FOLDER]
        [--tables DIR --numbers FIRST-LAST]

Simulated captures are numbered; the number sets shape, size, sphere, frames and seed. The catalogues state the true
circles; FOLDER holds scene-*/video.mp4 and truth.json (balls), DIR the scenes of `tests.benchmarks.table_scenes`. A
line per sphere: error and stated standard deviation (centre and radius, percent of the radius) of the circle that was
found, where its rim replaces it, and of the one that is compared with the highlights; their centre, how far it is from
the truth and from the circle, in percent and in standard deviations; and, where the circle changes, what is used. Then
how many circles are off by more than 4%, how many of these without a word, and how many right ones are doubted.
"""

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glint.storage.catalogue.loading import load
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.lighting.pyramid import spread
from glint.tasks.algorithms.lighting.sphere_detection import FIT_FRAMES, find_spheres
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.sphere_checks.circle_check import CheckedCircle, check_circle
from glint.tasks.algorithms.sphere_checks.mirrored_rim import with_mirrored_rim
from glint.tasks.algorithms.sphere_checks.shape_agreement import centre_deviation, distance
from glint.tasks.engine.parameters import SurveyParameters
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from glint.tasks.stages.first_pass import Sample
from glint.tasks.stages.sphere_doubts import MAX_LIGHT_DEVIATION_DEG
from tests.benchmarks.spheres_refined import of_scenes
from tests.benchmarks.spheres_scenes import read_sample
from tests.benchmarks.table_scenes import table_scenes

SHAPES = (
    *("hemisphere", "fish", "puppy", "faceted-bottle", "wine-glass", "jug", "elephant", "bird", "goblet", "cylinder"),
    *("mug", "teddy-bear", "water-glass", "tumbler", "pitcher", "cut-bowl"),
)
RADII_PX, SCALES = (20.0, 24.0, 30.0, 24.0, 30.0, 45.0), (0.5, 0.6, 0.8)
FIRST_SEED, VIEWS = 1000, 4
WRONG_PERCENT, RIGHT_PERCENT = 4.0, 3.0
"""Errors of centre or radius, percent of the radius, above which a circle is wrong, and below which it is right."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Errors in percent of the radius of the found circle and of the used one, and whether either is doubted."""

    before: float
    after: float
    was_doubted: bool
    is_doubted: bool


def simulated(number: int) -> Iterator[tuple[str, Sample, Sphere]]:
    """Yield name, sample and true circle of a simulated capture."""
    shape, has_views = SHAPES[7 * number % len(SHAPES)], number % 4 == 1
    options = CaptureOptions(
        seed=FIRST_SEED + number,
        frames=600 if number % 2 else 900,
        scale=SCALES[number % len(SCALES)],
        sphere_radius=RADII_PX[(5 * number + number // 6) % len(RADII_PX)],
        views=VIEWS if has_views else 1,
    )
    with tempfile.TemporaryDirectory() as folder:
        record = simulate(shape, Path(folder), options)
        capture = load(record.catalogue).objects[0].captures[number // 4 % VIEWS if has_views else 0]
        (sphere,) = capture.spheres
        sample = read_sample(Path(capture.frames), SurveyParameters().sample)
        yield f"{number} {shape}", sample, Sphere(sphere.x, sphere.y, sphere.radius)


def compare(name: str, frames: np.ndarray, peak: np.ndarray, truth: Sphere) -> Outcome | None:
    """Find the sphere nearest to the true one, check its circle and print a line; None: there is none."""
    try:
        clearest = min(find_spheres(frames, peak), key=truth.distance)
    except UnusableCapture as error:
        print(f"{name}: refused: {error}"[:150], flush=True)
        return None
    if clearest.distance(truth) > 0.6 * truth.radius:
        print(f"{name}: not found", flush=True)
        return None
    many = spread(frames, FIT_FRAMES)
    nearest = with_mirrored_rim(many, clearest)
    if nearest is not clearest:
        print(f"{name}, radius {truth.radius:.0f}: found {_offset(clearest, truth)}, by its rim:", flush=True)
    check = check_circle(many, nearest)
    print(f"{name}, radius {truth.radius:.0f}: {_line(check, truth)}", flush=True)
    return Outcome(
        _error(clearest, truth),
        _error(check.sphere, truth),
        _is_doubted(clearest),
        _is_doubted(check.sphere) or check.is_contradicted,
    )


def _line(check: CheckedCircle, truth: Sphere) -> str:
    percent, circle, shapes = 100.0 / truth.radius, check.before, check.shapes
    line = f"found {_offset(circle, truth)}"
    if shapes is None:
        return f"{line}; the highlights say nothing"
    centre, offset = Sphere(shapes.x, shapes.y, shapes.max_radius), distance(circle, shapes)
    line += (
        f"; highlights' centre {percent * centre.distance(truth):.1f}% off (sd {percent * shapes.sd:.1f}%),"
        f" {percent * offset:.1f}% from it, {offset / centre_deviation(circle, shapes):.1f} deviations;"
        f" radius at most {100.0 * (shapes.max_radius / truth.radius - 1.0):+.0f}%"
    )
    if check.is_contradicted:
        line += f"; CONTRADICTED, {'replaced' if check.is_replaced else 'kept'}: {_offset(check.sphere, truth)}"
    return line


def _offset(circle: Sphere, truth: Sphere) -> str:
    percent = 100.0 / truth.radius
    return (
        f"{percent * circle.distance(truth):.1f}%, {percent * (circle.radius - truth.radius):+.1f}% off"
        f" (sd {percent * circle.centre_sd:.1f}%)"
    )


def _error(circle: Sphere, truth: Sphere) -> float:
    return 100.0 * max(circle.distance(truth), abs(circle.radius - truth.radius)) / truth.radius


def _is_doubted(circle: Sphere) -> bool:
    """Return whether the stage `lights` warns of a circle by its standard deviation."""
    return 2.0 * np.sqrt(2.0) * float(np.degrees(circle.centre_sd / circle.radius)) > MAX_LIGHT_DEVIATION_DEG


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("catalogues", nargs="*", type=Path)
    parser.add_argument("--simulate", default="")
    parser.add_argument("--scenes", type=Path)
    parser.add_argument("--tables", type=Path)
    parser.add_argument("--numbers", default="0-39")
    arguments = parser.parse_args()
    outcomes = list[Outcome | None]()
    if arguments.simulate:
        first, last = (int(number) for number in arguments.simulate.split("-"))
        for number in range(first, last + 1):
            for name, sample, truth in simulated(number):
                outcomes.append(compare(name, sample.frames, sample.peak, truth))
    for path in arguments.catalogues:
        for entry in load(path).objects:
            for capture in entry.captures:
                sample = read_sample(Path(capture.frames), SurveyParameters().sample)
                for given in capture.spheres:
                    truth = Sphere(given.x, given.y, given.radius)
                    outcomes.append(compare(f"{entry.id}/{capture.id}", sample.frames, sample.peak, truth))
    if arguments.scenes is not None:
        for frames, truth in of_scenes(arguments.scenes):
            outcomes.append(compare("scene", frames, frames.max(axis=0), truth))
    if arguments.tables is not None:
        for scene in table_scenes(arguments.numbers, arguments.tables):
            for truth in scene.spheres:
                outcomes.append(compare(scene.name, scene.sample.frames, scene.sample.peak, truth))
    known = [outcome for outcome in outcomes if outcome is not None]
    wrong = [outcome for outcome in known if outcome.before > WRONG_PERCENT]
    right = [outcome for outcome in known if outcome.before <= RIGHT_PERCENT]
    print(
        f"{len(known)} found; {len(wrong)} wrong, {sum(not outcome.was_doubted for outcome in wrong)} of them without a"
        f" word before, {sum(not outcome.is_doubted for outcome in wrong)} after;"
        f" {sum(outcome.after > WRONG_PERCENT for outcome in known)} wrong circles used; {len(right)} right, doubted"
        f" {sum(outcome.was_doubted for outcome in right)} before, {sum(outcome.is_doubted for outcome in right)} after"
    )


if __name__ == "__main__":
    main()
