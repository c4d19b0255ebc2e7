"""Mirror images of a silhouette about axes about which much of its contour is the image of contour.

What stands out on one side alone, a handle or a spout, breaks the symmetry of a silhouette, and so does what a mask
lacks on one side. Where silhouette and mirror image overlap may be the body beside a handle; both together may be the
whole of which the mask shows a part.
"""

from functools import partial
from typing import NamedTuple

import numpy as np
from numba import njit

from glint.tasks.algorithms.geometry.connected_parts import largest_part
from glint.tasks.algorithms.geometry.distance import depth_inside, distance_inside
from glint.tasks.algorithms.silhouettes.reflection_axes import MAX_SCORED_PIXELS, SEED_STEP_DEG, refined_place

MATCH_SIGMAS_PX = (6.0, 3.0, 1.0)
"""Distances of mirrored contour from contour at which a point counts 1/e of a match, in turn."""
MAX_AXIS_OFFSET = 0.5
"""Distance of a body's axis from the silhouette's centroid that is tried, in inradii."""
MAX_IMAGES = 3
"""Most mirror images of a silhouette, the best ones."""
MIN_BODY_SHARE, MIN_MATCHED_SHARE = 0.6, 0.7
"""Shares of a silhouette that its body must cover, and of the body's contour that must lie on the silhouette's."""
MIN_COMPLETED_SHARE = 0.8
"""Share of a completed silhouette that a mask must show."""
CONTOUR_PX = 1.5
"""Distance up to which a pixel is one of the contour."""


class MirrorAxis(NamedTuple):
    """An axis in the image.

    centre: (2,), column and row of a point. angle: of the axis' normal from the columns to the rows, radians. offset:
    of the axis from that point along the normal, in pixels.
    """

    centre: np.ndarray
    angle: float
    offset: float

    @property
    def normal(self) -> np.ndarray:
        """Unit normal (2,) of the axis: columns, rows."""
        return np.array([np.cos(self.angle), np.sin(self.angle)])

    def mirrored(self, points: np.ndarray) -> np.ndarray:
        """Return the mirror images of points (N, 2), column and row."""
        return np.asarray(points - 2.0 * np.outer((points - self.centre) @ self.normal - self.offset, self.normal))


def mirror_images(mask: np.ndarray) -> list[np.ndarray]:
    """Return at most MAX_IMAGES mirror images (H, W) bool of a silhouette (H, W) bool, best first."""
    return [mirror_image(mask, axis) for axis in mirror_axes(mask)]


def mirror_axes(mask: np.ndarray) -> list[MirrorAxis]:
    """Return the axes of at most MAX_IMAGES mirror images of a silhouette (H, W) bool, best first."""
    if not mask.any():
        return []
    depth = depth_inside(mask)
    contour = _contour(mask)
    to_contour = distance_inside(~contour)
    centre = np.argwhere(mask).mean(axis=0)[::-1]
    points = np.argwhere(contour)[:, ::-1].astype(float)
    points = points[:: max(1, len(points) // MAX_SCORED_PIXELS)]

    def matched(angle: float, offset: float, sigma: float, stride: int = 1) -> float:
        return _mean_match(MirrorAxis(centre, angle, offset).mirrored(points[::stride]), to_contour, sigma)

    # The best offset for each angle, then local maxima over the angle.
    coarse = MATCH_SIGMAS_PX[0]
    reach = MAX_AXIS_OFFSET * float(depth.max())
    angles = np.radians(np.arange(0.0, 180.0, SEED_STEP_DEG))
    offsets = np.arange(-reach, reach + 1.0, coarse / 2)
    scores = np.array([[matched(angle, offset, coarse, stride=4) for offset in offsets] for angle in angles])
    best = scores.max(axis=1)
    peaks = np.flatnonzero((best >= np.roll(best, 1)) & (best >= np.roll(best, -1)))
    axes = []
    for peak in peaks[np.argsort(-best[peaks])][:MAX_IMAGES]:
        place = (float(angles[peak]), float(offsets[scores[peak].argmax()]))
        steps = (float(np.radians(SEED_STEP_DEG / 2)), coarse / 4)
        for sigma in MATCH_SIGMAS_PX:
            place, steps = refined_place(partial(matched, sigma=sigma), place, steps, sigma / 8 / float(depth.max()))
        axes.append(MirrorAxis(centre, *place))
    return axes


def mirror_image(mask: np.ndarray, axis: MirrorAxis) -> np.ndarray:
    """Return the mirror image (H, W) bool of a mask (H, W) bool."""
    height, width = mask.shape
    pixels = np.argwhere(np.ones_like(mask))[:, ::-1]
    column, row = np.rint(axis.mirrored(pixels)).astype(int).T
    is_inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    image = is_inside & mask[row.clip(0, height - 1), column.clip(0, width - 1)]
    return np.asarray(image.reshape(mask.shape))


def symmetric_body(mask: np.ndarray, image: np.ndarray) -> np.ndarray | None:
    """Return where a silhouette and its mirror image, both (H, W) bool, overlap; None: that could not be its body."""
    body = largest_part(mask & image)
    is_body = body.sum() >= MIN_BODY_SHARE * mask.sum() and matched_share(mask, body) >= MIN_MATCHED_SHARE
    return body if is_body else None


def matched_share(mask: np.ndarray, body: np.ndarray) -> float:
    """Return the share of a body's contour that lies on the silhouette's; both (H, W) bool."""
    contour = _contour(body)
    return float((distance_inside(~_contour(mask))[contour] <= CONTOUR_PX).mean()) if contour.any() else 0.0


def completed_silhouette(mask: np.ndarray, image: np.ndarray) -> np.ndarray | None:
    """Return a silhouette (H, W) bool together with its mirror image, if that could be what an imperfect mask shows."""
    whole = mask | image
    return whole if mask.sum() >= MIN_COMPLETED_SHARE * whole.sum() else None


def _contour(mask: np.ndarray) -> np.ndarray:
    """Return the pixels (H, W) bool along the contour of a silhouette (H, W) bool."""
    return np.asarray(mask & (depth_inside(mask) < CONTOUR_PX))


@njit(cache=True, nogil=True)
def _mean_match(points: np.ndarray, to_contour: np.ndarray, sigma: float) -> float:
    """Return how well points (N, 2), column and row, lie on a contour: 1 on it, 1/e at the distance `sigma` in pixels.

    to_contour: (H, W), each pixel's distance. Points beside the image lie on no contour.
    """
    height, width = to_contour.shape
    total = 0.0
    for point in range(len(points)):
        x, y = points[point]
        if not (0.0 <= x <= width - 1.0 and 0.0 <= y <= height - 1.0):
            continue
        column, row = min(int(x), width - 2), min(int(y), height - 2)
        beside, below = x - column, y - row
        distance = (1.0 - below) * ((1.0 - beside) * to_contour[row, column] + beside * to_contour[row, column + 1])
        distance += below * ((1.0 - beside) * to_contour[row + 1, column] + beside * to_contour[row + 1, column + 1])
        total += np.exp(-((distance / sigma) ** 2))
    return total / len(points)
