"""Chrome spheres of exactly computed scenes: found, measured, and their lights against the truth.

    python -m tests.benchmarks.spheres_scenes [--data FOLDER] [--scenes 501-510] [--perturb PERCENT]

FOLDER holds scene-*/video.mp4, truth.json (balls, decoys, glass) and truth/lights.npy. With --perturb the spheres are
given, with centre and radius off by so much of the radius, instead of found. A line per scene: errors of centre and
radius and their predicted standard deviations in percent of the radius, median error of the lights in degrees, with the
true circles too, and whether it was warned or refused; then the summary.
"""

import argparse
import json
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from glint.storage.footage.source import open_footage
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.lighting.lights import Lights, find_lights, merge_spheres
from glint.tasks.algorithms.lighting.sphere_detection import find_spheres
from glint.tasks.algorithms.lighting.spheres import Sphere, crop_around
from glint.tasks.stages.capture_geometry import SPHERE_MARGIN_PX
from glint.tasks.stages.first_pass import Sample, SampleRecorder
from glint.tasks.stages.sphere_confirmation import confirm_found, confirm_given
from glint.tasks.stages.sphere_doubts import sphere_doubts

SAMPLE_FRAMES = 200
MAX_CONTOUR_PERCENT = 5.0
"""Error of centre and radius, in percent of the radius, beyond which another circle was measured."""
SILENT_DEG = 2.5
"""Median error of the lights that must not pass without a word."""


@dataclass
class Result:
    """What became of a scene: errors and deviations of the spheres in percent of the radius, lights in degrees."""

    name: str
    refusal: str = ""
    warnings: list[str] = field(default_factory=list)
    spheres: list[str] = field(default_factory=list)
    deviations: list[np.ndarray] = field(default_factory=list)
    wrong: int = 0
    missed: int = 0
    light_deg: float = np.nan
    true_light_deg: float = np.nan
    seconds: float = 0.0

    def line(self) -> str:
        """One line of the table."""
        outcome = "refused: " + self.refusal if self.refusal else f"warned: {self.warnings[0]}" if self.warnings else ""
        return (
            f"{self.name}  lights {self.light_deg:5.2f} (true circles {self.true_light_deg:4.2f})  {self.seconds:.1f} s"
            f"  missed {self.missed} wrong {self.wrong}  {'; '.join(self.spheres)}  {outcome[:110]}"
        )


def read_frames(video: Path) -> np.ndarray:
    """Read the luma of all frames (T, H, W) uint8."""
    with open_footage(str(video)) as footage:
        return np.stack([frame.copy() for frame in footage.frames()])


def read_sample(video: Path, frames: int = SAMPLE_FRAMES) -> Sample:
    """Take a sample of so many of a video's frames, as the survey does."""
    with open_footage(str(video)) as footage:
        return SampleRecorder(footage, frames, lambda done, total: None).sample()


def lights_of_sphere(frames: np.ndarray, sphere: Sphere) -> Lights:
    """Measure the lights on one sphere of frames (T, H, W)."""
    crop, left, top = crop_around(frames, sphere, SPHERE_MARGIN_PX)
    return find_lights(crop, sphere.in_crop(left, top))


def perturbed(sphere: Sphere, share: float, generator: np.random.Generator) -> Sphere:
    """Move centre and radius of a sphere by `share` of the radius, as whoever gives it by hand errs."""
    turn, sign = generator.uniform(0, 2 * np.pi), generator.choice((-1.0, 1.0))
    off = share * sphere.radius
    return Sphere(sphere.x + off * np.cos(turn), sphere.y + off * np.sin(turn), sphere.radius + sign * off)


def evaluate_scene(folder: Path, perturbation: float) -> Result:
    """Find or confirm the spheres of a scene, read the lights on them and compare both with the truth."""
    truth = json.loads((folder / "truth.json").read_text())
    directions = np.load(folder / "truth" / "lights.npy")
    frames, sample = read_frames(folder / "video.mp4"), read_sample(folder / "video.mp4")
    balls = [Sphere(ball["x"], ball["y"], ball["radius"]) for ball in truth["balls"] if ball["whole"]]
    cut = [Sphere(ball["x"], ball["y"], ball["radius"]) for ball in truth["balls"] if not ball["whole"]]
    result = Result(folder.name)
    exact = merge_spheres([lights_of_sphere(frames, ball) for ball in balls], balls)
    result.true_light_deg = float(np.nanmedian(angles(exact.lights, directions)))
    start = time.process_time()
    try:
        if perturbation:
            generator = np.random.default_rng(int(folder.name[-3:]))
            given = [perturbed(ball, perturbation, generator) for ball in balls]
            spheres, warnings = confirm_given(sample.frames, given, None)
        else:
            spheres, warnings = confirm_found(sample.frames, find_spheres(sample.frames, sample.peak), None)
        result.warnings += [str(warning) for warning in warnings]
        result.seconds = time.process_time() - start
        lights = merge_spheres([lights_of_sphere(frames, sphere) for sphere in spheres], spheres)
    except UnusableCapture as error:
        result.refusal, result.missed = str(error), len(balls)
        return result
    result.light_deg = float(np.nanmedian(angles(lights.lights, directions)))
    doubts = sphere_doubts(spheres, lights, is_near=False, is_given=bool(perturbation))
    result.warnings += [str(warning) for warning in doubts]
    remaining = list(balls)
    for sphere in spheres:
        nearest = min(balls + cut, key=sphere.distance)
        if sphere.distance(nearest) > 0.5 * nearest.radius:
            result.wrong += 1
            result.spheres.append(f"({sphere.x:.0f}, {sphere.y:.0f}, {sphere.radius:.0f}) is none")
            continue
        if nearest in remaining:
            remaining.remove(nearest)
        offset = np.array([sphere.x - nearest.x, sphere.y - nearest.y, sphere.radius - nearest.radius])
        percent = offset / nearest.radius * 100
        deviation = np.array([sphere.centre_sd, sphere.centre_sd, sphere.radius_sd]) / nearest.radius * 100
        result.deviations.append(np.stack([percent, deviation]))
        result.spheres.append(
            f"{percent[0]:+.1f} {percent[1]:+.1f} {percent[2]:+.1f} (sd {deviation[0]:.1f} {deviation[2]:.1f})"
        )
    result.missed = len(remaining)
    return result


def main() -> None:
    """Print the scenes and the summary."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    shared = Path(__file__).parents[2].parent / "shared" / "data" / "balls"
    parser.add_argument("--data", type=Path, default=shared)
    parser.add_argument("--scenes", default="0-999")
    parser.add_argument("--perturb", type=lambda text: float(text.rstrip("%")) / 100, default=0.0)
    arguments = parser.parse_args()
    first, last = (int(number) for number in arguments.scenes.split("-"))
    folders = [path for path in sorted(arguments.data.glob("scene-*")) if first <= int(path.name[-3:]) <= last]
    results = []
    for folder in folders:
        results.append(evaluate_scene(folder, arguments.perturb))
        print(results[-1].line(), flush=True)
    errors = np.array([result.light_deg for result in results])
    silent = sum(bool(result.light_deg > SILENT_DEG and not result.warnings) for result in results)
    shares = ", ".join(f"{(errors <= limit).sum()} within {limit}" for limit in (0.7, 1.0, 1.5, 2.5))
    print(f"{len(results)} scenes: lights {shares} degrees; {sum(bool(r.refusal) for r in results)} refused")
    print(
        f"silent above {SILENT_DEG}: {silent}; missed {sum(r.missed for r in results)}, wrong"
        f" {sum(r.wrong for r in results)}; warned {sum(bool(r.warnings) for r in results)}"
    )
    pairs = np.array([pair for result in results for pair in result.deviations])
    if len(pairs):
        worst = np.abs(pairs[:, 0]).max(axis=1)
        # Farther off it is another circle, whose uncertainty is not the contour's.
        ratios = (pairs[:, 0] / pairs[:, 1])[worst <= MAX_CONTOUR_PERCENT]
        centre, radius = np.sqrt((ratios[:, :2] ** 2).mean()), np.sqrt((ratios[:, 2] ** 2).mean())
        print(
            f"spheres within 1% {(worst <= 1.0).sum()} of {len(pairs)}; errors / sd, rms of {len(ratios)}: centre"
            f" {centre:.2f}, radius {radius:.2f}"
        )


if __name__ == "__main__":
    main()
