"""Errors against the truth: normals as the paper has them and in degrees, and depth."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.vectors import angles

WITHIN = (5.0, 11.25, 22.5)
"""Degrees below which shares are counted, as the photometric stereo literature does."""


@dataclass(frozen=True, slots=True)
class NormalErrors:
    """Errors over one region of `pixels` pixels: `squared` mean |n - truth|^2 of unit normals (paper, Tables 2 and 3);
    mean and median angle in degrees; `within` shares below WITHIN; `missing` pixels without a result, left out."""

    pixels: int
    squared: float
    mean: float
    median: float
    within: tuple[float, ...]
    missing: int


@dataclass(frozen=True, slots=True)
class DepthErrors:
    """Depth against truth, each component shifted to fit: mean absolute and RMS error in the truth's unit; the mean as
    a share of the diagonal of the object's bounding box; `missing` pixels without a result, left out."""

    mean: float
    rms: float
    relative: float
    missing: int


def normal_errors(normals: np.ndarray, truth: np.ndarray, region: np.ndarray) -> NormalErrors:
    """Errors of normals (H, W, 3) against truth (H, W, 3) over a region (H, W) bool; truth that is NaN is left out.

    Raises ValueError where shapes differ or nothing can be compared.
    """
    if normals.shape != truth.shape or region.shape != truth.shape[:2]:
        raise ValueError(f"normals {normals.shape}, truth {truth.shape} and region {region.shape} do not fit")
    judged = region & np.isfinite(truth).all(axis=-1)
    there = judged & np.isfinite(normals).all(axis=-1)
    if not there.any():
        raise ValueError("no pixel of the region has both a normal and a truth")
    found, true = normals[there].astype(np.float64), truth[there].astype(np.float64)
    degrees = angles(found, true)
    return NormalErrors(
        pixels=int(judged.sum()),
        squared=float(((found - true) ** 2).sum(axis=-1).mean()),
        mean=float(degrees.mean()),
        median=float(np.median(degrees)),
        within=tuple(float((degrees < limit).mean()) for limit in WITHIN),
        missing=int((judged & ~there).sum()),
    )


def squared_errors(normals: np.ndarray, truth: np.ndarray, region: np.ndarray) -> float:
    """Mean |n - truth|^2 over a region: `NormalErrors.squared` alone."""
    return normal_errors(normals, truth, region).squared


@dataclass(frozen=True, slots=True)
class LabelErrors:
    """Of the nodes labelled exterior, the share within 5 degrees of the truth; of the pixels that have such a node, the
    share where one of them is labelled so. NaN where there is none."""

    precision: float
    recall: float


def label_errors(labels: np.ndarray, candidates: np.ndarray, truth: np.ndarray) -> LabelErrors:
    """Errors of labels (K, H, W), 1 = exterior, of candidates (K, H, W, 3) against truth (H, W, 3); NaN is left out."""
    off = angles(candidates, truth[None])
    chosen, right = (labels > 0) & np.isfinite(off), off < WITHIN[0]
    there = right.any(axis=0)
    return LabelErrors(_share(right[chosen]), _share((chosen & right).any(axis=0)[there]))


RELIABILITY = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
"""Bounds of the confidences that are compared with what is right."""


@dataclass(frozen=True, slots=True)
class Reliability:
    """Pixels of one range of confidence: from `low` (to the next); how many, their mean confidence, and the share that
    is within 5 degrees of the truth."""

    low: float
    pixels: int
    confidence: float
    right: float


def reliability(confidence: np.ndarray, normals: np.ndarray, truth: np.ndarray) -> tuple[Reliability, ...]:
    """The reliability diagram of a confidence (H, W), NaN where there is none; ranges without pixels are left out."""
    off = angles(normals, truth)
    known = np.isfinite(off) & np.isfinite(confidence)
    sure, right = confidence[known], off[known] < WITHIN[0]
    which = np.clip(np.searchsorted(RELIABILITY, sure, side="right") - 1, 0, len(RELIABILITY) - 2)
    return tuple(
        Reliability(low, int(here.sum()), float(sure[here].mean()), float(right[here].mean()))
        for number, low in enumerate(RELIABILITY[:-1])
        if (here := which == number).any()
    )


def _share(flags: np.ndarray) -> float:
    return float(flags.mean()) if flags.size else float("nan")


def depth_errors(depth: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> DepthErrors:
    """Errors of depth (H, W) against truth (H, W), both towards the camera in one unit, inside a mask (H, W) bool.

    One view does not show offsets, so each 4-connected component is shifted by the median difference.
    Raises ValueError where shapes differ or nothing can be compared.
    """
    if depth.shape != truth.shape or mask.shape != truth.shape:
        raise ValueError(f"depth {depth.shape}, truth {truth.shape} and mask {mask.shape} do not fit")
    known = mask & np.isfinite(depth) & np.isfinite(truth)
    if not known.any():
        raise ValueError("no pixel of the mask has both a depth and a truth")
    components, count = ndimage.label(mask)
    error = np.where(known, depth - truth, np.nan).astype(np.float64)
    for number in range(1, count + 1):
        here = known & (components == number)
        if here.any():
            error[here] -= np.median(error[here])
    rows, columns = np.nonzero(known)
    extent = (np.ptp(rows) + 1.0, np.ptp(columns) + 1.0, float(np.ptp(truth[known])))
    off = error[known]
    mean = float(np.abs(off).mean())
    missing = int((mask & np.isfinite(truth) & ~known).sum())
    return DepthErrors(mean, float(np.sqrt((off**2).mean())), mean / float(np.linalg.norm(extent)), missing)
