"""Cells of the robustness matrix: a capture with a perturbation, what comes of it, and whether that passes as right."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Literal

import numpy as np

from glint.storage.catalogue.loading import Capture
from glint.storage.errors import InputError
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.results import CONFIDENT
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.engine.stage import perform, stage_keys
from glint.tasks.engine.stage_warning import StageWarning, by_cost
from glint.tasks.evaluation.captures import CONFIDENT_ERROR_DEG
from glint.tasks.evaluation.truth import load_truth
from glint.tasks.pipeline import STAGES, stages_until
from glint.tasks.robustness.perturbations import PERTURBATIONS, UNPERTURBED
from glint.tasks.robustness.perturbed_captures import write_perturbed

LABELLING = "labels"
"""Stage that gives normals and confidence; depth and surface follow from them alone."""
MIN_RIGHT_SHARE = 0.95
"""Share of the confident pixels that must be right."""
MAX_WARNED_SHARE = 0.05
"""Share of the mask that may be confident, and wrong, where a warning names the cause."""

MIN_CONFIDENT_SHARE = 0.005
"""Share of the mask below which nothing counts as confident: single pixels show no share that is right."""

Outcome = Literal["ok", "warned", "nothing confident", "SILENT"]


@dataclass(frozen=True, slots=True)
class CellTask:
    """One cell to measure: a capture under the name of its object, a perturbation by name, and where to write.

    is_simulated: whether the capture was simulated with the options of the perturbation.
    """

    object_id: str
    perturbation: str
    capture: Capture
    parameters: Parameters
    folder: Path
    store: str
    is_simulated: bool = False


@dataclass(frozen=True, slots=True)
class Cell:
    """Result of a perturbed capture.

    entry: the perturbed entry of the catalogue; error_deg: mean over the mask's pixels on the object; confident_share:
    of the mask with confidence >= CONFIDENT; right_share: of these within CONFIDENT_ERROR_DEG of the truth, where
    pixels beside the object are wrong; warnings: of all stages, the most costly first; refusal: why the capture has no
    result, empty if it has.
    """

    object_id: str
    perturbation: str
    entry: Capture
    error_deg: float
    confident_share: float
    right_share: float
    warnings: tuple[StageWarning, ...]
    refusal: str
    seconds: float


def measure_cell(task: CellTask, shared: None = None) -> Cell | None:
    """Write the perturbed capture, perform its stages up to the labels, and compare them with the truth.

    None: the perturbation does not apply to the capture. A capture that is refused is a cell too.

    Raises:
        InputError: the unperturbed inputs cannot be read; StoreError: the store fails.
    """
    started, perturbation = perf_counter(), PERTURBATIONS[task.perturbation]
    if perturbation.options and perturbation.change is None and not task.is_simulated:
        return None
    entry = write_perturbed(task.capture, task.perturbation, perturbation, task.folder)
    if entry is None:
        return None
    context = CaptureContext(task.store, task.object_id, entry, task.parameters, "evaluate")
    warnings, refusal, shares = list[StageWarning](), "", (float("nan"), 0.0, float("nan"))
    try:
        keys = stage_keys(context, STAGES)
        for stage in stages_until(LABELLING):
            warnings += perform(context, stage, keys[stage.name]).warnings
        shares = _compare(context)
    except (InputError, UnusableCapture) as error:
        refusal = f"{error.message}: {error.remedy}"
    return Cell(
        task.object_id,
        task.perturbation,
        entry,
        *shares,
        warnings=tuple(by_cost(warnings)),
        refusal=refusal,
        seconds=perf_counter() - started,
    )


def _compare(context: CaptureContext) -> tuple[float, float, float]:
    """Return mean error in degrees, confident share of the mask, and share of the confident pixels that are right."""
    mask, labels = context.load("mask").read("mask"), context.load(LABELLING)
    truth = load_truth(context, mask.shape)
    assert truth is not None
    error = angles(labels.read("normals"), truth.normals)
    is_confident = mask & (labels.read("confidence") >= CONFIDENT)
    right = error[is_confident] < CONFIDENT_ERROR_DEG
    known = error[mask & np.isfinite(error)]
    return (
        float(known.mean()) if known.size else float("nan"),
        float(is_confident.sum() / mask.sum()),
        float(right.mean()) if right.size else float("nan"),
    )


def named_causes(cell: Cell, baseline: Cell | None) -> tuple[str, ...]:
    """Return the causes of the perturbation that warnings name, without those that the unperturbed capture warns of."""
    usual = {warning.cause for warning in baseline.warnings} if baseline is not None else set()
    causes = {warning.cause for warning in cell.warnings} - usual
    return tuple(cause for cause in PERTURBATIONS[cell.perturbation].causes if cause in causes)


def outcome(cell: Cell, baseline: Cell | None) -> Outcome:
    """Return how a cell ends.

    warned: the capture is refused, or a warning names the cause and less than MAX_WARNED_SHARE of the mask is
    confident; nothing confident: less than MIN_CONFIDENT_SHARE is; ok: MIN_RIGHT_SHARE of what is confident is right;
    SILENT: else, as it passes as right.

    baseline: the unperturbed cell of the capture.
    """
    if cell.refusal or (named_causes(cell, baseline) and cell.confident_share < MAX_WARNED_SHARE):
        return "warned"
    if cell.confident_share < MIN_CONFIDENT_SHARE:
        return "nothing confident"
    return "ok" if cell.right_share >= MIN_RIGHT_SHARE else "SILENT"


def baselines(cells: Sequence[Cell]) -> Mapping[str, Cell]:
    """Return the unperturbed cell of each capture."""
    return {cell.object_id: cell for cell in cells if cell.perturbation == UNPERTURBED}
