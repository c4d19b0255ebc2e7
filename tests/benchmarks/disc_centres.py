"""Centres of discs: what dark frames add to the places of candidates, on random captures.

    python -m tests.benchmarks.disc_centres [SHAPE ...] [--seed 340000] [--count 46] [--folder DIR]

The captures are those of `random_captures` whose spheres and masks are given. Each is labelled twice: with candidates
that are the means of their lit frames, and with the centres that dark frames tell as well. Of both it prints the mean
error in degrees, the median error of the confident pixels, the share of the mask that is confident, and of this the
share within 5 degrees; at last the geometric means of the errors.
"""

import numpy as np

from glint.tasks.engine.parameters import Parameters
from tests.benchmarks.random_captures import Measured, measure, random_captures
from tests.benchmarks.simulated_captures import shapes_parser


def median_error(measured: Measured) -> float:
    """Return the median error of the confident pixels in degrees, NaN without any."""
    return float(np.median(measured.error[measured.confident])) if measured.confident.any() else np.nan


def main() -> None:
    """Print a line per capture as it is measured, then the means."""
    arguments = shapes_parser(__doc__, seed=340000, count=46).parse_args()
    errors, medians = [], []
    for name, capture, store in random_captures(arguments, is_given=True):
        pair = [
            measure(capture, store, Parameters.model_validate({"clusters": {"dark_frames": dark_frames}}))
            for dark_frames in (False, True)
        ]
        errors.append([measured.mean_error for measured in pair])
        medians.append([median_error(measured) for measured in pair])
        results = (
            f"{measured.mean_error:.2f}, {median:.2f} degrees, {measured.share:.1%}, {measured.right:.1%} right"
            for measured, median in zip(pair, medians[-1], strict=True)
        )
        print(f"{name}: {' -> '.join(results)}", flush=True)
    known = np.isfinite(medians).all(axis=1)
    quantities = {"mean errors": np.array(errors), "medians of confident pixels": np.array(medians)[known]}
    for quantity, values in quantities.items():
        before, after = np.exp(np.log(values).mean(axis=0))
        print(f"geometric mean of the {quantity}: {before:.2f} -> {after:.2f} degrees")


if __name__ == "__main__":
    main()
