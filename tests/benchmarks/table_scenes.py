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
from dataclasses import asdict, dataclass
from pathlib import Path

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


def table_scene(number: int, folder: Path) -> TableScene:
    """Return a numbered scene, simulated into the folder unless it is there."""
    shape = SHAPES[number % len(SHAPES)]
    capture = simulated_once(shape, folder / str(number), scene_options(number))
    spheres = tuple(Sphere(sphere.x, sphere.y, sphere.radius) for sphere in capture.spheres)
    return TableScene(f"table {number} {shape}", read_sample(Path(capture.frames), FRAMES), spheres)


def table_scenes(numbers: str, folder: Path) -> Iterator[TableScene]:
    """Yield the scenes of a range of numbers, FIRST-LAST."""
    first, last = (int(number) for number in numbers.split("-"))
    return (table_scene(number, folder) for number in range(first, last + 1))


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
