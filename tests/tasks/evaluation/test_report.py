"""Tables of evaluations."""

import numpy as np

from glint.tasks.algorithms.evaluation.metrics import LabelErrors, NormalErrors
from glint.tasks.evaluation.captures import METHODS, Evaluation, MethodErrors
from glint.tasks.evaluation.report import capture_tables


def evaluation(name: str, confident: float, right: float, labels: LabelErrors) -> Evaluation:
    """Return an evaluation whose methods all have the same errors."""
    errors = NormalErrors(100, 0.01, 3.0, 2.0, (0.8, 0.9, 1.0), 0)
    methods = tuple(MethodErrors(method, errors, errors) for method in METHODS)
    arrays = np.zeros((2, 2, 3)), np.zeros((2, 2))
    return Evaluation(
        name, 10, (2, 2), methods, None, confident, right, 0.0, 0.0, labels, (), (), {"labels": 1.0}, {}, *arrays
    )


def test_a_share_of_nothing_is_left_empty() -> None:
    nothing = evaluation("nothing/front", 0.0, np.nan, LabelErrors(np.nan, np.nan))
    much = evaluation("much/front", 0.5, 0.971, LabelErrors(0.99, 0.9))
    tables = capture_tables([nothing, much])
    assert "| nothing/front |  |  |  | 0% |  |  |  |" in tables
    assert "| much/front |  |  |  | 50% | 97.1% | 99.0% | 90.0% |" in tables
    assert "nan" not in tables
