"""The base plane of a turntable: the object stands on it, so that it touches the plane, and nothing of it lies lower.

Each ray through a silhouette touches the object somewhere inside the visual hull (Laurentini 1994), so the plane lies
no higher than the highest point of the hull on any of these rays. Views that look down see no underside: below the
object their hull is a cone, which the plane cuts off.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.multiview.visual_hull import bounding_sphere, hull_field

SILHOUETTE_RAYS = 240
"""Rays through each silhouette."""
RAY_SAMPLES = 160
"""Samples along a ray through the bounding sphere."""
HULL_TOLERANCE_PX = 0.75
"""Pixels outside the hull at which a sample still counts as inside: contour pixels lie half a pixel inside their own
silhouette, and poses err by tenths."""
MAX_BASE_ERROR_PX = 1.5
"""Pixels by which a given plane may lie above what a silhouette allows, or below the hull."""


@dataclass(frozen=True, slots=True)
class BaseEvidence:
    """Evidence of the silhouettes of V views for the height y of the base plane, in world units.

    highest (V,): the greatest height that each silhouette allows; lowest: that of the hull's lowest point, below which
    the object cannot touch the plane; pixel: world units that a pixel covers at the object.
    """

    highest: np.ndarray
    lowest: float
    pixel: float

    @property
    def height(self) -> float:
        """The greatest height that all silhouettes allow."""
        return float(self.highest.min())

    def contradiction(self, height: float, names: Sequence[str]) -> str | None:
        """Return what contradicts a plane at this height, None if nothing does; names: of the views."""
        worst = int(self.highest.argmin())
        above, below = (height - self.highest[worst]) / self.pixel, (self.lowest - height) / self.pixel
        if above > MAX_BASE_ERROR_PX:
            return f"{names[worst]} shows the object {above:.1f} pixels below it"
        if below > MAX_BASE_ERROR_PX:
            return f"the silhouettes end {below:.1f} pixels above it"
        return None


def base_evidence(views: Sequence[View]) -> BaseEvidence:
    """Measure where the base plane of a turntable can lie: views in world coordinates, their y axis the turntable's."""
    centre, radius = bounding_sphere(views)
    pixels = np.array([float(view.footprint(centre[None])[0]) for view in views])
    pixel = float(np.median(pixels))
    field = hull_field(views)
    steps = np.linspace(-radius, radius, RAY_SAMPLES)
    highest, lowest = [], []
    for view, own in zip(views, pixels, strict=True):
        starts, directions = view.rays(*view.silhouette_pixels(SILHOUETTE_RAYS))
        along = ((centre - starts) * directions).sum(axis=1)[:, None] + steps
        points = starts[:, None] + along[..., None] * directions[:, None]
        value = field(points.reshape(-1, 3)).reshape(along.shape)
        # A ray that misses the hull by the errors of the poses still touches the object where it is nearest.
        inside = value <= np.maximum(HULL_TOLERANCE_PX * pixel, value.min(axis=1, keepdims=True))
        heights = np.where(inside, points[..., 1], -np.inf).max(axis=1)
        # The silhouette runs half a pixel outside its outermost pixels.
        highest.append(heights.min() - 0.5 * own)
        lowest.append(np.where(inside, points[..., 1], np.inf).min() - 0.5 * own)
    return BaseEvidence(np.array(highest), float(np.min(lowest)), pixel)
