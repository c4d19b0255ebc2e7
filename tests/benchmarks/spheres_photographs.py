"""Spheres and lights on real photographs and on rendered captures: errors and seconds.

    python -m tests.benchmarks.spheres_photographs [DATA]

DATA: folder of shared data.
"""

import argparse
import time
from pathlib import Path

import cv2
import numpy as np
from ruamel.yaml import YAML

from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of, unit
from glint.tasks.algorithms.lighting.lights import find_lights
from glint.tasks.algorithms.lighting.sphere_detection import find_spheres
from glint.tasks.algorithms.lighting.spheres import Sphere, crop_around
from glint.tasks.stages.capture_geometry import SPHERE_MARGIN_PX
from tests.pictures import read_picture


def report(name: str, frames: np.ndarray, truth: Sphere, lights: np.ndarray, *, half: bool) -> None:
    """Print the errors of the sphere that is found, in percent of the radius, and of the lights with each circle."""
    sample = frames[np.linspace(0, len(frames) - 1, min(len(frames), 100)).astype(int)]
    start = time.process_time()
    measured = find_spheres(sample, frames.max(axis=0))[0]
    seconds = time.process_time() - start
    error = np.array([measured.x - truth.x, measured.y - truth.y, measured.radius - truth.radius]) / truth.radius * 100
    circle = np.array2string(error, precision=2)
    line = f"{name:24s} circle {circle:22s} % in {seconds:4.1f} s (score {measured.score:.2f});"
    for label, sphere in (("given", truth), ("found", measured)):
        crop, left, top = crop_around(frames, sphere, SPHERE_MARGIN_PX)
        start = time.process_time()
        result = find_lights(crop, sphere.in_crop(left, top))
        seconds = time.process_time() - start
        errors = angles(result.half_vectors, half_vectors_of(lights)) if half else angles(result.lights, lights)
        mean, median, worst = np.nanmean(errors), np.nanmedian(errors), np.nanpercentile(errors, 95)
        line += f" {label}: accepted {result.accepted.mean():.3f}, mean {mean:.2f} median {median:.2f} 95% {worst:.2f}"
        line += f" degrees, {seconds:.2f} s;"
    print(line, flush=True)


def photographs(folder: Path, pattern: str) -> np.ndarray:
    """Read grey frames (T, H, W) in natural order."""
    paths = sorted(folder.glob(pattern), key=lambda path: (len(path.name), path.name))
    return np.stack([read_picture(path, cv2.IMREAD_GRAYSCALE) for path in paths])


def video(path: Path) -> np.ndarray:
    """Read grey frames (T, H, W)."""
    reader, frames = cv2.VideoCapture(str(path)), []
    while (item := reader.read())[0]:
        frames.append(cv2.cvtColor(item[1], cv2.COLOR_BGR2GRAY))
    return np.stack(frames)


def main(data: Path) -> None:
    """Measure all photographs (errors of light directions), then all captures (errors of half vectors)."""
    cv2.setNumThreads(1)
    for probe in ("LightProbe-1", "LightProbe-2"):
        folder = data / "real" / "psbox" / probe
        frames = photographs(folder, "Image_*.JPG")
        x, y, radius = np.loadtxt(folder / "circle_data.txt")
        lights = unit(np.loadtxt(folder / "light_directions.txt").T)
        report(probe, frames, Sphere(x - 1, frames.shape[1] - y, radius), lights, half=False)
    folder = data / "real" / "uw_chrome"
    lights = unit(np.loadtxt(folder / "lights.txt", skiprows=1))
    frames = photographs(folder / "chrome", "chrome.[0-9]*.png")
    report("uw_chrome", frames, Sphere(253.5, 148.0, 119.25), lights, half=False)
    for catalogue in ("single-views.yaml", "turntable.yaml"):
        for item in YAML(typ="safe").load((data / "captures" / catalogue).read_text())["objects"]:
            for capture in item["captures"]:
                path = data / "captures" / capture["frames"]
                lights = np.load(path.parent / "truth" / "lights.npy")
                report(f"{item['id']}/{capture['id']}", video(path), Sphere(**capture["spheres"][0]), lights, half=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", nargs="?", type=Path, default=Path(__file__).parents[2].parent / "shared" / "data")
    main(parser.parse_args().data)
