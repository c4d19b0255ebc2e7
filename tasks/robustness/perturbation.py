"""A perturbation: one input of a capture wrong by a known amount, and what the capture's inputs become by it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from glint.storage.catalogue.loading import Capture
from glint.tasks.engine.stage_warning import Cause

LOSSLESS_CRF = 4
"""Constant rate factor at which a video is written whose bit rate is not what is perturbed: errors below one level."""


@dataclass(frozen=True, slots=True)
class VideoChange:
    """A change of a video's frames.

    order(count, generator) -> (T,) int: the frames that are kept, in their new order; sphere_order, alike: the frames
    from which the pixels of the spheres are taken; pixels(frame, share, generator) -> frame: the new luma (H, W) of the
    frame that comes after this share of the video; crf: constant rate factor of the new video.
    """

    order: Callable[[int, np.random.Generator], np.ndarray] | None = None
    sphere_order: Callable[[int, np.random.Generator], np.ndarray] | None = None
    pixels: Callable[[np.ndarray, float, np.random.Generator], np.ndarray] | None = None
    crf: int = LOSSLESS_CRF


@dataclass(frozen=True, slots=True)
class CaptureInputs:
    """Inputs of a capture with ground truth.

    entry: of the catalogue, with a region; mask (H, W) bool of the region, None where it is estimated; lights (T, 3):
    the true directions to the light, NaN where it is off, None where they are not known; video: None where the frames
    stay as they are.
    """

    entry: Capture
    mask: np.ndarray | None
    lights: np.ndarray | None
    video: VideoChange | None = None


@dataclass(frozen=True, slots=True)
class Perturbation:
    """A perturbation.

    causes: of the warnings that name it; change(inputs) -> the perturbed inputs, None where it does not apply to a
    capture; options: of the simulation, for what must be simulated again; such a perturbation without a change does not
    apply to captures that were recorded.
    """

    causes: tuple[Cause, ...]
    change: Callable[[CaptureInputs], CaptureInputs | None] | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
