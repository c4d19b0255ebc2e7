"""Lights of table scenes with a single sphere: distances that the background shows, and their deviations.

    python -m tests.benchmarks.table_lights FIRST-LAST [--shadows 0] [--folder DIR]

The scenes are those of `table_scenes`, half of them under lights at 3 or 6 frame widths, each with either of its
spheres, mask and region given; with `--shadows 0` the same without shadows and caustics. Of each it prints the inverse
distance in frame widths, true and found, the median error of the half vectors in the region's middle, and the standard
deviation that is stated for it; at last the RMS of the ratios of both and medians.
"""

import argparse
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glint.storage.catalogue.loading import Capture
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.stages.capture_geometry import load_geometry
from tests.benchmarks.table_scenes import table_captures
from tests.tasks.make_context import perform_all


def lit_captures(numbers: str, folder: Path, *, has_shadows: bool) -> Iterator[tuple[str, float, Capture]]:
    """Yield name, true inverse distance in frame widths and the capture of each scene's spheres, one sphere each."""
    for number, options, capture in table_captures(numbers, folder, has_shadows=has_shadows):
        inverse = 0.0 if options.light_distance is None else 1.0 / options.light_distance
        for sphere in capture.spheres:
            yield (
                f"{number}, table at {options.table_tilt:.0f} degrees",
                inverse,
                capture.model_copy(update={"spheres": (sphere,)}),
            )


@dataclass(frozen=True, slots=True)
class MeasuredLights:
    """Lights of a capture beside the truth.

    true, measured: inverse distances in frame widths, 0 of a distant light; error, stated: of the half vectors in the
    region's middle, degrees, median over the frames, and its standard deviation.
    """

    true: float
    measured: float
    error: float
    stated: float


def measured_lights(context: CaptureContext, true: float) -> MeasuredLights:
    """Perform a capture up to its lights and compare them with the truth."""
    perform_all(context, "lights")
    saved = context.load("lights")
    near, deviation, lights = saved.record["near_light"], saved.read("half_vector_sd"), saved.read("lights")
    truth = np.load(Path(str(context.capture.truth)) / "lights.npy")
    error = 0.5 * float(np.nanmedian(angles(lights, truth[: len(lights)])))
    middle = float(deviation[deviation.shape[0] // 2, deviation.shape[1] // 2])
    width = load_geometry(context).frame_size[0]
    measured = 0.0 if near is None else width / near["distance"]
    return MeasuredLights(true, measured, error, float(np.degrees(np.sqrt(2.0) * middle)))


def summary(rows: Sequence[MeasuredLights]) -> str:
    """Return how well errors agree with what is stated, and how many lights are taken for distant or near."""
    parts = []
    for name, group in (
        ("near", [row for row in rows if row.true]),
        ("distant", [row for row in rows if not row.true]),
    ):
        if group:
            ratios = np.array([row.error / max(row.stated, 1e-3) for row in group])
            parts.append(
                f"{len(group)} {name} lights, {sum(row.measured > 0.0 for row in group)} taken for near: error over"
                f" deviation {np.sqrt((ratios**2).mean()):.2f} (RMS), at most {ratios.max():.1f}; error"
                f" {np.median([row.error for row in group]):.2f}, stated {np.median([row.stated for row in group]):.2f}"
                " degrees (medians)"
            )
    return "\n".join(parts)


def main() -> None:
    """Print a line per sphere as it is measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("numbers", metavar="FIRST-LAST")
    parser.add_argument("--folder", type=Path, help="folder of the scenes; a temporary one by default")
    parser.add_argument("--shadows", type=int, default=1)
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or Path(temporary)
        captures = lit_captures(arguments.numbers, folder, has_shadows=bool(arguments.shadows))
        for number, (name, true, capture) in enumerate(captures):
            context = CaptureContext(f"{temporary}/store-{number}", "object", capture, Parameters(), "benchmark")
            try:
                row = measured_lights(context, true)
            except UnusableCapture as error:
                print(f"{name}: refused, {error}", flush=True)
                continue
            rows.append(row)
            line = f"{true:.3f}, found {row.measured:.3f}; half vectors off by {row.error:.2f}, stated {row.stated:.2f}"
            print(f"{name}: {line}", flush=True)
    print(summary(rows))


if __name__ == "__main__":
    main()
