"""How well candidates agree with the normals of a body: those that the lights reached must show a candidate near."""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.geometry.vectors import nearest_angles, positions_at, sampled_pixels
from glint.tasks.algorithms.prior.swept_normals import SweptNormals
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution

AGREEMENT_PIXELS = 1500
"""Pixels of the object at which bodies are compared."""


@dataclass(frozen=True, slots=True)
class SampledCandidates:
    """Candidates (K, N, 3), relative to the view rays, of a sample of an object's pixels at x and y (N,), camera frame.

    NaN where there is none. swept: normals that the lights reached.
    """

    x: np.ndarray
    y: np.ndarray
    candidates: np.ndarray
    swept: SweptNormals

    @classmethod
    def of(cls, candidates: np.ndarray, mask: np.ndarray) -> "SampledCandidates | None":
        """Return a sample of candidates (K, H, W, 3) in a mask (H, W) bool; None without any."""
        swept = SweptNormals.of(np.where(mask[..., None], candidates, np.nan))
        if swept is None:
            return None
        rows, columns = sampled_pixels(mask, AGREEMENT_PIXELS)
        return cls(*positions_at(rows, columns, mask.shape), candidates[:, rows, columns], swept)

    def agreement(self, body: SurfaceOfRevolution, tolerance_deg: float, stride: int = 1) -> float:
        """Return how well every `stride`-th pixel agrees with a body, from -1 to 1.

        A pixel counts 1 if a candidate has the body's normal, and less by up to 2 in proportion to the angle between
        them, up to the tolerance; 0 if the lights never reached that normal; -1 where the body does not reach.
        """
        x, y, candidates = self.x[::stride], self.y[::stride], self.candidates[:, ::stride]
        hits = body.intersect(x, y)
        worth, is_end = self._worth(body.normals_at(hits), candidates, tolerance_deg), body.is_end_at(hits)
        # An end may be open, and show the far wall.
        far = self._worth(body.normals(x[is_end], y[is_end], far=True), candidates[:, is_end], tolerance_deg)
        worth[is_end] = np.maximum(worth[is_end], far)
        worth[np.isnan(hits.depths)] = -1.0
        return float(worth.mean())

    def _worth(self, normals: np.ndarray, candidates: np.ndarray, tolerance_deg: float) -> np.ndarray:
        """Return what candidates (K, N, 3) say for normals (N, 3): (N,), from -1 to 1."""
        error = nearest_angles(candidates, normals)
        return np.where(self.swept.flashes(normals), 1.0 - 2.0 * np.minimum(error / tolerance_deg, 1.0), 0.0)
