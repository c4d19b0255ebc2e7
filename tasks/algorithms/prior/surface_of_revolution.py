"""Bodies of revolution: the largest one inside a silhouette, what rays see of it, and its profile told by normals.

Each circle is as wide as its ellipse fits the outline.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.vectors import to_camera, unit
from glint.tasks.algorithms.prior.reflection_axes import Axis

DEPTHS = 160
"""Steps along a ray in which the body is looked for, before the place is refined."""
BLOCK = 4096
"""Rays that are followed at once."""
STEEPEST_WALL = 60.0
"""Degrees of a normal from the circle's plane up to which it belongs to a wall, not to a flat end."""
FARTHEST = 30.0
"""Degrees from the outline's slope beyond which a normal is not that of the wall."""
SMOOTHED = 1.0
"""Standard deviation in pixels along the axis over which normals are averaged."""
OUTLINE_WEIGHT = 5.0
"""Normals at a height that count as much as its outline."""


@dataclass(frozen=True, slots=True)
class Entries:
    """Where rays along -z meet a turned body: height (N,) along the axis and the way there from the axis, outward
    (N, 3), as long as the radius, in pixels; NaN beside the body."""

    heights: np.ndarray
    outward: np.ndarray


@dataclass(frozen=True, slots=True)
class Turned:
    """A turned body: its axis in the image, the tilt of its upper end towards the camera (radians), and its profile:
    squared radii (N,) and half their slopes (N,) at heights (N,) along the axis, all in pixels."""

    axis: Axis
    tilt: float
    heights: np.ndarray
    squares: np.ndarray
    slopes: np.ndarray

    @property
    def upward(self) -> np.ndarray:
        """Direction (3,) of the axis in the camera frame."""
        return np.append(self.axis.along * np.cos(self.tilt), np.sin(self.tilt))

    def normals(self, x: np.ndarray, y: np.ndarray, far: bool = False) -> np.ndarray:
        """Normals (N, 3) where rays along -z at x, y (N,) enter the body, NaN beside it.

        far: instead those of the wall's inside where the rays would leave it.
        """
        entries = self.entries(x, y, far)
        axial = -np.interp(entries.heights, self.heights, self.slopes)
        normals = entries.outward + np.outer(axial, self.upward)
        return np.asarray(unit(normals) * (-1.0 if far else 1.0))

    def entries(self, x: np.ndarray, y: np.ndarray, far: bool = False) -> Entries:
        """Where rays along -z at x, y (N,) enter the body; far: where they leave it."""
        blocks = [slice(start, start + BLOCK) for start in range(0, len(x), BLOCK)]
        depths = np.concatenate([self._depths(x[block], y[block], far) for block in blocks] or [np.zeros(0)])
        side, up = self._place(x, y)
        c, s = np.cos(self.tilt), np.sin(self.tilt)
        towards = depths * c - up * s
        flat = np.outer(side, self.axis.across) - np.outer(towards * s, self.axis.along)
        outward = np.column_stack([flat, towards * c])
        return Entries(depths * s + up * c, outward)

    def _place(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Across and along the axis in the image."""
        place = np.stack([x, y], axis=-1) - self.axis.point
        return place @ self.axis.across, place @ self.axis.along

    def _depths(self, x: np.ndarray, y: np.ndarray, far: bool) -> np.ndarray:
        side, up = self._place(x, y)
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
        return np.where(inside.any(axis=1), within, np.nan)

    def fitted_to(self, x: np.ndarray, y: np.ndarray, seen: np.ndarray, weights: np.ndarray) -> "Turned":
        """The body with its profile's slope turned to normals (N, 3) that were seen at x, y (N,), with weights (N,).

        The outline tells radii to a part of a pixel, but slopes to some degrees only. A normal errs by a degree, and
        what it says holds for its whole circle. Each height turns by the weighted mean of what it saw, smoothed, and
        then of what that left (Tukey's twicing); flat ends stay.
        """
        entries = self.entries(x, y)
        radii = np.sqrt(self.squares)
        step = self.heights[1] - self.heights[0]
        angle = np.arctan2(-self.slopes, radii)
        wall = np.abs(angle) < np.radians(STEEPEST_WALL)
        reach = np.linalg.norm(entries.outward, axis=1)
        shown = np.arctan2(reach * (seen @ self.upward), (seen * entries.outward).sum(axis=1))
        for _ in range(2):
            off = shown - np.interp(entries.heights, self.heights, angle)
            told = np.isfinite(off) & (np.abs(off) < np.radians(FARTHEST))
            place = np.rint((entries.heights[told] - self.heights[0]) / step).astype(int).clip(0, len(angle) - 1)
            total, sums = (
                ndimage.gaussian_filter1d(
                    np.bincount(place, each, minlength=len(angle)).astype(float), SMOOTHED / step, mode="constant"
                )
                for each in (weights[told], weights[told] * off[told])
            )
            angle = angle + np.where(wall, sums / (total + OUTLINE_WEIGHT), 0.0)
        slopes = np.where(wall, -radii * np.tan(angle.clip(-1.4, 1.4)), self.slopes)
        return replace(self, slopes=slopes)


def turned_body(mask: np.ndarray, axis: Axis, tilt: float, step: float = 0.5) -> Turned:
    """The largest body turned about an axis of that tilt (radians) inside a silhouette (H, W) bool."""
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = ndimage.gaussian_filter1d(max(contours, key=len)[:, 0].astype(float), 1.5, axis=0, mode="wrap")
    place = np.stack(to_camera(outline[:, 0], outline[:, 1], mask.shape[1], mask.shape[0]), axis=-1) - axis.point
    side, up = place @ axis.across, place @ axis.along
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
