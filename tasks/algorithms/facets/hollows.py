"""Hollows of faceted bodies: round, at most as wide as the circles inside their facets, and open to the camera.

Tumblers with a cut outside are turned or blown inside; through the opening the far wall of that is seen.
"""

import numpy as np

from glint.tasks.algorithms.facets.faceted_body import POLYGON_STEP_PX, FacetedBody
from glint.tasks.algorithms.facets.placements import Placement
from glint.tasks.algorithms.geometry.vectors import positions_at
from glint.tasks.algorithms.prisms.polyhedron import PolyhedralNormals
from glint.tasks.algorithms.revolution.opening import find_opening
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution


def with_hollow(
    solid: PolyhedralNormals, body: FacetedBody, placement: Placement, mask: np.ndarray, candidates: np.ndarray
) -> PolyhedralNormals:
    """Return what a mask shows of a body, of which it may show the inside through an opening.

    Args:
        solid: what it shows if the body is closed.
        body: of this placement, in pixels of the mask.
        placement: of the body.
        mask: (H, W) bool, the silhouette.
        candidates: (K, H, W, 3), relative to the view rays, NaN where there is none.
    """
    opening = find_opening(_inscribed(body, placement), mask, candidates, turns_deg=(0.0,), cuts=(0.0,))
    if opening is None:
        return solid
    rows, columns = np.nonzero(opening.around)
    x, y = positions_at(rows, columns, mask.shape)
    shown, depths, is_far = opening.entries(x, y)
    far = rows[is_far], columns[is_far]
    result = solid._replace(normals=solid.normals.copy(), depths=solid.depths.copy(), faces=solid.faces.copy())
    result.normals[far], result.depths[far], result.faces[far] = shown[is_far], depths[is_far], -1
    return result


def _inscribed(body: FacetedBody, placement: Placement) -> SurfaceOfRevolution:
    """Return the largest surface of revolution inside a body of this placement."""
    heights = np.arange(body.heights[0], body.heights[-1] + POLYGON_STEP_PX, POLYGON_STEP_PX)
    squared = np.interp(heights, body.heights, body.apothems) ** 2
    # Beyond both ends the radius is 0.
    heights = np.concatenate([[heights[0] - POLYGON_STEP_PX], heights, [heights[-1] + POLYGON_STEP_PX]])
    squared = np.pad(squared, 1)
    half_slopes = np.gradient(squared, heights) / 2.0
    return SurfaceOfRevolution(
        placement.axis, placement.tilt, heights, squared, half_slopes, inverse_focal=body.inverse_focal
    )
