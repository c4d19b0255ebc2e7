"""Reflection symmetry axes of a silhouette, each of which may be the image of an axis of revolution.

What stands out on one side alone, a handle or a spout, breaks the symmetry: the rest has an axis of its own, about
which its contour on one side is the mirror image of that on the other.

Source: the score of a reflection is the overlap of the silhouette with its mirror image, maximized over angle and
offset (Marola 1989).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numba import njit
from scipy import ndimage

from glint.tasks.algorithms.geometry.distance import depth_inside, distance_inside
from glint.tasks.algorithms.geometry.vectors import to_camera

MIN_SYMMETRY_IOU = 0.96
"""Intersection over union of a silhouette with its mirror image from which it counts as symmetric."""
SEED_IOU_MARGIN = 0.06
"""Distance below that score that an unrefined angle may have."""
SEED_STEP_DEG, FINAL_STEP_DEG = 3.0, 0.1
"""Steps in angle of the exhaustive search, and at which refinement ends."""
MAX_SCORED_PIXELS = 4000
"""Pixels of the silhouette that are mirrored; of a larger one, every n-th."""
MATCH_SIGMAS_PX = (6.0, 3.0, 1.0)
"""Distances of mirrored contour from contour at which a point counts 1/e of a match, in turn."""
MAX_AXIS_OFFSET = 0.5
"""Distance of a body's axis from the silhouette's centroid that is tried, in inradii."""
MIN_BODY_SHARE, MIN_MATCHED_SHARE = 0.6, 0.7
"""Shares of a silhouette that its body must cover, and of the body's contour that must lie on the silhouette's."""
MIN_COMPLETED_SHARE = 0.8
"""Share of a completed silhouette that a mask must show."""
MAX_AXES, MAX_IMAGES = 4, 3
"""Most axes of a silhouette, and most of its mirror images, the best ones."""
CONTOUR_PX = 1.5
"""Distance up to which a pixel is one of the contour."""


@dataclass(frozen=True, slots=True, eq=False)
class ReflectionAxis:
    """Reflection symmetry axis of a silhouette.

    point: (2,), on the axis, camera frame, pixels. normal: (2,), unit, perpendicular to it. iou: intersection over
    union of the silhouette and its mirror image.
    """

    point: np.ndarray
    normal: np.ndarray
    iou: float

    @property
    def direction(self) -> np.ndarray:
        """Direction (2,) of the axis."""
        return np.array([-self.normal[1], self.normal[0]])


def reflection_axes(mask: np.ndarray) -> list[ReflectionAxis]:
    """Return at most MAX_AXES axes of a silhouette (H, W) bool that is symmetric about them, best first."""
    height, width = mask.shape
    rows, columns = np.nonzero(mask)
    points = np.stack(to_camera(columns.astype(float), rows.astype(float), width, height), axis=-1)
    centre = points.mean(axis=0)
    points = points[:: max(1, len(points) // MAX_SCORED_PIXELS)]

    def iou(angle: float, offset: float) -> float:
        share = _mirrored_share(points, centre, angle, offset, mask)
        # Both silhouettes have the same area, so the union is twice it less the intersection.
        return share / (2.0 - share)

    # Local maxima over the angle, for axes through the centroid.
    seeds = np.radians(np.arange(0.0, 180.0, SEED_STEP_DEG))
    scores = np.array([iou(angle, 0.0) for angle in seeds])
    is_peak = (scores >= np.roll(scores, 1)) & (scores >= np.roll(scores, -1))
    is_peak &= scores >= MIN_SYMMETRY_IOU - SEED_IOU_MARGIN
    axes = []
    for seed in seeds[is_peak]:
        steps = (float(np.radians(SEED_STEP_DEG / 2)), 1.0)
        (angle, offset), _ = _refined(iou, (float(seed), 0.0), steps, float(np.radians(FINAL_STEP_DEG)))
        normal = np.array([np.cos(angle), np.sin(angle)])
        axes.append(ReflectionAxis(centre + offset * normal, normal, iou(angle, offset)))
    return sorted((axis for axis in axes if axis.iou >= MIN_SYMMETRY_IOU), key=lambda axis: -axis.iou)[:MAX_AXES]


def _refined(
    score: Callable[[float, float], float], place: tuple[float, float], steps: tuple[float, float], last_turn: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Search angle and offset of the best score near a place, until the step of the angle is at most `last_turn`.

    Steps are halved where no neighbour is better. Returns the place and the steps at the end.
    """
    (angle, offset), (turn, shift) = place, steps
    best = score(angle, offset)
    while turn > last_turn:
        neighbours = [(angle + i * turn, offset + j * shift) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        values = [score(*neighbour) for neighbour in neighbours]
        if max(values) > best + 1e-6:
            best = max(values)
            angle, offset = neighbours[values.index(best)]
        else:
            turn, shift = turn / 2, shift / 2
    return (angle, offset), (turn, shift)


def mirror_images(mask: np.ndarray) -> list[np.ndarray]:
    """Return at most MAX_IMAGES mirror images (H, W) bool of a silhouette (H, W) bool, best first.

    They are about axes about which much of the contour is the image of contour.
    """
    depth = depth_inside(mask)
    contour = _contour(mask)
    to_contour = distance_inside(~contour)
    centre = np.argwhere(mask).mean(axis=0)[::-1]
    points = np.argwhere(contour)[:, ::-1].astype(float)
    points = points[:: max(1, len(points) // MAX_SCORED_PIXELS)]

    def mirrored(points: np.ndarray, angle: float, offset: float) -> np.ndarray:
        normal = np.array([np.cos(angle), np.sin(angle)])
        return points - 2.0 * np.outer((points - centre) @ normal - offset, normal)

    def matched(angle: float, offset: float, sigma: float, stride: int = 1) -> float:
        return _mean_match(mirrored(points[::stride], angle, offset), to_contour, sigma)

    # The best offset for each angle, then local maxima over the angle.
    coarse = MATCH_SIGMAS_PX[0]
    reach = MAX_AXIS_OFFSET * float(depth.max())
    angles = np.radians(np.arange(0.0, 180.0, SEED_STEP_DEG))
    offsets = np.arange(-reach, reach + 1.0, coarse / 2)
    scores = np.array([[matched(angle, offset, coarse, stride=4) for offset in offsets] for angle in angles])
    best = scores.max(axis=1)
    peaks = np.flatnonzero((best >= np.roll(best, 1)) & (best >= np.roll(best, -1)))
    height, width = mask.shape
    pixels = np.argwhere(np.ones_like(mask))[:, ::-1]
    images = []
    for peak in peaks[np.argsort(-best[peaks])][:MAX_IMAGES]:
        place = (float(angles[peak]), float(offsets[scores[peak].argmax()]))
        steps = (float(np.radians(SEED_STEP_DEG / 2)), coarse / 4)
        for sigma in MATCH_SIGMAS_PX:
            place, steps = _refined(partial(matched, sigma=sigma), place, steps, sigma / 8 / float(depth.max()))
        column, row = np.rint(mirrored(pixels, *place)).astype(int).T
        is_inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        image = is_inside & mask[row.clip(0, height - 1), column.clip(0, width - 1)]
        images.append(image.reshape(mask.shape))
    return images


def symmetric_body(mask: np.ndarray, image: np.ndarray) -> np.ndarray | None:
    """Return where a silhouette (H, W) bool and its mirror image overlap, if that could be its body."""
    pieces, _ = ndimage.label(mask & image)
    body = np.asarray(pieces == np.bincount(pieces[pieces > 0], minlength=2).argmax())
    share = float((distance_inside(~_contour(mask))[_contour(body)] <= CONTOUR_PX).mean())
    return body if body.sum() >= MIN_BODY_SHARE * mask.sum() and share >= MIN_MATCHED_SHARE else None


def completed_silhouette(mask: np.ndarray, image: np.ndarray) -> np.ndarray | None:
    """Return a silhouette (H, W) bool together with its mirror image, if it could be what an imperfect mask shows.

    What is missing on one side of a symmetric silhouette shows on the other.
    """
    whole = mask | image
    return whole if mask.sum() >= MIN_COMPLETED_SHARE * whole.sum() else None


def _contour(mask: np.ndarray) -> np.ndarray:
    """Return the pixels (H, W) bool along the contour of a silhouette (H, W) bool."""
    return np.asarray(mask & (depth_inside(mask) < CONTOUR_PX))


@njit(cache=True, nogil=True)
def _mirrored_share(points: np.ndarray, centre: np.ndarray, angle: float, offset: float, mask: np.ndarray) -> float:
    """Return the share of points (N, 2), camera frame, whose mirror images lie in a mask (H, W) bool.

    centre: (2,); angle: of the axis' normal, radians; offset: of the axis from the centre along it, in pixels.
    """
    height, width = mask.shape
    x, y = np.cos(angle), np.sin(angle)
    within = 0
    for point in range(len(points)):
        beyond = (points[point, 0] - centre[0]) * x + (points[point, 1] - centre[1]) * y - offset
        column = int(np.rint(points[point, 0] - 2.0 * beyond * x + (width - 1) / 2))
        row = int(np.rint((height - 1) / 2 - points[point, 1] + 2.0 * beyond * y))
        within += 0 <= column < width and 0 <= row < height and mask[row, column]
    return within / len(points)


@njit(cache=True, nogil=True)
def _mean_match(points: np.ndarray, to_contour: np.ndarray, sigma: float) -> float:
    """Return how well points (N, 2), column and row, lie on a contour: 1 on it, 1/e at the distance `sigma` in pixels.

    to_contour: (H, W), each pixel's distance.
    """
    height, width = to_contour.shape
    total = 0.0
    for point in range(len(points)):
        x, y = min(max(points[point, 0], 0.0), width - 1.0), min(max(points[point, 1], 0.0), height - 1.0)
        column, row = min(int(x), width - 2), min(int(y), height - 2)
        beside, below = x - column, y - row
        distance = (1.0 - below) * ((1.0 - beside) * to_contour[row, column] + beside * to_contour[row, column + 1])
        distance += below * ((1.0 - beside) * to_contour[row + 1, column] + beside * to_contour[row + 1, column + 1])
        total += np.exp(-((distance / sigma) ** 2))
    return total / len(points)
