"""Searches for an object's shape in one view: under perspective, in that of a camera aimed at the object."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from glint.tasks.algorithms.silhouettes.aimed_view import AimedView


@dataclass(frozen=True, eq=False)
class AimedSearch:
    """Search for a shape in a view: under perspective, in that of a camera aimed at the object.

    candidates: (K, H, W, 3), relative to the view rays, NaN where there is none. mask: (H, W) bool, the silhouette.
    camera: (3, 3), the perspective camera's matrix in pixels of the mask; None for parallel rays.
    """

    candidates: np.ndarray
    mask: np.ndarray
    camera: np.ndarray | None

    @cached_property
    def _aimed(self) -> AimedView | None:
        return None if self.camera is None else AimedView.at(self.mask, self.camera)

    @property
    def _silhouette(self) -> np.ndarray:
        """Mask (H', W') bool of the view in which shapes are looked for."""
        return self.mask if self._aimed is None else self._aimed.silhouette

    @property
    def _shown(self) -> np.ndarray:
        """Candidates (K, H', W', 3) of that view."""
        return self.candidates if self._aimed is None else self._aimed.candidates(self.candidates)

    @property
    def _inverse_focal(self) -> float:
        """1 over the focal length in pixels of that view, 0 for parallel rays."""
        return 0.0 if self._aimed is None else 1.0 / self._aimed.focal
