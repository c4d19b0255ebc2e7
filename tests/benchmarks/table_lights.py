"""Lights of captures with a single sphere: distances that the background shows, and their deviations.

    python -m tests.benchmarks.table_lights FIRST-LAST [--shadows 0] [--random 1] [--folder DIR]

The scenes are those of `table_scenes`, half of them under lights at 3 or 6 frame widths, each with either of its
spheres, mask and region given; with `--shadows 0` the same without shadows and caustics. With `--random 1` they are
those of `random_captures` whose seeds are FIRST to LAST, each with its first sphere. Of each it prints the inverse
distance in frame widths, true and found, the median error of the half vectors in the region's middle, and the standard
deviation that is stated for it; at last, by the strength of the compression (crf), the RMS of the ratios of both,
medians, and how much of the inverse distance of near lights is found.
"""

import argparse
import json
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from pathlib import Path

import numpy as np

from glint.storage.catalogue.loading import Capture, Sphere
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.simulation.simulate import CaptureOptions
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.light_distance import reference_point
from tests.benchmarks.random_captures import TURNS, random_capture
from tests.benchmarks.table_scenes import table_captures
from tests.tasks.make_context import perform_all

CRF_BOUNDS = (0, 20, 25, 52)
"""Limits of weak, usual and strong compression."""


def lit_captures(
    numbers: str, folder: Path, *, has_shadows: bool, is_random: bool
) -> Iterator[tuple[str, CaptureOptions, Capture]]:
    """Yield name, options and capture, one sphere each, of table scenes or random captures."""
    if is_random:
        first, last = (int(number) for number in numbers.split("-"))
        for seed in range(first, last + 1):
            shape = TURNS[(seed - first) % len(TURNS)]
            capture = random_capture(shape, seed, folder / str(seed), is_given=True)
            yield f"{shape}, seed {seed}", options_of(capture), with_one_sphere(capture, capture.spheres[0])
        return
    for number, options, capture in table_captures(numbers, folder, has_shadows=has_shadows):
        for sphere in capture.spheres:
            name = f"{number}, table at {options.table_tilt:.0f} degrees"
            yield name, options, with_one_sphere(capture, sphere)


def options_of(capture: Capture) -> CaptureOptions:
    """Return the options with which a capture was simulated."""
    options = json.loads((Path(str(capture.truth)).parent / "meta.json").read_text())
    return CaptureOptions(**{field.name: options[field.name] for field in fields(CaptureOptions)})


def with_one_sphere(capture: Capture, sphere: Sphere) -> Capture:
    """Return the capture with this sphere alone."""
    return capture.model_copy(update={"spheres": (sphere,)})


@dataclass(frozen=True, slots=True)
class MeasuredLights:
    """Lights of a capture beside the truth.

    crf: the codec's rate factor. true, measured: inverse distances in frame widths, 0 of a distant light. error,
    stated: of the half vectors in the region's middle, degrees, median over the frames, and its standard deviation.
    """

    crf: int
    true: float
    measured: float
    error: float
    stated: float


def measured_lights(context: CaptureContext, options: CaptureOptions) -> MeasuredLights:
    """Perform a simulated capture up to its lights and compare them with the truth."""
    perform_all(context, "lights")
    saved = context.load("lights")
    near, deviation, lights = saved.record["near_light"], saved.read("half_vector_sd"), saved.read("lights")
    geometry = load_geometry(context)
    width, height = geometry.frame_size
    true = 0.0 if options.light_distance is None else 1.0 / options.light_distance
    # The truth counts from the frame's middle, lights from the region's.
    x, y = reference_point(geometry)
    offset = np.array([x - (width - 1) / 2, (height - 1) / 2 - y, 0.0])
    truth = unit(np.load(Path(str(context.capture.truth)) / "lights.npy")[: len(lights)] - true / width * offset)
    error = 0.5 * float(np.nanmedian(angles(lights, truth)))
    middle = float(deviation[deviation.shape[0] // 2, deviation.shape[1] // 2])
    measured = 0.0 if near is None else width / near["distance"]
    return MeasuredLights(options.crf, true, measured, error, float(np.degrees(np.sqrt(2.0) * middle)))


def summary(rows: Sequence[MeasuredLights]) -> str:
    """Return how well errors agree with what is stated, and how many lights are taken for distant or near."""
    parts = []
    for least, most in pairwise(CRF_BOUNDS):
        for is_near in (True, False):
            group = [row for row in rows if least <= row.crf < most and (row.true > 0.0) == is_near]
            if not group:
                continue
            ratios = np.array([row.error / max(row.stated, 1e-3) for row in group])
            line = (
                f"crf {least} to {most - 1}: {len(group)} {'near' if is_near else 'distant'} lights,"
                f" {sum(row.measured > 0.0 for row in group)} taken for near: error over deviation"
                f" {np.sqrt((ratios**2).mean()):.2f} (RMS), at most {ratios.max():.1f}; error"
                f" {np.median([row.error for row in group]):.2f}, stated {np.median([row.stated for row in group]):.2f}"
                " degrees (medians)"
            )
            if is_near:
                shares = [row.measured / row.true for row in group]
                low, middle, high = np.percentile(shares, (10, 50, 90))
                line += f"; inverse distance over the true one {middle:.2f} (median), {low:.2f} to {high:.2f}"
            parts.append(line)
    return "\n".join(parts)


def main() -> None:
    """Print a line per sphere as it is measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("numbers", metavar="FIRST-LAST")
    parser.add_argument("--folder", type=Path, help="folder of the scenes; a temporary one by default")
    parser.add_argument("--shadows", type=int, default=1)
    parser.add_argument("--random", type=int, default=0)
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or Path(temporary)
        captures = lit_captures(
            arguments.numbers, folder, has_shadows=bool(arguments.shadows), is_random=bool(arguments.random)
        )
        for number, (name, options, capture) in enumerate(captures):
            context = CaptureContext(f"{temporary}/store-{number}", "object", capture, Parameters(), "benchmark")
            try:
                row = measured_lights(context, options)
            except UnusableCapture as error:
                print(f"{name}: refused, {error}", flush=True)
                continue
            rows.append(row)
            print(
                f"{name}: {row.true:.3f}, found {row.measured:.3f}; half vectors off by {row.error:.2f}, stated"
                f" {row.stated:.2f}",
                flush=True,
            )
    print(summary(rows))


if __name__ == "__main__":
    main()
