"""Openings of surfaces of revolution: whether the end that faces the camera is open, how thick the wall is at its lip.

Through an opening the far wall's inner side is seen, and shows highlights. Between it and the near wall lies the lip,
whose normals are those of a flat end. Where near wall, lip and far wall meet shows the tilt too.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.vectors import nearest_angles, pixel_positions
from glint.tasks.algorithms.revolution.surface_of_revolution import RayHits, SurfaceOfRevolution

AGREES_DEG, OPEN_END_SHARE = 8.0, 0.3
"""An end may be an opening if this share of its pixels has a candidate within this angle of the far wall: 0.33 to 0.95
on 27 open vessels, up to 0.22 on 12 closed ones."""
MIN_OPENING_SHARE = 0.005
"""Share of the object's pixels through which the far wall must be visible."""
MIN_OBSERVED_NZ = float(np.cos(np.radians(40.0)))
"""n_z from which a normal is well within the data capture range of 45 degrees."""
MAX_LIP, LIP_STEP = 0.3, 0.005
"""Largest thickness of a lip, and the step at which it is looked for, in radii of the end."""
LEAST_SHARE_RATIO, MAX_LEAST_SHARE = 0.75, 0.5
"""Share of the pixels that agree below which they do not show a wall: relative to that of the whole wall, and at
most."""
WALL_SECTORS, SECTOR_PRIOR = 12, 10.0
"""Sectors of the far wall, of each of which the lights reach another share, and pixels at which the share that agrees
in one counts as much as that in all."""
SHARE_ROUNDS = 3
"""Rounds in which the lip and the share of the far wall's pixels that agree with it follow from one another."""
CUTS = tuple(np.arange(0.0, 0.61, 0.05))
"""Lengths that are cut off to look for the opening below, in radii of the vessel: a mask that is a little too large or
too small at the lip closes the vessel with a dome."""
CUT_OPEN_SHARE, MIN_CUT_GAIN = 0.5, 1.1
"""Share of the far wall that agrees from which the vessel ends there, and how much more candidates must agree than
without a cut, and with a closed vessel."""
FOOTPRINT_PX = 0.5
"""Distance from the lip beyond which a pixel shows a wall alone."""
TILTS_DEG = (-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
"""Changes of the tilt that are tried: accepted normals show it to a degree."""
PEAK_REACH = 2
"""Tilts to each side of the best through whose scores a parabola is laid."""
AROUND_PX = 4
"""Distance from the end up to which pixels show where it is."""


@dataclass(frozen=True, slots=True)
class Opening:
    """An end that faces the camera and is open.

    surface: the outer wall, its tilt such that the end agrees best with the candidates. lip: thickness of the wall
    there, pixels. around: (H, W) bool, the pixels of the end and those beside it.
    """

    surface: SurfaceOfRevolution
    lip: float
    around: np.ndarray

    def entries(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what is seen at x, y (N,), camera frame: of near wall, lip, and the far wall's inner side.

        Returns:
            Unit normals (N, 3), z (N,) in pixels (see `RayHits`), both NaN where rays miss the
            surface, and whether it is the far wall, (N,) bool.
        """
        hits = self.surface.intersect(x, y)
        normals, depths = self.surface.normals_at(hits), hits.depths.copy()
        is_far = self.surface.is_end_at(hits)
        inside_edge = self.surface.end_radius - hits.apothems[is_far]
        is_far[is_far] = inside_edge >= self.lip
        inner = self.surface.shrunk(self.lip)
        hits = inner.intersect(x[is_far], y[is_far], far=True)
        inward, inner_depths = -inner.normals_at(hits), hits.depths
        visible = inward[:, 2] > 0.0
        is_far[is_far] = visible
        normals[is_far], depths[is_far] = inward[visible], inner_depths[visible]
        return normals, depths, is_far


def find_opening(
    surface: SurfaceOfRevolution,
    mask: np.ndarray,
    candidates: np.ndarray,
    turns_deg: tuple[float, ...] = TILTS_DEG,
    cuts: tuple[float, ...] = CUTS,
) -> Opening | None:
    """Return the opening of the end that faces the camera, None if that is closed.

    The tilt is changed for the end alone: a foot far from it holds the tilt that fits the whole silhouette.

    Args:
        surface: fitted inside the silhouette.
        mask: (H, W) bool, the silhouette.
        candidates: (K, H, W, 3), NaN where there is none.
        turns_deg: changes of the tilt that are tried.
        cuts: lengths that are cut off, 0 first, in radii of the vessel.
    """
    length = _end_cut_off(surface, mask, candidates, cuts)
    if length is None:
        return None
    ended, (x, y) = surface.cut_off(length), pixel_positions(mask)
    around = _around(mask, surface.is_end(x, y) | ended.is_end(x, y))
    x, y = pixel_positions(around)
    observed, least = candidates[:, around], MIN_OPENING_SHARE * float(mask.sum())
    surfaces = [
        surface.tilted(mask, surface.tilt + np.radians(turn)).cut_off(length) if turn else ended for turn in turns_deg
    ]
    fits = [_fit(tilted, tilted.intersect(x, y), x, y, observed, least) for tilted in surfaces]
    scores = np.array([np.nan if fit is None else fit.score for fit in fits])
    fit = fits[best := _peak(scores)] if np.isfinite(scores).any() else None
    return None if fit is None else Opening(surfaces[best], fit.lip, around)


def _end_cut_off(
    surface: SurfaceOfRevolution, mask: np.ndarray, candidates: np.ndarray, cuts: tuple[float, ...]
) -> float | None:
    """Return the length in pixels beyond the lip of an open vessel; None if it is closed; see `find_opening`."""
    if not surface.facing:
        return None
    x, y = pixel_positions(mask)
    lengths = np.array(cuts) * float(np.sqrt(surface.squared_radii.max()))
    ended = [surface.cut_off(float(length)) for length in lengths]
    hits = surface.intersect(x, y)
    # A ray that meets the end of what remains enters the whole body beyond it.
    beyond = surface.facing * (hits.heights - surface.end_height) > -lengths.max()
    around = _around(mask, beyond | surface.is_end_at(hits))
    x, y = pixel_positions(around)
    observed, least = candidates[:, around], MIN_OPENING_SHARE * float(mask.sum())
    fits, missed = [], []
    for end in ended:
        hits = end.intersect(x, y)
        fits.append(_fit(end, hits, x, y, observed, least))
        # Pixels of the mask that a shorter vessel does not cover contradict it.
        missed.append(np.count_nonzero(np.isnan(hits.heights)))
    sign = agreement(surface.normals(x, y), observed)
    scores = np.array(
        [-np.inf if fit is None else fit.score - count + missed[0] for fit, count in zip(fits, missed, strict=True)]
    )
    closed, uncut = float(_worth(sign, agreeing_share(sign)).sum()), float(scores[0])
    scores[[fit is None or fit.share < CUT_OPEN_SHARE for fit in fits]] = -np.inf
    best = int(np.argmax(scores))
    if scores[best] > MIN_CUT_GAIN * max(closed, uncut, 0.0):
        return float(lengths[best])
    return 0.0 if uncut > closed else None


def _around(mask: np.ndarray, is_end: np.ndarray) -> np.ndarray:
    """Return the pixels (H, W) bool of a mask, of N pixels, that belong to an end (N,) bool, and those beside it."""
    around = np.zeros(mask.shape, bool)
    around[mask] = is_end
    return np.asarray(mask & ndimage.binary_dilation(around, iterations=AROUND_PX))


def agreement(normals: np.ndarray, candidates: np.ndarray) -> np.ndarray:
    """Return 1 where a candidate (K, N, 3) agrees with the normal (N, 3), -1 where none does, 0 if none is expected.

    A normal that is NaN, or too steep to be observed, expects none.
    """
    error = nearest_angles(candidates, normals)
    return np.where(normals[:, 2] > MIN_OBSERVED_NZ, np.where(error < AGREES_DEG, 1.0, -1.0), 0.0)


@dataclass(frozen=True, slots=True)
class _Fit:
    """Thickness of a lip, how many pixels agree with the wall that is seen there, less those that do not, and the share
    of the far wall's that do."""

    lip: float
    score: float
    share: float


def _peak(scores: np.ndarray) -> int:
    """Return the number of the score (N,) nearest to the vertex of a parabola through the best one and those beside it.

    NaN are left out.
    """
    best = int(np.nanargmax(scores))
    near = np.arange(max(best - PEAK_REACH, 0), min(best + PEAK_REACH + 1, len(scores)))
    near = near[np.isfinite(scores[near])]
    if len(near) < 3:
        return best
    curvature, slope, _ = np.polyfit(near, scores[near], 2)
    if curvature >= 0.0:
        return best
    vertex = np.clip(-slope / (2.0 * curvature), near[0], near[-1])
    return int(near[np.argmin(np.abs(near - vertex))])


def _fit(
    surface: SurfaceOfRevolution, hits: RayHits, x: np.ndarray, y: np.ndarray, candidates: np.ndarray, least: float
) -> _Fit | None:
    """Fit the lip to candidates (K, N, 3) of pixels (N,) around the end; None if the end is closed.

    hits: where the rays of x, y (N,), camera frame, enter the surface. least: number of pixels that must show the far
    wall.
    """
    is_end = surface.is_end_at(hits)
    sign = agreement(surface.normals_at(hits)[~is_end], candidates[:, ~is_end])
    # Pixels of the near wall that show the lip too agree with neither.
    edge = FOOTPRINT_PX * surface.axis.direction * surface.facing
    sign = sign[~surface.is_end(x[~is_end] + edge[0], y[~is_end] + edge[1])]
    beside = float(_worth(sign, agreeing_share(sign)).sum())
    x, y = x[is_end], y[is_end]
    sign = agreement(surface.normals(x, y, far=True), candidates[:, is_end])
    if not np.count_nonzero(sign) > least:
        return None
    # A pixel on the inner edge shows the lip too, and the plane of the end is foreshortened along the view.
    across, distance = hits.across[is_end], hits.apothems[is_end]
    along = np.abs(hits.forward[is_end]) / np.sin(abs(surface.end_tilt))
    depth = surface.end_radius - distance - FOOTPRINT_PX * np.hypot(across, along) / np.maximum(distance, 1e-9)
    order = np.argsort(-depth)
    thickness = np.arange(0.0, MAX_LIP, LIP_STEP) * surface.end_radius
    count = np.searchsorted(-depth[order], -thickness, side="right")
    sign = sign[order]
    # Behind the opening a ray goes on to the far wall without moving to the side.
    azimuth = np.arcsin(np.clip(across[order] / surface.end_radius, -1.0, 1.0))
    sector = np.minimum(((azimuth / np.pi + 0.5) * WALL_SECTORS).astype(int), WALL_SECTORS - 1)
    inside = sign
    for _ in range(SHARE_ROUNDS):
        worth = _worth(sign, _sector_shares(inside, sector[: len(inside)])[sector])
        total = np.concatenate([[0.0], np.cumsum(worth)])[count]
        best = int(np.argmax(total))
        inside = sign[: count[best]]
    share = agreeing_share(inside)
    if share <= OPEN_END_SHARE:
        return None
    return _Fit(float(thickness[best]), beside + float(total[best]), share)


def agreeing_share(sign: np.ndarray) -> float:
    """Return which share of the pixels that expect a candidate has one that agrees; sign: see `agreement`."""
    return int((sign > 0.0).sum()) / max(int((sign != 0.0).sum()), 1)


def _sector_shares(sign: np.ndarray, sector: np.ndarray) -> np.ndarray:
    """Return the agreeing share (WALL_SECTORS,) of pixels in each sector; in those of few pixels, near that of all."""
    agreeing = np.bincount(sector[sign > 0.0], minlength=WALL_SECTORS)
    expected = np.bincount(sector[sign != 0.0], minlength=WALL_SECTORS)
    return np.asarray((agreeing + SECTOR_PRIOR * agreeing_share(sign)) / (expected + SECTOR_PRIOR))


def _worth(sign: np.ndarray, share: float | np.ndarray) -> np.ndarray:
    """Return what pixels (N,) say for a wall of which a share, or shares (N,), agree; others say less where few do."""
    least_share = np.minimum(LEAST_SHARE_RATIO * np.asarray(share), MAX_LEAST_SHARE)
    return np.asarray(np.where(sign < 0.0, least_share / (1.0 - least_share), 1.0) * sign)
