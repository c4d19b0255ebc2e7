"""Errors of one view against its truth, of normals, labels, confidence and depth.

Normal errors are those of the paper (section 5, mean squared difference of unit normals) and of the photometric stereo
literature (degrees).
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.vectors import angles

ANGLE_LIMITS_DEG = (5.0, 11.25, 22.5)
"""Limits below which shares of pixels are counted, as is usual in photometric stereo; the first one counts as right."""
CONFIDENCE_BINS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
"""Bounds of the bins of the reliability diagram."""


@dataclass(frozen=True, slots=True)
class NormalErrors:
    """Errors of normals over one region.

    pixels: in the region, with truth; squared: mean |n - truth|^2 of unit normals (the paper's error); mean, median:
    angle in degrees; within: shares below ANGLE_LIMITS_DEG; missing: pixels without a result, left out of the errors.
    """

    pixels: int
    squared: float
    mean: float
    median: float
    within: tuple[float, ...]
    missing: int


@dataclass(frozen=True, slots=True)
class DepthErrors:
    """Errors of depth, each component shifted to fit.

    mean, rms: absolute and root-mean-square error in the truth's unit; relative: the mean as a share of the diagonal of
    the object's bounding box; missing: pixels without a result, left out of the errors.
    """

    mean: float
    rms: float
    relative: float
    missing: int


@dataclass(frozen=True, slots=True)
class LabelErrors:
    """Errors of labels; NaN where there is nothing to count.

    precision: share of the exterior nodes within 5 degrees of the truth; recall: share of the pixels with such a node
    where it is labelled exterior.
    """

    precision: float
    recall: float


@dataclass(frozen=True, slots=True)
class Reliability:
    """One bin of the reliability diagram.

    low: lower bound of its confidences; pixels: in it; confidence: their mean; right: share within 5 degrees of the
    truth.
    """

    low: float
    pixels: int
    confidence: float
    right: float


def normal_errors(normals: np.ndarray, truth: np.ndarray, region: np.ndarray) -> NormalErrors:
    """Compute errors of normals (H, W, 3) against truth (H, W, 3) over a region (H, W) bool.

    All unit, in one frame; pixels whose truth is NaN are left out.

    Raises:
        ValueError: shapes differ, or nothing can be compared.
    """
    if normals.shape != truth.shape or region.shape != truth.shape[:2]:
        raise ValueError(f"normals {normals.shape}, truth {truth.shape} and region {region.shape} do not fit")
    judged = region & np.isfinite(truth).all(axis=-1)
    known = judged & np.isfinite(normals).all(axis=-1)
    if not known.any():
        raise ValueError("no pixel of the region has both a normal and a truth")
    estimated, true = normals[known].astype(np.float64), truth[known].astype(np.float64)
    degrees = angles(estimated, true)
    return NormalErrors(
        pixels=int(judged.sum()),
        squared=float(((estimated - true) ** 2).sum(axis=-1).mean()),
        mean=float(degrees.mean()),
        median=float(np.median(degrees)),
        within=tuple(float((degrees < limit).mean()) for limit in ANGLE_LIMITS_DEG),
        missing=int((judged & ~known).sum()),
    )


def squared_errors(normals: np.ndarray, truth: np.ndarray, region: np.ndarray) -> float:
    """Return `NormalErrors.squared` alone; normals, truth (H, W, 3); region (H, W) bool."""
    return normal_errors(normals, truth, region).squared


def label_errors(labels: np.ndarray, candidates: np.ndarray, truth: np.ndarray) -> LabelErrors:
    """Compute errors of labels (K, H, W), 1 = exterior, of candidates (K, H, W, 3) against truth (H, W, 3).

    Pixels whose truth is NaN are left out.
    """
    error = angles(candidates, truth[None])
    chosen, right = (labels > 0) & np.isfinite(error), error < ANGLE_LIMITS_DEG[0]
    decidable = right.any(axis=0)
    return LabelErrors(_share(right[chosen]), _share((chosen & right).any(axis=0)[decidable]))


def reliability(confidence: np.ndarray, normals: np.ndarray, truth: np.ndarray) -> tuple[Reliability, ...]:
    """Compute the reliability diagram of a confidence.

    confidence (H, W), NaN where there is none; normals, truth (H, W, 3). Bins without pixels are left out.
    """
    error = angles(normals, truth)
    known = np.isfinite(error) & np.isfinite(confidence)
    known_confidence, right = confidence[known], error[known] < ANGLE_LIMITS_DEG[0]
    bins = np.searchsorted(CONFIDENCE_BINS, known_confidence, side="right") - 1
    # A confidence of exactly 1 belongs to the last bin.
    bins = np.clip(bins, 0, len(CONFIDENCE_BINS) - 2)
    return tuple(
        Reliability(low, int(inside.sum()), float(known_confidence[inside].mean()), float(right[inside].mean()))
        for number, low in enumerate(CONFIDENCE_BINS[:-1])
        if (inside := bins == number).any()
    )


def _share(flags: np.ndarray) -> float:
    return float(flags.mean()) if flags.size else float("nan")


def depth_errors(depth: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> DepthErrors:
    """Compute errors of depth (H, W) against truth (H, W) inside a mask (H, W) bool.

    Both grow towards the camera, in one unit. A single view does not show offsets, so each 4-connected component is
    shifted by the median difference.

    Raises:
        ValueError: shapes differ, or nothing can be compared.
    """
    if depth.shape != truth.shape or mask.shape != truth.shape:
        raise ValueError(f"depth {depth.shape}, truth {truth.shape} and mask {mask.shape} do not fit")
    known = mask & np.isfinite(depth) & np.isfinite(truth)
    if not known.any():
        raise ValueError("no pixel of the mask has both a depth and a truth")
    components, count = ndimage.label(mask)
    difference = np.where(known, depth - truth, np.nan).astype(np.float64)
    for number in range(1, count + 1):
        inside = known & (components == number)
        if inside.any():
            difference[inside] -= np.median(difference[inside])
    rows, columns = np.nonzero(known)
    extent = (np.ptp(rows) + 1.0, np.ptp(columns) + 1.0, float(np.ptp(truth[known])))
    errors = difference[known]
    mean = float(np.abs(errors).mean())
    missing = int((mask & np.isfinite(truth) & ~known).sum())
    return DepthErrors(mean, float(np.sqrt((errors**2).mean())), mean / float(np.linalg.norm(extent)), missing)
