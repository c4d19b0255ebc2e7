"""Evaluation of captures: errors of the result against its truth, beside those of the baselines and of the paper.

Squared errors of unit normals over observed region and whole mask are those of the paper's Table 3.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from glint.storage.errors import InputError
from glint.tasks.algorithms.evaluation.metrics import (
    ANGLE_LIMITS_DEG,
    DepthErrors,
    LabelErrors,
    NormalErrors,
    Reliability,
    depth_errors,
    label_errors,
    normal_errors,
    reliability,
)
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.results import CONFIDENT
from glint.tasks.algorithms.lighting.coverage import MAX_OBSERVABLE_ANGLE_DEG
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import LabelsParameters
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.evaluation.truth import CaptureTruth, load_truth
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.labels import LabelledView, load_view, reconstruct

METHODS = ("winner takes all", "silhouette only", "paper", "glint")
CONFIDENT_ERROR_DEG = ANGLE_LIMITS_DEG[0]
"""Degrees of error within which a confident pixel counts as right."""


@dataclass(frozen=True, slots=True)
class MethodErrors:
    """Errors of one method over the observed region (pixels with highlights) and over the whole mask."""

    method: str
    observed_region: NormalErrors
    whole_mask: NormalErrors


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A capture compared with its truth: all methods; depth, confidence and stages of the stored result.

    size: (width, height) of the region in pixels; depth: None without true depth; confident_share: share of the mask's
    pixels with truth and result that have confidence >= CONFIDENT; confident_right_share: share of these within
    CONFIDENT_ERROR_DEG; within_42deg, beyond_42deg: mean squared error of pixels whose true normal is within and beyond
    MAX_OBSERVABLE_ANGLE_DEG of the view vector; labels, reliability: of the stored labels and confidence; warnings: of
    all stages; seconds: by stage; normals: by method, (H, W, 3); truth (H, W, 3); confidence (H, W).
    """

    name: str
    frames: int
    size: tuple[int, int]
    methods: tuple[MethodErrors, ...]
    depth: DepthErrors | None
    confident_share: float
    confident_right_share: float
    within_42deg: float
    beyond_42deg: float
    labels: LabelErrors
    reliability: tuple[Reliability, ...]
    warnings: tuple[StageWarning, ...]
    seconds: dict[str, float]
    normals: dict[str, np.ndarray]
    truth: np.ndarray
    confidence: np.ndarray

    def method(self, name: str) -> MethodErrors:
        """Return the errors of the method with this name."""
        return next(errors for errors in self.methods if errors.method == name)


def evaluate(work: CaptureContext, stages: tuple[str, ...]) -> Evaluation | None:
    """Compare the stored result of a capture with its truth; None where it has no true normals.

    stages: names of the stages whose seconds and warnings are part of the evaluation.

    Raises:
        InputError: the truth is unusable, or lies beside the pixels that it is to judge; StoreError: the capture was
            not run.
    """
    if work.capture.truth is None:
        return None
    view = load_view(work)
    clusters, mask = view.clusters, view.mask
    truth = load_truth(work, mask.shape)
    if truth is None:
        return None
    labels, view_vectors = work.load("labels"), load_geometry(work).view_vectors
    normals = _normals_by_method(work, view)
    observed = mask & (clusters.observations > 0)
    _require_overlap(work.name, truth, observed, mask)
    records = {stage: work.load(stage).record for stage in stages}
    error = angles(normals["glint"], truth.normals)
    known = mask & np.isfinite(error)
    confidence = labels.read("confidence")
    confident = known & (confidence >= CONFIDENT)
    cosine = truth.normals[..., 2] if view_vectors is None else (truth.normals * view_vectors).sum(axis=-1)
    is_beyond = np.degrees(np.arccos(np.clip(cosine, -1, 1))) > MAX_OBSERVABLE_ANGLE_DEG
    squared = ((normals["glint"] - truth.normals) ** 2).sum(axis=-1)
    return Evaluation(
        name=work.name,
        frames=int(records["frames"]["counts"]["frames"]),
        size=(mask.shape[1], mask.shape[0]),
        methods=tuple(
            MethodErrors(
                method,
                observed_region=normal_errors(estimate, truth.normals, observed),
                whole_mask=normal_errors(estimate, truth.normals, mask),
            )
            for method, estimate in normals.items()
        ),
        depth=None if truth.depth is None else _depth_errors(work, truth.depth, mask),
        confident_share=_mean(confident[known]),
        confident_right_share=_mean(error[confident] < CONFIDENT_ERROR_DEG),
        within_42deg=_mean(squared[known & ~is_beyond]),
        beyond_42deg=_mean(squared[known & is_beyond]),
        labels=label_errors(labels.read("labels"), clusters.normals, truth.normals),
        reliability=reliability(confidence, normals["glint"], truth.normals),
        warnings=tuple(
            warning for record in records.values() for warning in map(StageWarning.from_json, record["warnings"])
        ),
        seconds={stage: float(record["seconds"]) for stage, record in records.items()},
        normals=normals,
        truth=truth.normals,
        confidence=confidence,
    )


def _require_overlap(name: str, truth: CaptureTruth, observed: np.ndarray, mask: np.ndarray) -> None:
    """Raise InputError if no true normal is at an observed pixel (H, W) bool, or no true depth in the mask (H, W)."""
    if not np.isfinite(truth.normals[observed]).all(axis=-1).any():
        raise InputError(
            f"no true normal is at a pixel where {name} has a highlight",
            "check that normals.npy is of this capture's region, and see the warnings of its run",
        )
    if truth.depth is not None and not np.isfinite(truth.depth[mask]).any():
        raise InputError(
            f"no true depth is inside the mask of {name}",
            "check that depth.npy is of this capture's region, or remove it",
        )


def _normals_by_method(work: CaptureContext, view: LabelledView) -> dict[str, np.ndarray]:
    """Return the normals (H, W, 3) of METHODS, camera frame, NaN where a method has none."""
    winner = view.clusters.winner
    return {
        "winner takes all": np.where(np.isfinite(winner), winner, view.initial),
        "silhouette only": view.initial,
        "paper": reconstruct(view, LabelsParameters(method="paper"), work.parameters.silhouette).normals,
        "glint": work.load("labels").read("normals"),
    }


def _depth_errors(work: CaptureContext, truth: np.ndarray, mask: np.ndarray) -> DepthErrors:
    """Return the errors of the stored depth against the true one (H, W), which is in pixels.

    The stored depth may be in millimetres. Under perspective both are measured from the distance at which a pixel
    covers one pixel's size, and the result's scale is as free as an orthographic offset: distances from the camera are
    scaled, by component of the mask, by the median of their ratios.
    """
    saved = work.load("depth")
    pixel_size = saved.record["pixel_size"] or 1.0
    depth = saved.read("depth") / pixel_size
    if saved.record["distance"] is not None:
        distance = saved.record["distance"] / pixel_size
        components, count = ndimage.label(mask)
        for number in range(1, count + 1):
            component = components == number
            known = component & np.isfinite(depth + truth)
            ratio = np.median((distance - truth[known]) / (distance - depth[known])) if known.any() else 1.0
            depth[component] = distance - ratio * (distance - depth[component])
    return depth_errors(depth, truth, mask)


def _mean(values: np.ndarray) -> float:
    """Return the mean, NaN for no values."""
    return float(values.mean()) if values.size else float("nan")
