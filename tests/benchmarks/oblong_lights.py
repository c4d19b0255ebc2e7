"""What the shapes of highlights say of a sphere's circle under lights that are round, and under oblong ones.

    python -m tests.benchmarks.oblong_lights [--scenes FOLDER] [CATALOGUE ..]

A mirror sphere is computed ray by ray under lamps of several ratios of width to height, held in seven ways. FOLDER
holds scenes of round lamps (scene-*/video.mp4, truth.json), CATALOGUE captures whose spheres are given rightly. A line
each: error of the fitted centre, in radii; how far the lamp is from round (skew) and what remains unexplained (misfit),
in variances of its image; and whether the shapes say anything, with the centre's standard deviation in radii.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.sphere_checks.foreshortening import (
    MAX_RADIUS_RATIO,
    MIN_SHAPES,
    circle_of_shapes,
    fit_shapes,
    highlight_shapes,
)
from glint.tasks.engine.references import load_catalogue
from tests.benchmarks.spheres_scenes import read_sample
from tests.tasks.algorithms.sphere_checks.mirrored_lamp import lamps, mirrored_lamp

SPHERE = Sphere(58.3, 60.8, 30.4)
RATIOS = (1.0, 1.3, 2.0)


def ways_of_holding(directions: np.ndarray) -> dict[str, np.ndarray]:
    """Directions (3,) or (T, 3) towards which the height of a lamp points that shines from directions (T, 3)."""
    turn = np.arctan2(directions[:, 1], directions[:, 0]) + 4.0 * directions[:, 2]
    return {
        "upright": np.array([0.0, 1.0, 0.0]),
        "sideways": np.array([1.0, 0.4, 0.0]),
        "leaning": np.array([0.1, 1.0, 0.3]),
        "towards the camera": np.array([0.0, 0.7, 0.7]),
        "radial": np.array([0.001, 0.001, 1.0]),
        "across": np.cross(directions, [0.0, 0.0, 1.0]) + 0.001,
        "turning": np.stack([np.sin(turn), np.cos(turn), np.zeros(len(turn))], axis=1),
    }


def line(name: str, frames: np.ndarray, sphere: Sphere) -> str:
    """Return one line of the table."""
    try:
        shapes = highlight_shapes(frames, sphere)
    except UnusableCapture as error:
        return f"{name:32s} {error}"
    near = np.hypot(shapes.x - sphere.x, shapes.y - sphere.y) < MAX_RADIUS_RATIO * sphere.radius
    if near.sum() < MIN_SHAPES:
        return f"{name:32s} {near.sum()} highlights are too few"
    fit, circle = fit_shapes(shapes.only(near), sphere), circle_of_shapes(shapes, sphere)
    offset = np.hypot(fit.x - sphere.x, fit.y - sphere.y) / sphere.radius
    statement = "nothing" if circle is None else f"the centre to {circle.sd / sphere.radius:.3f}"
    return f"{name:32s} off {offset:.3f}  skew {fit.skew:.3f}  misfit {fit.misfit:.3f}  says {statement}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=Path)
    parser.add_argument("catalogues", nargs="*", metavar="CATALOGUE")
    options = parser.parse_args()
    directions = lamps(150)
    for way, upward in ways_of_holding(directions).items():
        for ratio in RATIOS:
            frames = mirrored_lamp(SPHERE, directions, width_ratio=ratio, upward=upward)
            print(line(f"{way}, {ratio:g} : 1", frames, SPHERE), flush=True)
    for folder in sorted(options.scenes.glob("scene-*")) if options.scenes else []:
        frames = read_sample(folder / "video.mp4").frames
        for ball in json.loads((folder / "truth.json").read_text())["balls"]:
            if ball["whole"]:
                print(line(folder.name, frames, Sphere(ball["x"], ball["y"], ball["radius"])), flush=True)
    for name in options.catalogues:
        for item in load_catalogue(name).objects:
            for capture in item.captures:
                frames = read_sample(Path(str(capture.frames))).frames
                for given in capture.spheres:
                    sphere = Sphere(given.x, given.y, given.radius)
                    print(line(f"{item.id}/{capture.id}", frames, sphere), flush=True)


if __name__ == "__main__":
    main()
