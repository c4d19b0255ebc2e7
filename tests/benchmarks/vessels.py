"""Vessels with handles or relief: errors with and without rotational symmetry of their bodies.

    python -m tests.benchmarks.vessels [SHAPE ...] [--frames 2000] [--scale 1.3] [--seed 7] [--focal 0] [--folder DIR]

--focal is that of a perspective camera in frame widths; 0 for parallel rays.

Each shape is simulated. It prints the squared errors of the normals (observed pixels / whole mask), the share of the
mask at confidence 0.95 and of these the share within 5 degrees, without the hypothesis of symmetry and with it.
"""

from glint.tasks.simulation.simulate import CaptureOptions
from tests.benchmarks.flat_faces import measure
from tests.benchmarks.simulated_captures import shapes_parser, simulated_captures

VESSELS = ("mug", "tankard", "pitcher", "hobnail-vase", "ribbed-bottle", "cut-bowl")


def main() -> None:
    """Print a line per capture as it is measured."""
    arguments = shapes_parser(__doc__, frames=2000, scale=1.3, seed=7, focal=0.0).parse_args()
    options = CaptureOptions(
        frames=arguments.frames, scale=arguments.scale, seed=arguments.seed, focal=arguments.focal or None
    )
    for name, capture, store in simulated_captures(arguments.shapes or VESSELS, arguments.folder, options):
        print(f"{name}: {measure(capture, store, hypothesis='symmetry')}", flush=True)


if __name__ == "__main__":
    main()
