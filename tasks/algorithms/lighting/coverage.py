"""Coverage of the half-vector hemisphere by the light's sweep, and the gaps in it.

A pixel shows a highlight when its normal is the half vector of light and view, so a capture can observe the normals
near which some frame's half vector lies: at most the cap within 45 degrees of the view vector, whose lights are before
the object ("data capture range", section 3 of Yeung et al. 2009). The cap is mapped by Lambert's azimuthal equal-area
projection, in which densities can be compared.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import label
from scipy.spatial import cKDTree

from glint.tasks.algorithms.geometry.vectors import equal_area

CAP_DEG = 45.0
"""Angle from the view vector up to which normals can be observed."""
MAX_OBSERVABLE_ANGLE_DEG = 42.0
"""Angle from the view vector within which a sweep determines normals; beyond, all normals are extrapolated."""
CAP_MAP_RADIUS = 2.0 * np.sin(np.radians(CAP_DEG) / 2.0)
"""Radius of the cap in the equal-area map of the unit sphere."""

SIDES = ("right", "upper right", "top", "upper left", "left", "lower left", "bottom", "lower right")
LIGHT_BANDS_DEG = ((0.0, 30.0), (30.0, 60.0), (60.0, 90.0))
"""Rings of light directions, by their angle from the camera axis, in which gaps are named."""
CENTRAL_BAND_DEG = 20.0
"""Angle from the camera axis of the lights around the camera."""
BRIGHT_DEG, REACH_DEG = 2.2, 5.0
"""Angle to a half vector up to which a normal shows a bright highlight, and up to which it is within the sweep."""
MIN_SWEEP_FRAMES = 100
"""Frames below which a capture is a set of photographs, each with a light of its own, and no sweep."""
MAP_SIZE = 128
"""Edge in pixels of maps of normals."""
COVERED_DEG = (1.5, 3.0)
"""Angles to the nearest half vector at which the covered share is given."""
DENSITY_SIGMA_DEG = 3.0
"""Standard deviation of the Gaussian that smooths the density."""
MIN_GAP_SHARE = 0.02
"""Share of the cap below which a gap is not reported."""
MIN_GAP_DISTANCE_DEG = 6.0
"""Least distance from the nearest half vector beyond which a normal belongs to a gap."""
GAP_RADII = 1.5
"""The same distance in radii of the disc that each of as many evenly spread half vectors has to itself: twelve
photographs are not expected to cover what a sweep does."""
EXTRAPOLATED_ERROR_DEG = 11.0
"""Usual error in degrees of normals that no light could show: root mean square beyond 42 degrees from the view vector
on the six simulated captures of docs/evaluation.md."""
MIN_EMPTY_SHARE = 0.5
"""Share of a sector's area without light from which it counts as a gap."""


@dataclass(frozen=True, slots=True)
class Gap:
    """Part of the light hemisphere without light.

    side: one of `SIDES`, or "centre". inner_deg, outer_deg: its angles from the camera axis. share: of the cap of
    normals, which it leaves unobserved and no other gap counts.
    """

    side: str
    inner_deg: float
    outer_deg: float
    share: float

    def __str__(self) -> str:
        """Describe the gap."""
        position = "around the camera" if self.side == "centre" else f"from the {self.side}"
        return f"{position}, {self.angles}"

    @property
    def angles(self) -> str:
        """Its angles from the camera axis in words."""
        return f"{self.inner_deg:.0f}-{self.outer_deg:.0f} degrees from the camera axis"


@dataclass(frozen=True, slots=True)
class Coverage:
    """Coverage of the cap of observable normals.

    density: (N, N) float32, frames per square degree of half vectors, NaN outside the cap; its pixel (row, column) is
    the direction at distance 2 sin(angle / 2) from the centre, x right and y up, and its edge the edge of the cap.
    covered_shares: share of the cap that lies within so many degrees of a frame's half vector, by that angle.
    gaps: largest first. frames: number of accepted frames.
    """

    density: np.ndarray
    covered_shares: dict[float, float]
    gaps: tuple[Gap, ...]
    frames: int


def gaps_message(gaps: Sequence[Gap]) -> str:
    """Return one sentence about all gaps and their remedy; sides with the same angles are named together."""
    sides: dict[str, list[str]] = {}
    for gap in gaps:
        sides.setdefault(gap.angles, []).append("around the camera" if gap.side == "centre" else f"the {gap.side}")
    if any(len(names) == len(SIDES) for names in sides.values()):
        sides = {angles: ["any side"] if len(names) == len(SIDES) else names for angles, names in sides.items()}
    parts = [f"{_joined(names)}, {angles}" for angles, names in sides.items()]
    share = sum(gap.share for gap in gaps)
    text = "; ".join(part if part.startswith("around") else f"from {part}" for part in parts)
    return f"no light {text} ({share:.0%} of the normals that can be observed): record again with the light there too"


def _joined(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def cap_directions(size: int) -> np.ndarray:
    """Return the unit vectors (N, N, 3) of the equal-area map of the cap, NaN outside it; N = `size`."""
    axis = (np.arange(size) + 0.5) / size * 2.0 - 1.0
    x, y = np.meshgrid(axis * CAP_MAP_RADIUS, -axis * CAP_MAP_RADIUS)
    squared = x**2 + y**2
    scale = np.sqrt(np.maximum(1.0 - squared / 4.0, 0.0))
    directions = np.stack([x * scale, y * scale, 1.0 - squared / 2.0], axis=-1)
    directions[squared > CAP_MAP_RADIUS**2] = np.nan
    return directions


def is_observable(normals: np.ndarray, half_vectors: np.ndarray, tolerance: float) -> np.ndarray:
    """Return (...) bool: normals (..., 3) within `tolerance` degrees of a half vector (T, 3; NaN where rejected)."""
    return nearest_half_vector_deg(normals, half_vectors) <= tolerance


def nearest_half_vector_deg(directions: np.ndarray, half_vectors: np.ndarray) -> np.ndarray:
    """Return the angle (...) in degrees from directions (..., 3) to the nearest half vector (T, 3).

    It is infinite where the direction is NaN or no half vector is finite.
    """
    known = half_vectors[np.isfinite(half_vectors).all(axis=-1)]
    result = np.full(directions.shape[:-1], np.inf)
    valid = np.isfinite(directions).all(axis=-1)
    if len(known) and valid.any():
        chord, _ = cKDTree(known).query(directions[valid])
        result[valid] = np.degrees(2.0 * np.arcsin(np.clip(chord / 2.0, 0.0, 1.0)))
    return result


def share_between(half_vectors: np.ndarray) -> float:
    """Return the share of the normals within a sweep that have no half vector near them.

    half_vectors: (T, 3), NaN where the frame was rejected. 0 if the sweep surrounds no normal that can be observed.
    """
    directions = cap_directions(MAP_SIZE)
    distance = nearest_half_vector_deg(directions, half_vectors)
    within = (distance <= REACH_DEG) & (directions[..., 2] > np.cos(np.radians(MAX_OBSERVABLE_ANGLE_DEG)))
    return float((distance[within] > BRIGHT_DEG).mean()) if within.any() else 0.0


def coverage(half_vectors: np.ndarray) -> Coverage:
    """Compute the coverage by half vectors (T, 3), unit, camera frame, NaN where the frame was rejected.

    No frame at all is one large gap.
    """
    directions = cap_directions(MAP_SIZE)
    inside = np.isfinite(directions[..., 0])
    accepted = half_vectors[np.isfinite(half_vectors).all(axis=-1)].astype(np.float64)
    distance = nearest_half_vector_deg(directions, accepted)
    cap_deg2 = np.pi * np.degrees(CAP_MAP_RADIUS) ** 2
    radius_deg = np.sqrt(cap_deg2 / (np.pi * max(len(accepted), 1)))
    gap_distance = max(MIN_GAP_DISTANCE_DEG, float(GAP_RADII * radius_deg))
    return Coverage(
        _density(directions, accepted),
        {limit: float((distance[inside] <= limit).mean()) for limit in COVERED_DEG},
        _gaps(directions, distance > gap_distance, MIN_GAP_SHARE),
        len(accepted),
    )


def _density(directions: np.ndarray, accepted: np.ndarray) -> np.ndarray:
    """Return the density (N, N) float32 of half vectors (T, 3) per square degree, smoothed, NaN outside the cap."""
    size = len(directions)
    # Pixel of each half vector in the equal-area map.
    flat = equal_area(accepted)
    column = np.floor((flat[:, 0] / CAP_MAP_RADIUS + 1.0) / 2.0 * size).astype(int)
    row = np.floor((1.0 - flat[:, 1] / CAP_MAP_RADIUS) / 2.0 * size).astype(int)
    known = (row >= 0) & (row < size) & (column >= 0) & (column < size)
    counts = np.zeros((size, size))
    np.add.at(counts, (row[known], column[known]), 1.0)
    # Normalized convolution: division by the smoothed cap, so that its edge loses nothing to the outside.
    inside = np.isfinite(directions[..., 0])
    pixel_deg = np.degrees(2.0 * CAP_MAP_RADIUS / size)
    sigma = DENSITY_SIGMA_DEG / pixel_deg
    share = cv2.GaussianBlur(inside.astype(np.float64), (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    smooth = cv2.GaussianBlur(counts * inside, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    return np.where(inside, smooth / np.maximum(share, 1e-9) / pixel_deg**2, np.nan).astype(np.float32)


def _gaps(directions: np.ndarray, empty: np.ndarray, min_share: float) -> tuple[Gap, ...]:
    """Return the sectors of the light hemisphere that are mostly without light, largest first.

    directions (N, N, 3): half vectors of the map; empty (N, N) bool: far from every frame.
    """
    inside = np.isfinite(directions[..., 0])
    # The light lies at twice the half vector's angle from the view vector, in the same azimuth.
    angle = 2.0 * np.degrees(np.arccos(np.clip(np.where(inside, directions[..., 2], 1.0), -1.0, 1.0)))
    azimuth = np.degrees(np.arctan2(directions[..., 1], directions[..., 0]))
    sector = np.where(inside, np.round(np.nan_to_num(azimuth) / 45.0), 0.0).astype(int) % len(SIDES)
    is_empty_band = np.zeros((len(SIDES), len(LIGHT_BANDS_DEG)), bool)
    for number, band in np.ndindex(is_empty_band.shape):
        inner, outer = LIGHT_BANDS_DEG[band]
        part = inside & (sector == number) & (angle >= inner) & (angle < outer)
        is_empty_band[number, band] = (empty & part).sum() > MIN_EMPTY_SHARE * part.sum()
    gaps, uncounted = [], empty & inside
    centre = inside & (angle < CENTRAL_BAND_DEG)
    # Where light is missing on all sides, the innermost bands contain the centre.
    if (empty & centre).sum() > MIN_EMPTY_SHARE * centre.sum() and not is_empty_band[:, 0].all():
        gaps.append(Gap("centre", 0.0, CENTRAL_BAND_DEG, float((empty & centre).sum() / inside.sum())))
        uncounted &= ~centre
    for number, side in enumerate(SIDES):
        # Adjacent empty bands of one side are one gap.
        runs, count = label(is_empty_band[number])
        for run in range(1, count + 1):
            bands = [band for band, band_run in zip(LIGHT_BANDS_DEG, runs, strict=True) if band_run == run]
            inner, outer = bands[0][0], bands[-1][1]
            part = inside & (sector == number) & (angle >= inner) & (angle < outer) & uncounted
            gaps.append(Gap(side, inner, outer, float(part.sum() / inside.sum())))
    return tuple(sorted((gap for gap in gaps if gap.share >= min_share), key=lambda gap: -gap.share))
