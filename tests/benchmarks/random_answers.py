"""What answers are worth, and whether they ever do harm: ten questions on random captures, answered by the truth.

    python -m tests.benchmarks.random_answers [SHAPE ...] [--seed 34000] [--count 46] [--answers 10] [--folder DIR]

The captures are those of `random_captures` whose spheres and masks are given. Of each it prints the squared error of
the observed pixels and of the whole mask before and after the answers, and the change by as many marks at random
places; at last the geometric means of the changes, the worst one, and how many captures have an error that is raised by
more than 2%.
"""

import numpy as np

from glint.tasks.evaluation.questions import evaluate_questions
from tests.benchmarks.random_captures import measure, random_captures
from tests.benchmarks.simulated_captures import shapes_parser

RAISED = 1.02
"""Ratio of the errors after and before from which answers did harm."""


def main() -> None:
    """Print a line per capture as it is measured, then the sums."""
    arguments = shapes_parser(__doc__, seed=34000, count=46, answers=10).parse_args()
    rows = []
    for name, capture, store in random_captures(arguments, is_given=True):
        worth = evaluate_questions(measure(capture, store).work, arguments.answers)
        assert worth is not None
        before, after, at_random = worth.before, worth.after, worth.random_marks
        rows.append((after[0] / before[0], at_random[0] / before[0]))
        print(
            f"{name}: {before[0]:.4f} / {before[1]:.4f}, then {after[0]:.4f} / {after[1]:.4f} ({rows[-1][0] - 1:+.0%}),"
            f" random marks {rows[-1][1] - 1:+.0%}; {worth.wrong} labels wrong, {worth.wrong_or_open} wrong or open",
            flush=True,
        )
    for name, ratios in zip(("answers", "random marks"), np.array(rows).T, strict=True):
        mean = np.exp(np.log(ratios).mean()) - 1
        raised = (ratios > RAISED).sum()
        print(f"{name}: {mean:+.1%} (geometric mean), {raised} of {len(ratios)} raised, worst {ratios.max() - 1:+.0%}")


if __name__ == "__main__":
    main()
