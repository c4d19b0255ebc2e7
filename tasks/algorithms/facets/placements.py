"""Placements of faceted bodies before a camera: those that a silhouette suggests, and their neighbours.

If a body has two ends and nothing between them, the corners of its contour give its placement in closed form: what they
show of the hidden end, shrunk towards the apex, completes the polygon of the visible one, and the ellipse about that is
the image of a circle. Otherwise the axis may be one of reflection symmetry, and the rest is tried.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from glint.tasks.algorithms.prisms.contour_polygon import contour_polygons
from glint.tasks.algorithms.prisms.right_prism import SweptContour, swept_contours
from glint.tasks.algorithms.revolution.view_rays import AxisFrame
from glint.tasks.algorithms.sections.rounded_polygon import RoundedPolygon
from glint.tasks.algorithms.silhouettes.reflection_axes import ReflectionAxis, reflection_axes

MAX_CONVERGENCE_DEG, MIN_WAY_RATIO = 60.0, 0.2
"""Angle between the images of two edges that lead from end to end, and ratio of their lengths."""
PARALLEL_DEG = 3.0
"""Angle between two such edges up to which they are parallel."""
MAX_APEX_RATIO = 1.4
"""Ratio of the sizes of the ends by one such edge to that by the other."""
MAX_IRREGULARITY, MAX_INCOMPLETE_IRREGULARITY = 0.12, 0.03
"""RMS distance of an end's corners from those of the image of a regular polygon, relative to its RMS radius, for whole
ends and for those of which one corner is missing."""
MIN_TILT_DEG = 4.0
"""Least angle at which an end is seen."""
MIN_TRIED_IOU = 0.91
"""Overlap of a silhouette with its mirror image from which the axis is tried: polygons are not seen symmetric."""
TRIED_TILTS = np.radians([-64, -52, -44, -36, -28, -20, -12, -5, 5, 12, 16, 20, 24, 28, 32, 36, 40, 44, 52, 64])
"""Tilts that are tried, in radians: cameras look down on most objects."""
MAX_FACET_RISE = 0.9
"""Cosine of the angle between the axis and a normal from which it belongs to an end."""
TRIED_TURNS = {3: 6, 4: 6, 5: 5, 6: 4, 8: 4, 10: 3, 12: 3}
"""Sides of the polygons that are tried, and how many of their turns."""

NEAR_ANGLE_DEG, NEAR_TILT_DEG, NEAR_PERIODS = 1.0, 10.0, 0.3
"""Differences of two placements up to which they are near."""


@dataclass(frozen=True, slots=True)
class Placement:
    """Axis and cross-section of a faceted body or a square vessel before a camera.

    angle: of the image of a direction across the axis, radians. offset: distance of the axis' image from the centre of
    the image in that direction, pixels. tilt: of the axis' upper end towards the camera, radians. polygon: the section.
    """

    angle: float
    offset: float
    tilt: float
    polygon: RoundedPolygon

    @classmethod
    def about(cls, axis: ReflectionAxis, tilt: float, polygon: RoundedPolygon) -> "Placement":
        """Return the placement about the axis with that image and tilt, radians."""
        angle, offset = np.arctan2(axis.normal[1], axis.normal[0]), axis.point @ axis.normal
        return cls(float(angle), float(offset), tilt, polygon)

    @property
    def axis(self) -> ReflectionAxis:
        """Image of the axis."""
        normal = np.array([np.cos(self.angle), np.sin(self.angle)])
        return ReflectionAxis(self.offset * normal, normal, 1.0)

    def frame(self, inverse_focal: float, middle: np.ndarray, stride: int) -> AxisFrame:
        """Return the frame of the axis in the image of every `stride`-th pixel, centred at `middle` (2,) of this one.

        inverse_focal: 1 over the focal length in pixels of that image.
        """
        normal = self.axis.normal
        offset = float(self.axis.point @ normal - middle @ normal) / stride
        return AxisFrame.of(ReflectionAxis(offset * normal, normal, 1.0), self.tilt, inverse_focal)

    def beside(self, turn: float, shift: float, tilt: float, share: float) -> Iterator["Placement"]:
        """Yield the neighbours to either side: by angle and tilt in radians, offset in pixels, and part of a side."""
        around = share * 2.0 * np.pi / self.polygon.sides
        for sign in (-1.0, 1.0):
            yield replace(self, angle=self.angle + sign * turn)
            yield replace(self, offset=self.offset + sign * shift)
            yield replace(self, tilt=self.tilt + sign * tilt)
            yield replace(self, polygon=replace(self.polygon, turn=self.polygon.turn + sign * around))

    def is_near(self, other: "Placement") -> bool:
        """Return whether both would lead to the same body when they are refined."""
        return (
            self.polygon.sides == other.polygon.sides
            and abs(self.angle - other.angle) < np.radians(NEAR_ANGLE_DEG)
            and abs(self.tilt - other.tilt) < np.radians(NEAR_TILT_DEG)
            and self.turn_from(other) < NEAR_PERIODS * 2.0 * np.pi / self.polygon.sides
        )

    def turn_from(self, other: "Placement") -> float:
        """Return the angle about the axis, up to whole sides and in radians, to a section of as many sides."""
        period = 2.0 * np.pi / self.polygon.sides
        return abs((self.polygon.turn - other.polygon.turn + period / 2.0) % period - period / 2.0)


def placements_of_ends(mask: np.ndarray, inverse_focal: float = 0.0) -> list[Placement]:
    """Return the placements of bodies of two ends that have the contour of a mask (H, W) bool.

    inverse_focal: 1 over the focal length in pixels of a camera aimed at the middle of the image, 0 for parallel rays.
    """
    swept = (
        contour
        for corners in contour_polygons(mask)
        for contour in swept_contours(corners, inverse_focal, MAX_CONVERGENCE_DEG, MIN_WAY_RATIO)
    )
    placements = (_placement(contour) for contour in swept)
    return [placement for placement in placements if placement is not None]


def placements_about_axis(mask: np.ndarray, faces: list[np.ndarray], inverse_focal: float = 0.0) -> list[Placement]:
    """Return the placements that are tried about the best symmetry axis of a mask (H, W) bool, if it has any.

    faces: unit normals (3,) in the camera frame of flat faces that may be facets: they give the turn of a polygon.
    inverse_focal: as of `placements_of_ends`.
    """
    result = []
    for axis in reflection_axes(mask, MIN_TRIED_IOU)[:1]:
        for tilt, (sides, turns) in product(TRIED_TILTS, TRIED_TURNS.items()):
            vectors = AxisFrame.of(axis, float(tilt), inverse_focal).vectors
            shown = [vectors @ normal for normal in faces]
            azimuths = [float(np.arctan2(across, forward)) for across, forward, up in shown if abs(up) < MAX_FACET_RISE]
            azimuths += [2.0 * np.pi * number / (turns * sides) for number in range(turns)]
            result += [Placement.about(axis, float(tilt), RoundedPolygon(sides, azimuth)) for azimuth in azimuths]
    return result


def _placement(contour: SweptContour) -> Placement | None:
    """Return the placement of a body of two regular ends with this contour, None if there is none."""
    best, best_error, best_way = None, 1.0, np.zeros(2)
    for corners, way, is_whole in _completed_ends(contour):
        edges = np.roll(corners, -1, axis=0) - corners
        if (edges[:, 0] * np.roll(edges, -1, axis=0)[:, 1] <= edges[:, 1] * np.roll(edges, -1, axis=0)[:, 0]).any():
            continue
        numbers = np.arange(len(corners))
        if is_whole:
            fits, limit = [_fitted_end(corners, numbers, len(corners))], MAX_IRREGULARITY
        else:
            fits = [_fitted_end(corners, numbers + (numbers > gap), len(corners) + 1) for gap in numbers]
            limit = MAX_INCOMPLETE_IRREGULARITY
        fit = min(fits, key=attrgetter("error"))
        if fit.error / limit < best_error:
            best, best_error, best_way = fit, fit.error / limit, way
    return None if best is None else best.placement(best_way)


class _End(NamedTuple):
    """Image of a regular polygon as an end of a body, fitted to its corners.

    corners: (N, 2). sides: their number, with missing ones. centre: (2,). radii: (2, 2), images of two perpendicular
    radii of the circle about it. error: RMS distance of the corners, relative to their RMS distance from their mean.
    """

    corners: np.ndarray
    sides: int
    centre: np.ndarray
    radii: np.ndarray
    error: float

    def placement(self, way: np.ndarray) -> Placement | None:
        """Return the placement of the body; way (2,): to this end from the other one. None if it is seen edge-on."""
        # The circle about the end is foreshortened along the image of the axis.
        _, (longest, shortest), directions = np.linalg.svd(self.radii)
        along = directions[1] * (np.sign(directions[1] @ way) or 1.0)
        across = np.array([along[1], -along[0]])
        tilt = float(np.arcsin(shortest / longest))
        if tilt < np.radians(MIN_TILT_DEG):
            return None
        from_centre = self.corners - self.centre
        azimuths = np.arctan2(from_centre @ across, -(from_centre @ along) / np.sin(tilt))
        # The mean azimuth of the corners, up to whole sides, is half a side beside that of the sides.
        phase = np.exp(1j * self.sides * azimuths).sum()
        polygon = RoundedPolygon(self.sides, float((np.angle(phase) + np.pi) / self.sides))
        return Placement(float(np.arctan2(across[1], across[0])), float(self.centre @ across), tilt, polygon)


def _fitted_end(corners: np.ndarray, numbers: np.ndarray, sides: int) -> _End:
    """Fit the image of a regular polygon to its corners (N, 2) of these numbers (N,), counter-clockwise."""
    azimuths = 2.0 * np.pi * numbers / sides
    design = np.column_stack([np.cos(azimuths), np.sin(azimuths), np.ones(len(numbers))])
    fit = np.linalg.lstsq(design, corners)[0]
    spread = float(np.linalg.norm(corners - corners.mean(axis=0)))
    return _End(corners, sides, fit[2], fit[:2], float(np.linalg.norm(corners - design @ fit)) / spread)


def _completed_ends(contour: SweptContour) -> Iterator[tuple[np.ndarray, np.ndarray, bool]]:
    """Yield the corners (N, 2) of the visible end, counter-clockwise, and the way (2,) to it from the hidden one.

    Also whether they are all: of two edges between the ends one may lead from a corner to the next, of which the
    contour then shows one at either end. Nothing if the edges contradict each other.
    """
    visible, hidden = contour.visible, contour.hidden
    starts, ends = hidden[[-1, 0]], visible[[0, -1]]
    ways = ends - starts
    lengths = np.linalg.norm(ways, axis=1)
    crossing = np.column_stack([ways[0], -ways[1]])
    if abs(np.linalg.det(crossing)) < np.sin(np.radians(PARALLEL_DEG)) * lengths.prod():
        if lengths.max() <= MAX_APEX_RATIO * lengths.min():
            yield np.vstack([visible, hidden[1:-1] + ways.mean(axis=0)]), ways.mean(axis=0), True
        return
    shares = np.linalg.solve(crossing, starts[1] - starts[0])
    if (shares < 0.0).any() != (shares < 0.0).all() or ((shares > 0.0) & (shares < 1.0)).any():
        return
    apex = starts[0] + shares[0] * ways[0]
    ratios = np.abs(1.0 - 1.0 / shares)
    sizes = [(float(ratio), False) for ratio in ratios]
    if ratios.max() <= MAX_APEX_RATIO * ratios.min():
        sizes.append((float(np.sqrt(ratios.prod())), True))
    for size, is_whole in sizes:
        corners = np.vstack([visible, apex + size * (hidden[1:-1] - apex)])
        # The apex lies beyond the smaller end.
        yield corners, (apex - corners.mean(axis=0)) * (1.0 if size < 1.0 else -1.0), is_whole
