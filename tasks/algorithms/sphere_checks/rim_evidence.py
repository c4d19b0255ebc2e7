"""Evidence of a chrome sphere's contour by what its rim mirrors, along rays from an approximate centre.

A contour explains the levels along a ray if those inside it are the compressed mirror image of those outside, frame by
frame, and those outside change no more than a table's do.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numba import njit

from glint.tasks.algorithms.lighting.circles import EdgeEvidence, RaySamples, sample_rays
from glint.tasks.algorithms.lighting.contour import INWARD_SHIFT_PX, change_along_rays, level_evidence

RIM_RAYS = 48
"""Rays from the centre."""
WINDOW_RATIO, TABLE_RATIO = 0.2, 2.2
"""Distance inside and outside the circle, in radii, of the samples that a contour must explain, and the radius up to
which the table is sampled."""
RADIUS_REACH_RATIO, CENTRE_REACH_RATIO = 0.12, 0.06
"""Differences of radius and of centre that are searched, in radii."""
USUAL_RATIOS, MIN_USUAL = (1.12, 1.45), 0.02
"""Radii, relative to the circle's, between which the table's usual change is measured, and what noise adds to it, in
log levels per pixel."""
HALF_SQUARE = 4.0
"""Squared residual, relative to the usual change, at which a misfit is one half."""
RIM_END_PX = 1.0
"""Distance beyond a contour up to which the blurred mirror image is compared with the levels."""
RIM_SHIFT_PX = 0.2
"""Distance by which the best contour lies inside the true one."""
EDGE_WEIGHT = 0.2
"""Weight of the evidence of an edge at the contour itself."""


@dataclass(frozen=True, slots=True)
class RimModel:
    """How a rim mirrors the table.

    tilt: of the table's normal against the view, upwards in the picture, radians. blur: standard deviation in pixels.
    step: of the log levels from the table to its mirror image.
    """

    tilt: float
    blur: float
    step: float


def mirrored_radius(radius: np.ndarray, upward: np.ndarray, tilt: float) -> np.ndarray:
    """Return where what a sphere mirrors is seen beside it, by the law of reflection at a sphere on a plane.

    Args:
        radius: (..., N) of the mirror image, in radii of the sphere, at most 1.
        upward: (..., 1) component of the outward direction along which it lies, upwards in the picture.
        tilt: of the plane's normal against the view, radians, turned upwards.

    Returns:
        Radius (..., N) in the same direction and unit, at least 1; NaN where no plane is mirrored.
    """
    depth = np.sqrt(np.maximum(1.0 - radius**2, 0.0))
    # The view is turned outwards by twice the angle between the surface and the view.
    cosine, sine = 1.0 - 2.0 * depth**2, 2.0 * depth * radius
    outward, along = np.sin(tilt) * upward, np.cos(tilt)
    falling = cosine * along - sine * outward
    path = (1.0 + radius * outward + depth * along) / np.where(falling > 1e-3, falling, np.nan)
    return np.asarray(radius + path * sine)


def circle_score(evidence: EdgeEvidence, x: float, y: float, radius: float) -> float:
    """Return the mean evidence along a circle, as `fine_fit` takes it."""
    centred = evidence.moved(x - evidence.x, y - evidence.y)
    return float(centred.scores(np.zeros(1), np.array([radius - INWARD_SHIFT_PX])).item())


@dataclass(frozen=True, slots=True)
class RimSamples:
    """Samples along rays about a circle, and what its contour must explain.

    radius: of the circle, pixels. usual: (T,) change of the table's log levels per pixel that is usual. change: (T, A,
    N) misfit, 0..1, of levels that belong to the table. edges: evidence of edges.
    """

    samples: RaySamples
    radius: float
    usual: np.ndarray
    change: np.ndarray
    edges: EdgeEvidence

    @classmethod
    def take(cls, frames: Sequence[np.ndarray], x: float, y: float, radius: float) -> "RimSamples":
        """Sample frames of `log_frames` along rays from (x, y)."""
        reach = (1.0 - WINDOW_RATIO) * radius, TABLE_RATIO * radius
        samples = sample_rays(frames, x, y, *reach, rays=RIM_RAYS, interpolation=cv2.INTER_CUBIC)
        change = np.stack([change_along_rays(levels, samples.reach) for levels in samples.levels])
        change /= 2 * samples.reach * samples.spacing
        low, high = (ratio * radius for ratio in USUAL_RATIOS)
        table = samples.valid & (samples.radii > low) & (samples.radii < high)
        if table.any():
            usual = np.array([np.median(np.abs(values[table])) for values in change]) + MIN_USUAL
        else:
            usual = np.full(len(change), MIN_USUAL)
        square = (change / usual[:, None, None]) ** 2
        return cls(samples, radius, usual, square / (square + HALF_SQUARE), level_evidence(samples))

    def evidence(self, model: RimModel, frames: int | None = None) -> EdgeEvidence:
        """Measure how well a contour at each radius of a ray explains its samples, in some of the frames; None: all."""
        samples, radii = self.samples, self.samples.radii
        kept = slice(None, None, 1 if frames is None else max(1, len(self.usual) // frames))
        first, last = np.searchsorted(radii, self.radius * np.array([1.0 - WINDOW_RATIO, 1.0 + WINDOW_RATIO]))
        reach = RADIUS_REACH_RATIO + CENTRE_REACH_RATIO
        contours = np.arange(*np.searchsorted(radii, self.radius * np.array([1.0 - reach, 1.0 + reach])))
        ratio = np.minimum(radii[:last] / radii[contours, None], 1.0)[:, None]
        mirrored = mirrored_radius(ratio, -np.sin(samples.angles)[:, None], model.tilt)
        places = (mirrored * radii[contours, None, None] - samples.start) / samples.spacing
        half = int(np.ceil(2.5 * model.blur / samples.spacing))
        kernel = np.exp(-0.5 * (np.arange(-half, half + 1) * samples.spacing / model.blur) ** 2)
        misfits = _misfits(
            samples.levels[kept], samples.valid, self.usual[kept], self.change[kept], np.nan_to_num(places, nan=-1.0),
            contours, model.step, kernel / kernel.sum(), first, round(RIM_END_PX / samples.spacing),
        )  # fmt: skip
        # Rays that show too little count like the others.
        known = np.isfinite(misfits)
        usual = np.where(known, misfits, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        edges = self.edges.moved(0.0, 0.0, -INWARD_SHIFT_PX).evidence[:, contours]
        evidence = EDGE_WEIGHT * edges - np.where(known, misfits, np.where(known.any(axis=0), usual, 1.0))
        # `fine_fit` takes the strongest evidence to lie so far inside the contour.
        start = float(radii[contours[0]]) - INWARD_SHIFT_PX
        return replace(self.edges, evidence=evidence.astype(np.float32), start=start)


@njit(cache=True, nogil=True)
def _misfits(
    levels: np.ndarray,
    valid: np.ndarray,
    usual: np.ndarray,
    change: np.ndarray,
    places: np.ndarray,
    contours: np.ndarray,
    step: float,
    kernel: np.ndarray,
    first: int,
    beyond: int,
) -> np.ndarray:
    """Return the mean misfit (A, K) of the samples from `first` on to contours at the samples `contours` (K,).

    levels, change: (T, A, N); valid: (A, N); usual: (T,); places: (K, A, M), sample that each of the first M mirrors,
    negative if none; kernel: of the blur; beyond: samples outside a contour that are compared with the mirror image,
    too. NaN where more than half of the samples are unknown.
    """
    count, rays, samples = levels.shape
    last, half = places.shape[2], len(kernel) // 2
    result = np.full((rays, len(contours)), np.nan)
    predicted, known = np.empty(last + half), np.empty(last, np.bool_)
    for a in range(rays):
        for k in range(len(contours)):
            contour, used = contours[k], 0
            for n in range(last):
                place = places[k, a, n]
                known[n] = valid[a, n] and (
                    n >= contour or (place >= 0.0 and place < samples - 1.0 and valid[a, int(place)])
                )
                used += known[n] and n >= first
            if 2 * used < last - first:
                continue
            total = 0.0
            for t in range(count):
                for n in range(last + half):
                    if n < contour and n < last and known[n]:
                        lower = int(places[k, a, n])
                        part = places[k, a, n] - lower
                        predicted[n] = (1.0 - part) * levels[t, a, lower] + part * levels[t, a, lower + 1] + step
                    else:
                        predicted[n] = levels[t, a, min(n, samples - 1)]
                for n in range(first, last):
                    if not known[n]:
                        continue
                    if n >= contour + beyond:
                        total += change[t, a, n]
                        continue
                    blurred = 0.0
                    for m in range(-half, half + 1):
                        blurred += kernel[m + half] * predicted[max(n + m, 0)]
                    square = ((levels[t, a, n] - blurred) / usual[t]) ** 2
                    total += square / (square + HALF_SQUARE)
            result[a, k] = total / (used * count)
    return result
