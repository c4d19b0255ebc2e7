"""Hollow or solid: whether the far wall, which an open end shows, is seen through the near wall as well.

The flat end of a solid body is a window too. A ray that it refracts stays in its plane through the axis, is reflected
by the far wall, and leaves through the flat bottom as if the far wall had been alone: its highlights are those of an
open vessel's far wall. But the near wall of a solid body turns rays aside, and that of an empty vessel hardly does, so
that highlights of the far wall go on below the lip.
"""

import numpy as np

from glint.tasks.algorithms.geometry.vectors import pixel_positions
from glint.tasks.algorithms.revolution.opening import Opening, agreeing_share, agreement

BELOW_RADII = (0.25, 0.75)
"""Heights below the lip, in radii of the end, between which the far wall is looked for: nearer, pixels belong to an end
that is placed a little too low; beyond, the bottom may begin."""
ACROSS_RADII = 0.8
"""Distance from the axis, in such radii, up to which: near the contour a wall is thick, and refracts."""
MIN_THROUGH_RATIO = 0.45
"""Share of these pixels that agree with the far wall, relative to that in the end, from which the body is hollow: 0.6
or more on 12 vessels, up to 0.31 on six solid cylinders and cones."""
MIN_THROUGH_PIXELS = 50
"""Pixels that must be expected to show the far wall for a body to be told solid."""


def is_solid(opening: Opening, mask: np.ndarray, candidates: np.ndarray) -> bool:
    """Return whether the near wall below an opening does not show the far wall that the opening shows.

    mask: (H, W) bool, the silhouette. candidates: (K, H, W, 3), NaN where there is none.
    """
    surface = opening.surface
    x, y = pixel_positions(mask)
    hits, is_end = surface.intersect(x, y), surface.is_end(x, y)
    radius, below = surface.end_radius, (surface.end_height - hits.heights) * surface.facing
    is_middle = np.abs(hits.across) < ACROSS_RADII * radius
    is_lip = is_end & (np.linalg.norm(hits.outward, axis=1) > radius - opening.lip)
    is_wall = ~is_end & (below > BELOW_RADII[0] * radius) & (below < BELOW_RADII[1] * radius)
    sign = agreement(surface.shrunk(opening.lip).normals(x, y, far=True), candidates[:, mask])
    in_end, through_wall = sign[is_end & ~is_lip & is_middle], sign[is_wall & is_middle]
    if np.count_nonzero(through_wall) < MIN_THROUGH_PIXELS:
        return False
    return agreeing_share(through_wall) < MIN_THROUGH_RATIO * agreeing_share(in_end)
