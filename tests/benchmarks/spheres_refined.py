"""Circles of chrome spheres, refined from near the true ones by different numbers of frames.

    python -m tests.benchmarks.spheres_refined CATALOGUE .. [--scenes FOLDER] [--frames 50 128]

The catalogues give the true circles; FOLDER holds scene-*/video.mp4 and truth.json (balls). Each fit begins up to 1.2%
of the radius beside the truth (seeded). A line per source and number of frames: mean errors of centre and radius in
percent of the radius, larger ones than 2% counted as that.
"""

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from glint.storage.catalogue.loading import load
from glint.tasks.algorithms.lighting.pyramid import spread
from glint.tasks.algorithms.lighting.spheres import Sphere, measure_sphere
from tests.benchmarks.spheres_scenes import read_sample

START_SHARE = 0.012
"""Largest error of each coordinate with which a fit begins, in radii."""
COUNTED_PERCENT = 2.0
"""Larger errors count as this one: another circle was fitted."""


def of_catalogue(path: Path) -> Iterator[tuple[np.ndarray, Sphere]]:
    """Yield the sampled frames (T, H, W) and each true sphere of a catalogue's captures."""
    for entry in load(path).objects:
        for capture in entry.captures:
            if not capture.spheres:
                continue
            frames = read_sample(Path(capture.frames)).frames
            for sphere in capture.spheres:
                yield frames, Sphere(sphere.x, sphere.y, sphere.radius)


def of_scenes(folder: Path) -> Iterator[tuple[np.ndarray, Sphere]]:
    """Yield the sampled frames (T, H, W) and each true sphere of the scenes."""
    for scene in sorted(folder.glob("scene-*")):
        frames = read_sample(scene / "video.mp4").frames
        for ball in json.loads((scene / "truth.json").read_text())["balls"]:
            if ball["whole"]:
                yield frames, Sphere(ball["x"], ball["y"], ball["radius"])


def errors(frames: np.ndarray, truth: Sphere, generator: np.random.Generator) -> tuple[float, float]:
    """Return the errors of centre and radius, percent of the radius, of a fit that begins beside the truth."""
    x, y, radius = generator.uniform(-START_SHARE, START_SHARE, 3) * truth.radius
    fit = measure_sphere(frames, Sphere(truth.x + x, truth.y + y, truth.radius + radius), refined=True)
    percent = 100.0 / truth.radius
    return min(percent * fit.distance(truth), COUNTED_PERCENT), min(
        percent * abs(fit.radius - truth.radius), COUNTED_PERCENT
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("catalogues", nargs="*", type=Path)
    parser.add_argument("--scenes", type=Path)
    parser.add_argument("--frames", type=int, nargs="+", default=[50, 128])
    arguments = parser.parse_args()
    sources = {str(path): list(of_catalogue(path)) for path in arguments.catalogues}
    if arguments.scenes is not None:
        sources[str(arguments.scenes)] = list(of_scenes(arguments.scenes))
    for name, spheres in sources.items():
        for count in arguments.frames:
            generator = np.random.default_rng(0)
            percent = np.array([errors(spread(frames, count), truth, generator) for frames, truth in spheres])
            centre, radius = percent.mean(axis=0)
            print(
                f"{name}: {len(percent)} spheres, {count} frames: centre {centre:.2f}%, radius {radius:.2f}%",
                flush=True,
            )


if __name__ == "__main__":
    main()
