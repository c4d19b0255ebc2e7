"""Vessels with handles or relief: errors with and without rotational symmetry of their bodies.

    python -m tests.benchmarks.vessels [SHAPE ...] [--frames 2000] [--scale 1.3] [--seed 7]

Each shape is simulated. It prints the squared errors of the normals (observed pixels / whole mask), the share of the
mask at confidence 0.95 and of these the share within 5 degrees, without the hypothesis of symmetry and with it.
"""

import argparse
import tempfile
from pathlib import Path

from glint.storage.catalogue.loading import load
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from tests.benchmarks.flat_faces import measure

VESSELS = ("mug", "tankard", "pitcher", "hobnail-vase", "ribbed-bottle", "cut-bowl")


def main() -> None:
    """Print a line per capture as it is measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shapes", nargs="*", metavar="SHAPE")
    parser.add_argument("--frames", type=int, default=2000)
    parser.add_argument("--scale", type=float, default=1.3)
    parser.add_argument("--seed", type=int, default=7)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for shape in arguments.shapes or VESSELS:
            options = CaptureOptions(frames=arguments.frames, scale=arguments.scale, seed=arguments.seed)
            record = simulate(shape, Path(folder) / shape, options)
            capture = load(record.catalogue).objects[0].captures[0]
            print(f"{shape}: {measure(capture, Path(folder) / 'store', hypothesis='symmetry')}", flush=True)


if __name__ == "__main__":
    main()
