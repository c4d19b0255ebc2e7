"""Turned objects: most glasses, bottles and domes are surfaces of revolution, and their outline shows it.

A mirror axis of the silhouette may be the image of an axis of revolution. For a tilt of that axis towards the camera,
the largest turned body inside the silhouette follows from it: each circle is as wide as its ellipse fits the outline.
Accepted highlights tell the tilt, and whether the object is turned at all. The body then knows what no highlight shows
and no smooth field guesses: feet, shoulders, flat ends, and the far wall seen through an opening.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy import ndimage

from tasks.algorithms.geometry import angles, to_camera

LEAST_OVERLAP = 0.96
"""Intersection over union of a silhouette with its mirror image from which it counts as symmetric."""
STEEPEST = 75
"""Degrees of tilt that are tried: circles are ellipses up to there."""
FITTING = 5.0
"""Mean angle in degrees (each capped at FAR) between accepted normals and those of a turned object's body."""
FAR = 20.0
SAMPLES = 600
"""Accepted normals that are compared for each tilt."""
TILT = 3.75
"""Degrees either side of each tilt that is tried first; the best is refined from there."""
ROUGHLY = 2.0, 4
"""Step in pixels along the axis, and every which sample, for that first look."""
LIKELY = 1.3
"""Times the least error of that look up to which an axis is followed up."""
DEPTHS = 300
"""Steps along a ray in which the body is looked for, before the place is refined."""
BLOCK = 4096
"""Rays that are followed at once."""
OPEN_WITHIN, OPEN_SHARE = 8.0, 0.5
"""An end is an opening where so large a share of its pixels has a candidate within so many degrees of the far wall."""
LEAST_OPENING = 0.005
"""Share of the object's pixels through which the far wall must be seen."""
EXCELS = 0.4
"""Share of the smooth field's mean angle to the accepted normals below which a turned body's must be."""
OBSERVABLE = float(np.cos(np.radians(40.0)))


@dataclass(frozen=True, slots=True, eq=False)
class Axis:
    """A mirror axis of a silhouette: a point (2,) of it in the camera frame, the direction (2,) across it, the overlap
    of the silhouette and its mirror image."""

    point: np.ndarray
    across: np.ndarray
    overlap: float


@dataclass(frozen=True, slots=True)
class Turned:
    """A turned body: its axis in the image, the tilt of its upper end towards the camera (radians), and its profile:
    squared radii (N,) and half their slopes (N,) at heights (N,) along the axis, all in pixels."""

    axis: Axis
    tilt: float
    heights: np.ndarray
    squares: np.ndarray
    slopes: np.ndarray

    def normals(self, x: np.ndarray, y: np.ndarray, far: bool = False) -> np.ndarray:
        """Normals (N, 3) where rays along -z at x, y (N,) enter the body, NaN beside it.

        far: instead those of the wall's inside where the rays would leave it.
        """
        blocks = [slice(start, start + BLOCK) for start in range(0, len(x), BLOCK)]
        return np.concatenate([self._normals(x[block], y[block], far) for block in blocks] or [np.zeros((0, 3))])

    def _normals(self, x: np.ndarray, y: np.ndarray, far: bool) -> np.ndarray:
        along = np.array([-self.axis.across[1], self.axis.across[0]])
        place = np.stack([x, y], axis=-1) - self.axis.point
        side, up = place @ self.axis.across, place @ along
        c, s = np.cos(self.tilt), np.sin(self.tilt)
        reach = float(np.sqrt(self.squares.max()) * c + np.abs(self.heights).max() * abs(s)) + 1.0

        def room(depth: np.ndarray, across: np.ndarray, upward: np.ndarray) -> np.ndarray:
            """Squared radius less squared distance from the axis: positive inside."""
            square = np.interp(depth * s + upward * c, self.heights, self.squares, left=0.0, right=0.0)
            return np.asarray(square - across**2 - (depth * c - upward * s) ** 2)

        depths = np.linspace(reach, -reach, DEPTHS) * (-1.0 if far else 1.0)
        inside = room(depths[None], side[:, None], up[:, None]) > 0
        first = inside.argmax(axis=1)
        within, beyond = depths[first], depths[np.maximum(first - 1, 0)]
        for _ in range(12):
            middle = (within + beyond) / 2
            enters = room(middle, side, up) > 0
            within, beyond = np.where(enters, middle, within), np.where(enters, beyond, middle)
        axial = -np.interp(within * s + up * c, self.heights, self.slopes)
        towards = within * c - up * s
        flat = np.outer(side, self.axis.across) + np.outer(axial * c - towards * s, along)
        normals = np.column_stack([flat, axial * s + towards * c]) * (-1.0 if far else 1.0)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
        return np.where(inside.any(axis=1)[:, None], normals, np.nan)


def mirror_axes(mask: np.ndarray, least: float = LEAST_OVERLAP, most: int = 4) -> list[Axis]:
    """Mirror axes of a silhouette (H, W) bool, the best first; none where it is not symmetric."""
    height, width = mask.shape
    rows, columns = np.nonzero(mask)
    points = np.stack(to_camera(columns.astype(float), rows.astype(float), width, height), axis=-1)
    centre = points.mean(axis=0)
    points = points[:: max(1, len(points) // 4000)]

    def overlap(angle: float, offset: float) -> float:
        across = np.array([np.cos(angle), np.sin(angle)])
        mirrored = points - 2.0 * np.outer((points - centre) @ across - offset, across)
        column = np.rint(mirrored[:, 0] + (width - 1) / 2).astype(int)
        row = np.rint((height - 1) / 2 - mirrored[:, 1]).astype(int)
        there = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        share = float((there & mask[row.clip(0, height - 1), column.clip(0, width - 1)]).mean())
        return share / (2.0 - share)

    tried = np.radians(np.arange(0.0, 180.0, 3.0))
    coarse = np.array([overlap(angle, 0.0) for angle in tried])
    peaks = (coarse >= np.roll(coarse, 1)) & (coarse >= np.roll(coarse, -1)) & (coarse >= least - 0.06)
    found = []
    for start in tried[peaks]:
        best, angle, offset = overlap(start, 0.0), float(start), 0.0
        turn, shift = np.radians(1.5), 1.0
        while turn > np.radians(0.1):
            near = [(angle + i * turn, offset + j * shift) for i in (-1, 0, 1) for j in (-1, 0, 1)]
            values = [overlap(*each) for each in near]
            if max(values) > best + 1e-6:
                best = max(values)
                angle, offset = near[values.index(best)]
            else:
                turn, shift = turn / 2, shift / 2
        across = np.array([np.cos(angle), np.sin(angle)])
        found.append(Axis(centre + offset * across, across, best))
    return sorted((each for each in found if each.overlap >= least), key=lambda each: -each.overlap)[:most]


def turned_body(mask: np.ndarray, axis: Axis, tilt: float, step: float = 0.5) -> Turned:
    """The largest body turned about an axis of that tilt (radians) inside a silhouette (H, W) bool."""
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = ndimage.gaussian_filter1d(max(contours, key=len)[:, 0].astype(float), 1.5, axis=0, mode="wrap")
    place = np.stack(to_camera(outline[:, 0], outline[:, 1], mask.shape[1], mask.shape[0]), axis=-1) - axis.point
    side, up = place @ axis.across, place @ np.array([-axis.across[1], axis.across[0]])
    foreshortened, flattened = np.cos(tilt), max(abs(np.sin(tilt)), 0.02)
    heights = np.arange(up.min() / foreshortened, up.max() / foreshortened + step, step)
    # The outline runs through the centres of the outermost pixels, half a pixel inside the edge.
    apart = np.subtract.outer(heights * (foreshortened / flattened), up / flattened)
    np.multiply(apart, apart, out=apart)
    squares = (np.sqrt(np.add(apart, side**2, out=apart).min(axis=1)) + 0.5) ** 2
    smooth, slopes = _profile(squares, heights)
    smooth, slopes = _ended(np.sqrt(squares), smooth, slopes, heights, tilt)
    return Turned(axis, tilt, heights, smooth, slopes / 2.0)


def _ended(
    widest: np.ndarray, squares: np.ndarray, slopes: np.ndarray, heights: np.ndarray, tilt: float
) -> tuple[np.ndarray, np.ndarray]:
    """Take away what the outline cannot rule out: cones that the camera sees edge-on above feet, flat ends and domes.

    widest (N,): radii before they were smoothed. Behind a corner of the profile the surface is taken to be flat, behind
    a smooth shoulder to go on as on a ball.
    """
    if tilt < 0:
        kept, grade = _ended(widest[::-1], squares[::-1], -slopes[::-1], -heights[::-1], -tilt)
        return kept[::-1], -grade[::-1]
    step = heights[1] - heights[0]
    edge_on = -1.0 / max(np.tan(tilt), 0.02)
    reach = max(1, round(1.0 / step))
    fall = (np.append(widest[reach:], np.zeros(reach)) - np.append(np.zeros(reach), widest[:-reach])) / (
        2 * reach * step
    )
    cone = ndimage.binary_closing((fall < 0.7 * edge_on) & (widest > 2.0), iterations=reach)
    runs, count = ndimage.label(cone)
    before = max(2, round(0.03 * widest.max() / step))
    kept = squares.copy()
    for run in ndimage.find_objects(runs)[:count]:
        below, above = run[0].start, run[0].stop
        # The corner between a foot and its stem is rounded by the outline: the stem is what comes a little above.
        rest = kept[above : above + round(6.0 / step)].min() if above * step < len(kept) * step - 4.0 else 0.0
        shoulder = max(below - before, 0)
        if slopes[shoulder] / (2.0 * max(widest[shoulder], 1.0)) > 0.4 * edge_on:
            kept[below:above] = rest
        else:
            distance = heights[below:above] - heights[shoulder]
            kept[below:above] = np.maximum(kept[shoulder] + slopes[shoulder] * distance - distance**2, rest)
        if rest == 0.0:
            kept[above:] = 0.0
            break
    kept[-1] = 0.0
    changed = ndimage.binary_dilation(kept != squares, iterations=1)
    return kept, np.where(changed, np.gradient(kept, heights), slopes)


def _profile(squares: np.ndarray, heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squared radii (N,) and slopes (N,) without the staircase of the pixels, their corners kept.

    Straight lines are fitted to windows about and beside each height: the widest that fits is taken.
    """
    radius = np.sqrt(squares)
    step = heights[1] - heights[0]
    best = np.full(len(squares), np.inf)
    value, slope = squares.copy(), np.gradient(squares, heights)
    for pixels, limit in ((24.0, 0.35), (12.0, 0.35), (6.0, 0.35), (3.0, 0.5)):
        reach = max(2, round(pixels / step))
        line = _lines(squares, reach, step)
        for shift in (0, reach, -reach):
            at, grade, residual = (np.roll(each, shift) for each in line)
            at = at + grade * shift * step
            error = residual / (2.0 * radius + 2.0) / limit * (1.0 if shift == 0 else 1.3)
            error[_rolled_in(len(error), shift)] = np.inf
            better = (error < best) & ~(best <= 1.0)
            best, value, slope = (
                np.where(better, new, old) for new, old in ((error, best), (at, value), (grade, slope))
            )
    return np.maximum(value, 0.0), slope


def _rolled_in(length: int, shift: int) -> slice:
    """Where `np.roll` puts what came over the other end."""
    return slice(0, shift) if shift >= 0 else slice(length + shift, length)


def _lines(values: np.ndarray, reach: int, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Value, slope and RMS residual of the line fitted to the window of `reach` samples either side; each (N,)."""
    place = np.arange(-reach, reach + 1) * step
    mean = ndimage.uniform_filter1d(values, 2 * reach + 1, mode="nearest")
    slope = ndimage.correlate1d(values, place / (place**2).sum(), mode="nearest")
    square = ndimage.uniform_filter1d((values - values.mean()) ** 2, 2 * reach + 1, mode="nearest")
    variance = square - (mean - values.mean()) ** 2 - slope**2 * (place**2).mean()
    return mean, slope, np.sqrt(np.maximum(variance, 0.0))


def turned_normals(
    mask: np.ndarray, accepted: np.ndarray, candidates: np.ndarray, field: np.ndarray | None = None
) -> np.ndarray | None:
    """The normals (H, W, 3) float32 of the turned object that a silhouette shows, NaN outside; None where it is none.

    mask (H, W) bool; accepted (H, W, 3) normals of accepted highlights, NaN elsewhere; candidates (K, H, W, 3), NaN
    where there is none, tell whether an end is an opening; field (H, W, 3): the silhouette's smooth field, which the
    turned object must clearly excel.
    """
    bar = FITTING
    if field is not None and np.isfinite(accepted[..., 0]).any():
        off = np.minimum(angles(field, accepted), FAR)
        bar = min(bar, EXCELS * float(off[np.isfinite(off)].mean()))
    body = _fitted(mask, accepted, bar)
    if body is None:
        return None
    rows, columns = np.nonzero(mask)
    x, y = to_camera(columns.astype(float), rows.astype(float), mask.shape[1], mask.shape[0])
    normals = body.normals(x, y)
    along = np.array([-body.axis.across[1], body.axis.across[0]])
    end = np.append(along * np.cos(body.tilt), np.sin(body.tilt)) * np.sign(body.tilt)
    cap = normals @ end > np.cos(np.radians(25.0))
    if cap.any():
        inner = body.normals(x[cap], y[cap], far=True)
        told = inner[:, 2] > OBSERVABLE
        nearest = angles(candidates[:, rows[cap], columns[cap]], inner[None])
        open_here = (np.nan_to_num(nearest, nan=180.0).min(axis=0) < OPEN_WITHIN)[told]
        if told.sum() > LEAST_OPENING * len(rows) and open_here.mean() > OPEN_SHARE:
            normals[cap] = np.where(inner[:, 2:] > 0, inner, normals[cap])
    result = np.full((*mask.shape, 3), np.nan, np.float32)
    result[rows, columns] = normals
    nearest = ndimage.distance_transform_edt(np.isnan(result[..., 0]), return_distances=False, return_indices=True)
    return np.where(mask[..., None], result[tuple(nearest)], np.nan)


def _fitted(mask: np.ndarray, accepted: np.ndarray, bar: float = FITTING) -> Turned | None:
    """The turned body that agrees best with the accepted normals, if its mean angle to them is below the bar."""
    rows, columns = np.nonzero(mask & np.isfinite(accepted[..., 0]))
    chosen = slice(None, None, max(1, len(rows) // SAMPLES))
    rows, columns = rows[chosen], columns[chosen]
    if len(rows) < 20:
        return None
    x, y = to_camera(columns.astype(float), rows.astype(float), mask.shape[1], mask.shape[0])
    seen = accepted[rows, columns]

    def misfit(axis: Axis, tilt: float, step: float = 1.0, every: int = 1) -> float:
        body = turned_body(mask, axis, tilt, step)
        off = np.nan_to_num(angles(body.normals(x[::every], y[::every]), seen[::every]), nan=FAR)
        return float(np.minimum(off, FAR).mean())

    best, found = bar, None
    tilts = np.radians(np.arange(-STEEPEST, STEEPEST + 1, 2 * TILT))
    rough = {axis: [misfit(axis, tilt, *ROUGHLY) for tilt in tilts] for axis in mirror_axes(mask)}
    for axis, errors in rough.items():
        if min(errors) > LIKELY * min(map(min, rough.values())):
            continue
        tilt, turn = float(tilts[int(np.argmin(errors))]), np.radians(TILT)
        least = misfit(axis, tilt)
        while turn > np.radians(0.1):
            near = [each for each in (tilt - turn, tilt + turn) if abs(each) <= np.radians(STEEPEST)]
            error, other = min((misfit(axis, each), each) for each in near)
            if error < least:
                least, tilt = error, other
            else:
                turn /= 2
        if least < best:
            best, found = least, turned_body(mask, axis, tilt)
    return found
