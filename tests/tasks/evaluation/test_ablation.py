"""The ablation of the labelling, and the reliability of the confidence."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glint.tasks.algorithms.evaluation.metrics import Reliability
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.evaluation import ablation
from glint.tasks.evaluation.ablation import ABLATIONS, ablate
from glint.tasks.evaluation.captures import Evaluation, evaluate
from glint.tasks.evaluation.evaluation_sheet import reliability_diagram
from glint.tasks.evaluation.report import ablation_table
from glint.tasks.pipeline import STAGES
from tests.tasks.make_context import make_context, perform_all
from tests.tasks.smooth_labels import smooth_labels


@pytest.fixture(scope="module")
def work(simulated: Path, performed: Path, tmp_path_factory: pytest.TempPathFactory) -> CaptureContext:
    store = tmp_path_factory.mktemp("ablation") / "store"
    shutil.copytree(performed, store)
    markup = Path(str(simulated)).parent / "hemisphere" / "front" / "markup.json"
    work = make_context(simulated, store, markup=str(markup))
    with smooth_labels():
        perform_all(work)
    return work


@pytest.fixture(scope="module")
def evaluation(work: CaptureContext) -> Evaluation:
    found = evaluate(work, tuple(stage.name for stage in STAGES))
    assert found is not None
    return found


@pytest.mark.slow
def test_every_ingredient_is_switched_off_by_itself(
    work: CaptureContext, evaluation: Evaluation, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = ablate(work)
    assert found is not None and set(found) == set(ABLATIONS)
    stored = evaluation.method("glint")
    assert found["default"] == pytest.approx((stored.observed_region.squared, stored.whole_mask.squared), abs=1e-9)
    changed = {name for name, errors in found.items() if errors != found["default"]}
    assert {"one candidate", "one round"} <= changed
    assert found["one candidate"][0] > found["default"][0]
    # Marks that are right change nothing here, and those that are wrong do.
    marks = ablation.load_marks(work)
    assert marks is not None
    monkeypatch.setattr(ablation, "load_marks", lambda _: replace(marks, kind=1 - marks.kind))
    contradicted = ablate(work)
    assert contradicted is not None and contradicted["no marks"] == found["no marks"]
    assert contradicted["default"][0] > found["default"][0]


def test_a_capture_without_truth_is_not_ablated(work: CaptureContext) -> None:
    assert ablate(replace(work, capture=work.capture.model_copy(update={"truth": None}))) is None


def test_the_table_leaves_missing_values_empty() -> None:
    table = ablation_table({"a/front": {"default": (0.1, 0.2), "no marks": (0.3, 0.4)}, "b/front": {"default": (1, 2)}})
    assert "| default | 0.1000 / 0.2000 | 1.0000 / 2.0000 |" in table
    assert "| no marks | 0.3000 / 0.4000 |  |" in table


def _line(picture: np.ndarray, column: int) -> float:
    """The row, on average, in which the diagram's thick line crosses a column."""
    red, green, blue = (picture[:, column, channel].astype(int) for channel in range(3))
    return float(np.nonzero((blue - red > 60) & (blue - green > 30))[0].mean())


def test_the_reliability_diagram_shows_what_is_right(evaluation: Evaluation) -> None:
    """The line rises where the confidence is right and is low where it is too high; captures weigh by their pixels."""
    lows = (0.0, 0.5, 0.9)
    calibrated = tuple(Reliability(low, 100, low + 0.05, low + 0.05) for low in lows)
    overconfident = tuple(Reliability(low, 900, low + 0.05, 0.05) for low in lows)
    size = 400
    middle = 44 + round(0.55 * size)
    pictures = [
        reliability_diagram([replace(evaluation, reliability=each) for each in chosen], size)
        for chosen in ([calibrated], [overconfident], [calibrated, overconfident])
    ]
    assert all(picture.shape == (size + 60, size + 60, 3) and picture.dtype == np.uint8 for picture in pictures)
    right, wrong, both = (1.0 - (_line(picture, middle) - 16) / size for picture in pictures)
    assert right == pytest.approx(0.55, abs=0.03)
    assert wrong == pytest.approx(0.05, abs=0.03)
    assert both == pytest.approx(0.1, abs=0.03)


def test_the_confidence_of_a_result_is_compared_with_its_errors(evaluation: Evaluation) -> None:
    pixels = sum(each.pixels for each in evaluation.reliability)
    assert pixels == np.isfinite(evaluation.confidence).sum()
    best = evaluation.reliability[-1]
    assert best.low >= 0.9 and best.right > 0.98
    assert all(each.low <= each.confidence <= 1 for each in evaluation.reliability)
