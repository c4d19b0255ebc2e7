"""Where on the hemisphere of half vectors the lamp has been, what that leaves unseen, and a picture of it.

A pixel glints when its normal is the half vector of the lamp and the view, so the normals that a capture can observe
are those near which some frame's half vector lies: at most the cap within 45 degrees of the view vector, whose lamps
are before the object (paper, section 3).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import label
from scipy.spatial import cKDTree

CAP = 45.0
"""Degrees from the view vector within which normals can be observed."""

SIDES = ("right", "upper right", "top", "upper left", "left", "lower left", "bottom", "lower right")
BANDS = ((0.0, 30.0), (30.0, 60.0), (60.0, 90.0))
"""Rings of light directions, degrees from the camera axis, in which gaps are named."""


@dataclass(frozen=True, slots=True)
class Gap:
    """A part of the lamp's hemisphere without light: `share` of the cap of normals that it leaves unobserved."""

    side: str
    nearest: float
    farthest: float
    share: float

    def __str__(self) -> str:
        """What is missing and what to do about it."""
        where = "around the camera" if self.side == "centre" else f"from the {self.side}"
        angle = f"{self.nearest:.0f}-{self.farthest:.0f} degrees from the camera axis"
        return f"no light {where}, {angle} ({self.share:.0%} of the normals): re-shoot with the lamp there"


@dataclass(frozen=True, slots=True)
class Coverage:
    """The lamp's sweep: `density` (N, N) float32, frames per square degree of half vectors, NaN outside the cap.

    The map is equal in area: its pixel (row, column) is the direction at distance 2 sin(angle / 2), x right and y up,
    its edge the rim of the cap. `within` maps degrees to the share of the cap that near a frame; `frames` counts them.
    """

    density: np.ndarray
    within: dict[float, float]
    gaps: tuple[Gap, ...]
    frames: int


def cap_directions(size: int) -> np.ndarray:
    """Unit vectors (N, N, 3) of the equal-area map of the cap, NaN outside it."""
    radius = 2.0 * np.sin(np.radians(CAP) / 2.0)
    axis = (np.arange(size) + 0.5) / size * 2.0 - 1.0
    x, y = np.meshgrid(axis * radius, -axis * radius)
    squared = x**2 + y**2
    scale = np.sqrt(np.maximum(1.0 - squared / 4.0, 0.0))
    directions = np.stack([x * scale, y * scale, 1.0 - squared / 2.0], axis=-1)
    directions[squared > radius**2] = np.nan
    return directions


def could_observe(normals: np.ndarray, half_vectors: np.ndarray, tolerance: float) -> np.ndarray:
    """(...) bool: whether some accepted half vector (T, 3) lies within `tolerance` degrees of each normal (..., 3)."""
    return _nearest(normals, half_vectors) <= tolerance


def coverage(
    half_vectors: np.ndarray,
    *,
    degrees: tuple[float, ...] = (1.5, 3.0),
    size: int = 128,
    bandwidth: float = 3.0,
    gap_distance: float = 6.0,
    least_gap: float = 0.02,
) -> Coverage:
    """Coverage of half vectors (T, 3), NaN where the frame was rejected.

    `density` is smoothed by a Gaussian of `bandwidth` degrees. Normals further than `gap_distance` degrees from every
    frame form the gaps; one that takes less than `least_gap` of the cap is not named. No frame at all is one gap.
    """
    directions = cap_directions(size)
    inside = np.isfinite(directions[..., 0])
    accepted = half_vectors[np.isfinite(half_vectors).all(axis=-1)].astype(np.float64)
    distance = _nearest(directions, accepted)
    within = {limit: float((distance[inside] <= limit).mean()) for limit in degrees}
    return Coverage(
        _density(directions, accepted, bandwidth),
        within,
        _gaps(directions, distance > gap_distance, least_gap),
        len(accepted),
    )


def _nearest(directions: np.ndarray, half_vectors: np.ndarray) -> np.ndarray:
    known = half_vectors[np.isfinite(half_vectors).all(axis=-1)]
    result = np.full(directions.shape[:-1], np.inf)
    valid = np.isfinite(directions).all(axis=-1)
    if len(known) and valid.any():
        chord, _ = cKDTree(known).query(directions[valid])
        result[valid] = np.degrees(2.0 * np.arcsin(np.clip(chord / 2.0, 0.0, 1.0)))
    return result


def _density(directions: np.ndarray, accepted: np.ndarray, bandwidth: float) -> np.ndarray:
    """Counts on the map over square degrees, smoothed; the cap's rim loses nothing to the outside."""
    size = len(directions)
    radius = 2.0 * np.sin(np.radians(CAP) / 2.0)
    flat = accepted[:, :2] / np.sqrt(np.maximum((1.0 + accepted[:, 2:]) / 2.0, 1e-9))
    column = np.floor((flat[:, 0] / radius + 1.0) / 2.0 * size).astype(int)
    row = np.floor((1.0 - flat[:, 1] / radius) / 2.0 * size).astype(int)
    known = (row >= 0) & (row < size) & (column >= 0) & (column < size)
    counts = np.zeros((size, size))
    np.add.at(counts, (row[known], column[known]), 1.0)
    inside = np.isfinite(directions[..., 0])
    pixel = np.degrees(2.0 * radius / size)
    sigma = bandwidth / pixel
    share = cv2.GaussianBlur(inside.astype(np.float64), (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    smooth = cv2.GaussianBlur(counts * inside, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    return np.where(inside, smooth / np.maximum(share, 1e-9) / pixel**2, np.nan).astype(np.float32)


def _gaps(directions: np.ndarray, empty: np.ndarray, least: float) -> tuple[Gap, ...]:
    """Sectors of the lamp's hemisphere that are mostly without light, neighbours of one side joined, largest first."""
    inside = np.isfinite(directions[..., 0])
    angle = 2.0 * np.degrees(np.arccos(np.clip(np.where(inside, directions[..., 2], 1.0), -1.0, 1.0)))
    around = np.degrees(np.arctan2(directions[..., 1], directions[..., 0]))
    sector = np.where(inside, np.round(np.nan_to_num(around) / 45.0), 0.0).astype(int) % len(SIDES)
    gaps = []
    centre = inside & (angle < 20.0)
    if (empty & centre).sum() > 0.5 * centre.sum():
        gaps.append(Gap("centre", 0.0, 20.0, float((empty & centre).sum() / inside.sum())))
    for number, side in enumerate(SIDES):
        dark = []
        for nearest, farthest in BANDS:
            part = inside & (sector == number) & (angle >= nearest) & (angle < farthest)
            dark.append((empty & part).sum() > 0.5 * part.sum())
        runs, count = label(np.array(dark))
        for run in range(1, count + 1):
            bands = [band for band, of in zip(BANDS, runs, strict=True) if of == run]
            nearest, farthest = bands[0][0], bands[-1][1]
            part = inside & (sector == number) & (angle >= nearest) & (angle < farthest) & empty
            gaps.append(Gap(side, nearest, farthest, float(part.sum() / inside.sum())))
    return tuple(sorted((gap for gap in gaps if gap.share >= least), key=lambda gap: -gap.share))


def draw_coverage(result: Coverage, half_vectors: np.ndarray, *, size: int = 640) -> np.ndarray:
    """Picture (size, size, 3) uint8 RGB: the lamp's hemisphere seen from the camera, frames as dots, gaps hatched red.

    The radius is the equal-area distance of the half vector; rings name the lamp's angle from the camera axis.
    """
    picture = np.full((size, size, 3), 255, np.uint8)
    half = int(size * 0.40)
    middle = (size // 2, size // 2)
    density = cv2.resize(np.nan_to_num(result.density), (2 * half, 2 * half), interpolation=cv2.INTER_LINEAR)
    inside = np.isfinite(cap_directions(2 * half)[..., 0])
    top = np.percentile(density[inside], 98.0) if inside.any() and density.max() > 0 else 1.0
    shade = cv2.applyColorMap((np.clip(density / top, 0, 1) ** 0.5 * 255).astype(np.uint8), cv2.COLORMAP_VIRIDIS)[
        ..., ::-1
    ]
    left, upper = middle[0] - half, middle[1] - half
    area = picture[upper : upper + 2 * half, left : left + 2 * half]
    area[inside] = shade[inside]
    distance = _nearest(cap_directions(2 * half), half_vectors)
    rows, columns = np.mgrid[: 2 * half, : 2 * half]
    area[inside & (distance > 6.0) & ((rows + columns) % 10 < 3)] = (225, 60, 50)
    radius = 2.0 * np.sin(np.radians(CAP) / 2.0)
    for lamp in (30, 60, 90):
        ring = int(half * 2.0 * np.sin(np.radians(lamp) / 4.0) / radius)
        cv2.circle(picture, middle, ring, (255, 255, 255) if lamp < 90 else (60, 60, 60), 1, cv2.LINE_AA)
        place = (middle[0] + int(0.72 * ring) + 3, middle[1] + int(0.72 * ring) + (12 if lamp == 90 else 0))
        _write(picture, f"{lamp}", place, (60, 60, 60) if lamp == 90 else (255, 255, 255), size)
    known = half_vectors[np.isfinite(half_vectors).all(axis=-1)]
    flat = known[:, :2] / np.sqrt(np.maximum((1.0 + known[:, 2:]) / 2.0, 1e-9)) / radius * half
    for x, y in flat[:: max(1, len(flat) // 3000)]:
        cv2.circle(picture, (int(middle[0] + x), int(middle[1] - y)), 1, (255, 255, 255), -1, cv2.LINE_AA)
    for text, x, y in (("top", 0, -1), ("bottom", 0, 1), ("left", -1, 0), ("right", 1, 0)):
        _write(
            picture,
            text,
            (middle[0] + int(x * half * 1.11), middle[1] + int(y * half * 1.06)),
            (60, 60, 60),
            size,
            True,
        )
    shares = ", ".join(f"{share:.0%} within {limit:g} degrees" for limit, share in result.within.items())
    _write(picture, f"{result.frames} lights; of the observable normals {shares}", (12, 22), (20, 20, 20), size)
    words = "rings: lamp's angle from the camera axis, degrees; red: no light here"
    _write(picture, words, (12, size - 12), (20, 20, 20), size)
    return picture


def _write(
    picture: np.ndarray,
    text: str,
    place: tuple[int, int],
    colour: tuple[int, int, int],
    size: int,
    centred: bool = False,
) -> None:
    scale = size / 1400.0
    if centred:
        width, height = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)[0]
        place = (place[0] - width // 2, place[1] + height // 2)
    cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, scale, colour, 1, cv2.LINE_AA)
