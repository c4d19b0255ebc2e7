"""How a cell of the matrix ends, which cells are measured, and two of them measured on a simulated capture."""

import json
from pathlib import Path

import numpy as np
import pytest

from glint.storage.catalogue.loading import Capture, Catalogue, Object, load
from glint.storage.errors import InputError
from glint.tasks.engine.references import load_catalogue
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.robustness.cells import Cell, measure_cell, outcome
from glint.tasks.robustness.matrix import matrix_tasks, perturbed_catalogue, recorded_captures
from glint.tasks.robustness.matrix_report import matrix_as_json, matrix_table
from glint.tasks.robustness.perturbations import PERTURBATIONS, QUICK, UNPERTURBED

ENTRY = Capture(id="front", frames="front.mp4")
MASK_WARNING = StageWarning("the mask leaks; correct it", "mask", 9.0)


def _cell(
    confident: float, right: float, *warnings: StageWarning, name: str = "mask-leaking", refusal: str = ""
) -> Cell:
    return Cell("vase", name, ENTRY, 3.0, confident, right, warnings, refusal, 1.0)


BASELINE = _cell(0.5, 0.99, name=UNPERTURBED)


@pytest.mark.parametrize(
    ("cell", "baseline", "expected"),
    [
        (_cell(0.5, 0.95), BASELINE, "ok"),
        (_cell(0.0, float("nan")), BASELINE, "nothing confident"),
        (_cell(0.004, 0.0), BASELINE, "nothing confident"),
        (_cell(0.004, 0.0, MASK_WARNING), BASELINE, "warned"),
        (_cell(0.006, 0.0), BASELINE, "SILENT"),
        (_cell(0.5, 0.94), BASELINE, "SILENT"),
        (_cell(0.5, 0.5, MASK_WARNING), BASELINE, "SILENT"),
        (_cell(0.04, 0.5, MASK_WARNING), BASELINE, "warned"),
        (_cell(0.04, 0.5, StageWarning("a gap", "coverage")), BASELINE, "SILENT"),
        (_cell(0.04, 0.5, MASK_WARNING), _cell(0.5, 0.99, MASK_WARNING, name=UNPERTURBED), "SILENT"),
        (_cell(0.0, float("nan"), refusal="no object"), BASELINE, "warned"),
    ],
)
def test_outcomes(cell: Cell, baseline: Cell, expected: str) -> None:
    assert outcome(cell, baseline) == expected


def test_cells_are_chosen_by_pattern_and_never_without_their_baseline(simulated: Path, tmp_path: Path) -> None:
    captures = recorded_captures(load_catalogue(simulated))
    assert list(captures) == ["hemisphere"]
    names = [task.perturbation for task in matrix_tasks(captures, tmp_path, "store", False, ["hemisphere/mask-*"])]
    assert names[0] == UNPERTURBED and len(names) == 1 + sum(name.startswith("mask-") for name in PERTURBATIONS)
    assert [task.perturbation for task in matrix_tasks(captures, tmp_path, "store", True)] == list(QUICK)
    with pytest.raises(InputError, match="cylinder"):
        matrix_tasks(captures, tmp_path, "store", False, ["cylinder"])


@pytest.mark.usefixtures("smooth_labels")
def test_a_mirrored_light_is_reported_and_nothing_is_confident(simulated: Path, tmp_path: Path) -> None:
    captures = recorded_captures(load_catalogue(simulated))
    only = ["hemisphere/lights-y-down", "hemisphere/light-at-10-widths"]
    tasks = matrix_tasks(captures, tmp_path / "perturbed", str(tmp_path / "store"), False, only)
    cells = [measure_cell(task) for task in tasks]
    assert cells[1] is None, "a recorded light cannot be moved nearer"
    baseline, mirrored = cells[0], cells[2]
    assert baseline is not None and mirrored is not None
    assert mirrored.error_deg > baseline.error_deg + 5.0
    assert outcome(mirrored, baseline) == "warned" and mirrored.confident_share == 0.0
    assert "y negated" in mirrored.warnings[0].message
    table = matrix_table([baseline, mirrored])
    assert "| lights y down | " in table and "light): warned" in table
    matrix = matrix_as_json([baseline, mirrored])
    assert json.loads(json.dumps(matrix)) == matrix
    assert matrix["lights-y-down"]["hemisphere"]["named"] == ["light"]
    catalogue = perturbed_catalogue([baseline, mirrored])
    entry = catalogue.object("hemisphere").capture("lights-y-down")
    assert entry.lights == str(tmp_path / "perturbed" / "hemisphere" / "lights-y-down" / "lights.lp")
    assert entry.frames == load(simulated).objects[0].captures[0].frames, "what is not perturbed stays where it is"
    assert np.isfinite(mirrored.seconds)


def test_two_captures_of_one_name_are_refused() -> None:
    front = ENTRY.model_copy(update={"truth": "truth"})
    objects = [
        Object(id=name, captures=tuple(front.model_copy(update={"id": capture}) for capture in captures))
        for name, captures in {"a-b": ("front",), "a": ("b", "c")}.items()
    ]
    catalogue = Catalogue.model_validate({"schema": 1, "name": "mixed", "objects": tuple(objects)})
    with pytest.raises(InputError, match="'a-b' names two captures"):
        recorded_captures(catalogue)
