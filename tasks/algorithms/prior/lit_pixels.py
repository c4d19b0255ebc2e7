"""Pixels of an object that show a highlight, and those that are dark although their normals seem to face the lights."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.prior.swept_normals import SweptNormals

DARK_WINDOW_INRADII = 0.02
"""Half the side of the square windows in which nothing may flash, in inradii of the object."""
MIN_DARK_SHARE = 0.75
"""Share of such a window whose field must face the lights."""
MIN_LIT_SHARE = 0.5
"""Share of the pixels facing the lights that must have a true highlight: where most have none, as with wrong lights,
darkness says nothing of a normal."""


@dataclass(frozen=True, slots=True)
class LitPixels:
    """Pixels of an object that show a highlight of its outer surface, and the normals that would show one.

    lit (H, W) bool: pixels with an accepted normal, or with a rejected one that may well be true. mask (H, W) bool.
    inradius: of the mask, in pixels. swept: normals that the lights reach.
    """

    lit: np.ndarray
    mask: np.ndarray
    inradius: float
    swept: SweptNormals

    def facing(self, field: np.ndarray) -> np.ndarray:
        """Return the pixels (H, W) bool whose normal in a field (H, W, 3) is certain to show the light."""
        return self.mask & self.swept.flashes(field)

    def is_informative(self, field: np.ndarray, accepted: np.ndarray) -> bool:
        """Return whether darkness says anything of the normals of a field (H, W, 3).

        It does if most pixels that face the lights are among the accepted ones (H, W) bool.
        """
        facing = self.facing(field)
        return bool((facing & accepted).sum() >= MIN_LIT_SHARE * facing.sum())

    def dark(self, field: np.ndarray) -> np.ndarray:
        """Return the pixels (H, W) bool of windows in which nothing is lit while a field (H, W, 3) faces the lights."""
        side = 2 * max(1, round(DARK_WINDOW_INRADII * self.inradius)) + 1
        square = np.ones((side, side), bool)
        empty = ndimage.binary_erosion(~self.lit, square, border_value=1)
        facing = ndimage.uniform_filter((self.facing(field) & ~self.lit).astype(np.float32), side)
        return self.mask & ~self.lit & ndimage.binary_dilation(empty & (facing >= MIN_DARK_SHARE), square)

    def subsampled(self, step: int) -> "LitPixels":
        """Return those of every `step`-th row and column."""
        return LitPixels(self.lit[::step, ::step], self.mask[::step, ::step], self.inradius / step, self.swept)
