"""Chrome spheres on tables that their rims mirror, with shadows and caustics: frames of a survey, and the true circles.

    python -m tests.benchmarks.table_scenes FIRST-LAST --folder DIR

Shape, table, spheres, light, noise and compression of a scene follow from its number; the spheres of scenes from 600 on
stand above the table. Scenes are kept in DIR, so that `tests.benchmarks.spheres_found` and `spheres_given` read them
from it (`--tables`).
"""

import argparse
import json
import random
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from glint.storage.catalogue.loading import Capture
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.simulation.simulate import CaptureOptions
from glint.tasks.stages.first_pass import Sample
from tests.benchmarks.simulated_captures import simulated_once
from tests.benchmarks.spheres_scenes import read_sample

SHAPES = "elephant", "puppy", "bird", "teddy-bear", "fish", "pitcher", "tumbler", "faceted-bottle"
FRAMES = 240
"""Frames of a scene: hardly more than the survey's sample takes."""
FIRST_RAISED, HEIGHTS = 600, (0.3, 1.0, 3.0)
"""Number of the first scene whose spheres stand above the table, and their heights in radii."""


@dataclass(frozen=True, slots=True)
class TableScene:
    """A scene as the survey samples it, and the true circles of its spheres."""

    name: str
    sample: Sample
    spheres: tuple[Sphere, ...]


def scene_options(number: int) -> CaptureOptions:
    """Return the options of a numbered scene."""
    draw = random.Random(number)
    return CaptureOptions(
        seed=number,
        frames=FRAMES,
        scale=round(draw.uniform(0.5, 0.8), 2),
        shadows=True,
        table_tilt=draw.choice([0.0, round(draw.uniform(20.0, 65.0), 1)]),
        table_contrast=draw.choice([0.0, 0.3, 1.0]),
        spheres=draw.choice([1, 2]),
        sphere_radius=float(draw.randint(22, 50)),
        light_radius=round(draw.uniform(2.0, 6.0), 1),
        light_distance=draw.choice([None, None, 3.0, 6.0]),
        crf=draw.randint(16, 28),
        noise=round(draw.uniform(1.0, 3.0), 1),
        sphere_height=draw.choice(HEIGHTS) if number >= FIRST_RAISED else 0.0,
    )


def table_captures(
    numbers: str, folder: Path, *, has_shadows: bool = True
) -> Iterator[tuple[int, CaptureOptions, Capture]]:
    """Yield number, options and capture of the scenes of a range, FIRST-LAST, simulated into the folder unless there.

    has_shadows: whether shadows and caustics lie on the table.
    """
    first, last = (int(number) for number in numbers.split("-"))
    for number in range(first, last + 1):
        options = replace(scene_options(number), shadows=has_shadows)
        yield number, options, simulated_once(SHAPES[number % len(SHAPES)], folder / str(number), options)


def table_scenes(numbers: str, folder: Path) -> Iterator[TableScene]:
    """Yield the scenes of a range of numbers, FIRST-LAST."""
    for number, _, capture in table_captures(numbers, folder):
        spheres = tuple(Sphere(sphere.x, sphere.y, sphere.radius) for sphere in capture.spheres)
        name = f"table {number} {SHAPES[number % len(SHAPES)]}"
        yield TableScene(name, read_sample(Path(capture.frames), FRAMES), spheres)


def main() -> None:
    """Simulate the scenes and print what each shows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("numbers", metavar="FIRST-LAST")
    parser.add_argument("--folder", type=Path, required=True)
    arguments = parser.parse_args()
    for scene in table_scenes(arguments.numbers, arguments.folder):
        options = asdict(scene_options(int(scene.name.split()[1])))
        names = ("table_tilt", "table_contrast", "sphere_radius", "light_radius", "light_distance", "crf")
        print(f"{scene.name}: {json.dumps({name: options[name] for name in names})}", flush=True)


if __name__ == "__main__":
    main()
