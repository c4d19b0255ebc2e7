"""Evaluate: errors of a capture's result against its truth, beside those of the baselines and of the literal paper."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.algorithms.evaluation.metrics import (
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
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.parameters import LabelsParameters
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.clusters import load_clusters
from glint.tasks.stages.labels import reconstruct
from glint.tasks.stages.markup import load_marks

METHODS = ("winner takes all", "silhouette only", "paper", "glint")
CONFIDENT = 0.95
"""Confidence from which a pixel is counted as trusted."""
SEEN_BEST = 42.0
"""Degrees from the view axis within which a highlight can tell a normal; beyond, everything is extrapolated."""


@dataclass(frozen=True, slots=True)
class MethodErrors:
    """Errors of one method over the data region (M > 0) and over the whole mask."""

    method: str
    data: NormalErrors
    whole: NormalErrors


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A capture against its truth: all methods; depth, confidence and stages of the stored result.

    trusted: share of the mask with confidence >= 0.95, and the share of that within 5 degrees; near, far: squared error
    within and beyond 42 degrees of the view axis; labels, reliability: of the stored labels and confidence; warnings:
    of all stages; normals: by method, (H, W, 3); truth likewise; confidence (H, W).
    """

    name: str
    frames: int
    size: tuple[int, int]
    methods: tuple[MethodErrors, ...]
    depth: DepthErrors | None
    trusted: tuple[float, float]
    near: float
    far: float
    labels: LabelErrors
    reliability: tuple[Reliability, ...]
    warnings: tuple[str, ...]
    seconds: dict[str, float]
    normals: dict[str, np.ndarray]
    truth: np.ndarray
    confidence: np.ndarray

    def method(self, name: str) -> MethodErrors:
        """Errors of a method."""
        return next(each for each in self.methods if each.method == name)


def evaluate(work: Workspace, stages: tuple[str, ...]) -> Evaluation | None:
    """Judge what is stored of a capture; None where it has no true normals.

    Raises:
        InputError: the truth is unusable; StoreError: the capture was not run.
    """
    if work.capture.truth is None:
        return None
    mask = work.load("mask").read("mask")
    truth = read_truth(work.capture.truth, (mask.shape[0], mask.shape[1]))
    if truth.normals is None:
        return None
    clusters, initial = load_clusters(work), work.load("silhouette").read("initial")
    labels, view = work.load("labels"), load_geometry(work).view_vectors
    literal, silhouette = LabelsParameters(method="paper"), work.parameters.silhouette
    winner = np.where(np.isfinite(clusters.winner), clusters.winner, initial)
    normals = {
        "winner takes all": winner,
        "silhouette only": initial,
        "paper": reconstruct(clusters, mask, initial, load_marks(work), literal, silhouette, view=view).normals,
        "glint": labels.read("normals"),
    }
    data = mask & (clusters.observations > 0)
    records = {stage: work.load(stage).record for stage in stages}
    error = angles(normals["glint"], truth.normals)
    known = mask & np.isfinite(error)
    confidence = labels.read("confidence")
    trusted = known & (confidence >= CONFIDENT)
    facing_camera = truth.normals[..., 2] if view is None else (truth.normals * view).sum(axis=-1)
    steep = np.degrees(np.arccos(np.clip(facing_camera, -1, 1))) > SEEN_BEST
    squared = ((normals["glint"] - truth.normals) ** 2).sum(axis=-1)
    return Evaluation(
        name=work.name,
        frames=int(records["frames"]["counts"]["frames"]),
        size=(mask.shape[1], mask.shape[0]),
        methods=tuple(
            MethodErrors(method, normal_errors(found, truth.normals, data), normal_errors(found, truth.normals, mask))
            for method, found in normals.items()
        ),
        depth=None if truth.depth is None else _depth(work, truth.depth, mask),
        trusted=(_mean(trusted[known]), _mean(error[trusted] < 5.0)),
        near=_mean(squared[known & ~steep]),
        far=_mean(squared[known & steep]),
        labels=label_errors(labels.read("labels"), clusters.normals, truth.normals),
        reliability=reliability(confidence, normals["glint"], truth.normals),
        warnings=tuple(warning for record in records.values() for warning in record["warnings"]),
        seconds={stage: float(record["seconds"]) for stage, record in records.items()},
        normals=normals,
        truth=truth.normals,
        confidence=confidence,
    )


def _depth(work: Workspace, truth: np.ndarray, mask: np.ndarray) -> DepthErrors:
    """The truth's depth is in pixels; the result's may be in millimetres.

    Under perspective both count from the distance at which a pixel covers one pixel's size, and the result's scale is
    as free as an orthographic offset: distances from the camera are fitted by their median ratio.
    """
    saved = work.load("depth")
    pixel_size = saved.record["pixel_size"] or 1.0
    depth = saved.read("depth") / pixel_size
    if saved.record["distance"] is not None:
        distance = saved.record["distance"] / pixel_size
        components, count = ndimage.label(mask)
        for number in range(1, count + 1):
            here = (components == number) & np.isfinite(depth + truth)
            ratio = np.median((distance - truth[here]) / (distance - depth[here])) if here.any() else 1.0
            depth[components == number] = distance - ratio * (distance - depth[components == number])
    return depth_errors(depth, truth, mask)


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if values.size else float("nan")
