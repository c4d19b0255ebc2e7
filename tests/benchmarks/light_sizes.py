"""Lights of all sizes: what captures give by the angular radius of the light.

    python -m tests.benchmarks.light_sizes [SHAPE ...] [--seed 950] [--radius DEGREES]

For each shape (jug, bird, hemisphere and wine glass by default) and each radius of the light, in degrees, at which its
lobe has fallen to 1/e: mean error of the normals in degrees, share of the mask at confidence 0.95, of these the share
within 5 degrees, and the causes that warnings name. Mask and sphere are given. Takes about five minutes.
"""

import tempfile
from pathlib import Path

from glint.storage.catalogue.loading import load
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from tests.benchmarks.random_captures import measure, outcome
from tests.benchmarks.simulated_captures import shapes_parser

SHAPES = ("jug", "bird", "hemisphere", "wine-glass")
RADII = (1.5, 3.0, 5.4, 7.0, 8.5, 10.0, 12.0, 14.0, 18.0, 22.0)


def main() -> None:
    """Print a line per capture as it is measured."""
    arguments = shapes_parser(__doc__, seed=950, radius=0.0).parse_args()
    for number, shape in enumerate(arguments.shapes or SHAPES):
        for radius in [arguments.radius] if arguments.radius else RADII:
            options = CaptureOptions(
                frames=800, scale=0.6, seed=arguments.seed + number, crf=18, sphere_radius=34.0, light_radius=radius
            )
            with tempfile.TemporaryDirectory() as folder:
                made = simulate(shape, Path(folder) / "capture", options)
                capture = load(made.catalogue).object(shape).captures[0]
                print(f"{shape}, {radius:g} degrees: {outcome(measure(capture, Path(folder) / 'store'))}", flush=True)


if __name__ == "__main__":
    main()
