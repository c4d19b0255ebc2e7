"""Views in which faceted bodies are compared: silhouette, candidates in the camera frame, normals lights reached."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from glint.tasks.algorithms.facets.faceted_body import FacetedBody
from glint.tasks.algorithms.facets.placements import Placement
from glint.tasks.algorithms.geometry.contours import smooth_contour
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.geometry.perspective import (
    centred_view_vectors,
    rotate_from_view,
    rotate_to_view,
    to_camera_directions,
)
from glint.tasks.algorithms.geometry.vectors import to_camera, unit
from glint.tasks.algorithms.prior.swept_normals import SweptNormals
from glint.tasks.algorithms.prisms.polyhedron import sampled_middle

UNFILLED_PX = 1
"""Distance in pixels from the contour within which pixels need not be filled."""
CONTOUR_POINTS = 250
"""Points of the contour in which a body is inscribed."""
STRAYS = 60
"""Places of the silhouette at which the highlights of a crease are looked for, to compare."""


def silhouette_contour(mask: np.ndarray) -> np.ndarray:
    """Return points (N, 2) of the contour of a mask (H, W) bool, x and y in the camera frame, pixels."""
    contour = smooth_contour(mask)
    columns, rows = contour[:: max(1, len(contour) // CONTOUR_POINTS)].T
    return np.stack(to_camera(columns, rows, mask.shape[1], mask.shape[0]), axis=-1)


@dataclass(frozen=True, eq=False)
class FacetView:
    """View in which faceted bodies are compared.

    normals: (H, W, K, 3) float32, candidates in the camera frame, NaN where there is none. mask: (H, W) bool, the
    silhouette. contour: (N, 2), x and y of its contour in the camera frame, pixels. inverse_focal: 1 over the focal
    length in pixels, 0 for parallel rays. swept: normals that the lights reached, relative to the view rays. stride,
    middle (2,): of the pixels in the whole image, and where this one's centre lies in that.
    """

    normals: np.ndarray
    mask: np.ndarray
    contour: np.ndarray
    inverse_focal: float
    swept: SweptNormals
    stride: int
    middle: np.ndarray

    @classmethod
    def of(cls, candidates: np.ndarray, mask: np.ndarray, inverse_focal: float, stride: int) -> "FacetView | None":
        """Return the view of every `stride`-th pixel; None without candidates.

        candidates: (K, H, W, 3), relative to the view rays, NaN where there is none. mask: (H, W) bool. inverse_focal:
        of the whole image, at whose centre is the principal point.
        """
        sampled, candidates = mask[::stride, ::stride], candidates[:, ::stride, ::stride]
        swept = SweptNormals.of(np.where(sampled[..., None], candidates, np.nan))
        if swept is None:
            return None
        middle = sampled_middle(mask.shape, stride)
        contour = (silhouette_contour(mask) - middle) / stride
        view = centred_view_vectors(sampled.shape, inverse_focal * stride)
        normals = np.ascontiguousarray(np.moveaxis(rotate_from_view(candidates, view), 0, 2), np.float32)
        return cls(normals, sampled, contour, inverse_focal * stride, swept, stride, middle)

    def body(self, placement: Placement) -> FacetedBody:
        """Return the largest body of a placement inside the silhouette."""
        frame = placement.frame(self.inverse_focal, self.middle, self.stride)
        return FacetedBody.inside(self.contour, frame, placement.polygon)

    @cached_property
    def inradius(self) -> float:
        """Inradius of the silhouette in pixels."""
        return inradius_of(self.mask)

    @cached_property
    def inner(self) -> np.ndarray:
        """Pixels (H, W) bool that a body must fill."""
        side = 2 * UNFILLED_PX + 1
        return cv2.erode(self.mask.astype(np.uint8), np.ones((side, side), np.uint8), borderValue=0) > 0

    @cached_property
    def strays(self) -> np.ndarray:
        """Columns and rows (M, 2) of pixels all over the silhouette."""
        rows, columns = np.nonzero(self.mask)
        return np.column_stack([columns, rows])[:: max(1, len(rows) // STRAYS)].astype(float)

    @cached_property
    def shown(self) -> tuple[np.ndarray, np.ndarray]:
        """Candidates (M, 3) in the silhouette, and the flat positions (M,) of their pixels."""
        present = np.isfinite(self.normals[..., 0]) & self.mask[..., None]
        rows, columns, _ = np.nonzero(present)
        return self.normals[present].astype(float), rows * self.mask.shape[1] + columns

    def flashing(self, normals: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return which of normals (N, 3), camera frame, the lights reached at image positions (N, 2)."""
        view = unit(to_camera_directions(places[:, 0], places[:, 1], self.inverse_focal))
        return self.swept.flashes(rotate_to_view(normals, view))
