"""Hollow or solid: whether the far wall, which an open end shows, is seen through the near wall as well.

The flat end of a solid body is a window too. A ray that it refracts stays in its plane through the axis, is reflected
by the far wall, and leaves through the flat bottom as if the far wall had been alone: its highlights are those of an
open vessel's far wall. But the near wall of a solid body turns rays aside, and that of an empty vessel hardly does, so
that highlights of the far wall go on below the lip.

Both hold for walls that are parallel to the axis alone: a slanting wall of a solid shows other half vectors, and the
thick wall of a heavy bowl turns rays aside too. Where a lip separates near and far wall there is a vessel in any case.
"""

import numpy as np

from glint.tasks.algorithms.geometry.vectors import pixel_positions
from glint.tasks.algorithms.revolution.opening import Opening, agreeing_share, agreement, find_opening
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution

BELOW_RADII = (0.25, 0.75)
"""Heights below the lip, in radii of the end, between which the far wall is looked for: nearer, pixels belong to an end
that is placed a little too low; beyond, the bottom may begin."""
ACROSS_RADII = 0.8
"""Distance from the axis, in such radii, up to which: near the contour a wall is thick, and refracts."""
MAX_LIP_RADII, MAX_WALL_DEG = 0.08, 15.0
"""Thickness of a lip, in such radii, from which it is a vessel's, and median angle of the wall from the axis, within a
radius below the end, from which a solid would show other half vectors."""
MIN_THROUGH_RATIO = 0.45
"""Share of these pixels that agree with the far wall, relative to that in the end, from which the body is hollow: 0.6
or more on 12 vessels, up to 0.31 on solid cylinders and blunt cones."""
MIN_THROUGH_PIXELS = 50
"""Pixels that must be expected to show the far wall for a body to be told solid."""


def hollow_opening(surface: SurfaceOfRevolution, mask: np.ndarray, candidates: np.ndarray) -> Opening | None:
    """Return the opening of a hollow body's end that faces the camera; None if it is closed, or a window of a solid.

    mask: (H, W) bool, the silhouette. candidates: (K, H, W, 3), NaN where there is none.
    """
    opening = find_opening(surface, mask, candidates)
    return None if opening is None or is_solid(opening, mask, candidates) else opening


def is_solid(opening: Opening, mask: np.ndarray, candidates: np.ndarray) -> bool:
    """Return whether the near wall below an opening does not show the far wall that the opening shows.

    mask: (H, W) bool, the silhouette. candidates: (K, H, W, 3), NaN where there is none.
    """
    surface = opening.surface
    if opening.lip > MAX_LIP_RADII * surface.end_radius or _wall_angle_deg(surface) > MAX_WALL_DEG:
        return False
    x, y = pixel_positions(mask)
    hits = surface.intersect(x, y)
    is_end = surface.is_end_at(hits)
    radius, below = surface.end_radius, (surface.end_height - hits.heights) * surface.facing
    is_middle = np.abs(hits.across) < ACROSS_RADII * radius
    is_lip = is_end & (hits.apothems > radius - opening.lip)
    is_wall = ~is_end & (below > BELOW_RADII[0] * radius) & (below < BELOW_RADII[1] * radius)
    sign = agreement(surface.shrunk(opening.lip).normals(x, y, far=True), candidates[:, mask])
    in_end, through_wall = sign[is_end & ~is_lip & is_middle], sign[is_wall & is_middle]
    if np.count_nonzero(through_wall) < MIN_THROUGH_PIXELS:
        return False
    return agreeing_share(through_wall) < MIN_THROUGH_RATIO * agreeing_share(in_end)


def _wall_angle_deg(surface: SurfaceOfRevolution) -> float:
    """Return the median angle in degrees between the wall and the axis within a radius below the end."""
    below = (surface.end_height - surface.heights) * surface.facing
    is_wall = (below > 0.0) & (below < surface.end_radius) & (surface.squared_radii > 0.0)
    slopes = surface.half_slopes[is_wall] / np.sqrt(surface.squared_radii[is_wall])
    return float(np.degrees(np.arctan(np.median(np.abs(slopes))))) if is_wall.any() else 0.0
