"""Tables of evaluations."""

import numpy as np

from glint.tasks.algorithms.evaluation.mesh_metrics import ModelScore
from glint.tasks.algorithms.evaluation.metrics import LabelErrors, NormalErrors
from glint.tasks.evaluation.captures import METHODS, Evaluation, MethodErrors
from glint.tasks.evaluation.models import MODEL_METHODS, ModelEvaluation
from glint.tasks.evaluation.report import capture_tables, model_table


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


def test_a_baseline_that_gives_no_surface_has_no_row() -> None:
    score = ModelScore(0.01, 0.02, 0.015, (0.5, 0.75), 0.97, True)
    first, second, stored = MODEL_METHODS
    lines = model_table([ModelEvaluation("duck", {first: score, stored: score}, 6, ("left",), 800, 2.5)]).splitlines()
    assert f"| duck | 6 | left | {first} | 0.500 / 0.750 | 1.50% (1.00%, 2.00%) | 0.970 | yes |  |  |" in lines
    assert f"| duck | 6 | left | {stored} | 0.500 / 0.750 | 1.50% (1.00%, 2.00%) | 0.970 | yes | 800 | 2.5 |" in lines
    assert not any(second in line for line in lines)
