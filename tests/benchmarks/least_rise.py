"""Which highlights count: the errors of random captures by how far a highlight must rise.

    python -m tests.benchmarks.least_rise [SHAPE ...] [--seed 32000] [--count 46] [--rises 0.85 0.65] [--folder DIR]

The captures are those of `random_captures` whose spheres and masks are given. Of each it prints the threshold that
follows from its lights, and for this and each of the others the squared error over the whole mask, the share of
the mask that is confident, and of this the share within 5 degrees; at last the geometric mean of the errors, relative
to the first of the others.
"""

import numpy as np

from glint.tasks.engine.parameters import Parameters
from tests.benchmarks.random_captures import Measured, measure, random_captures
from tests.benchmarks.simulated_captures import shapes_parser


def squared_error(measured: Measured) -> float:
    """Return the mean squared length of the difference between resulting and true normals, over the object."""
    chord = 2.0 * np.sin(np.radians(measured.error[measured.mask]) / 2.0)
    return float(np.nanmean(chord**2))


def main() -> None:
    """Print a line per capture as it is measured, then the means."""
    parser = shapes_parser(__doc__, seed=32000, count=46)
    parser.add_argument("--rises", type=float, nargs="+", default=[0.85, 0.65])
    arguments = parser.parse_args()
    errors = []
    for name, capture, store in random_captures(arguments, is_given=True):
        lines, row = [], []
        for rise in (*arguments.rises, None):
            measured = measure(capture, store, Parameters.model_validate({"thresholds": {"threshold": rise}}))
            row.append(squared_error(measured))
            known = f"{measured.work.load('thresholds').record['threshold']:g}"
            label = known if rise is not None else f"by the lights {known}"
            lines.append(f"{label}: {row[-1]:.4f}, {measured.share:.0%}, {measured.right:.1%}")
        errors.append(row)
        print(f"{name}: {'; '.join(lines)}", flush=True)
    means = np.exp(np.log(np.array(errors) / np.array(errors)[:, :1]).mean(axis=0))
    print("geometric means:", ", ".join(f"{mean:.3f}" for mean in means))


if __name__ == "__main__":
    main()
