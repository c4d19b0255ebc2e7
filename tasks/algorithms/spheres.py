"""Mirror balls in a static camera's frame."""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, slots=True)
class Sphere:
    """A mirror ball: centre x, y and radius in pixels (centre of the top-left pixel = (0, 0), y down).

    `score` in 0..1 says how well it was seen; a sphere that the user gave has 1.
    """

    x: float
    y: float
    radius: float
    score: float = 1.0

    def within(self, left: float, top: float) -> "Sphere":
        """The same sphere in the pixels of a crop whose top-left pixel is (left, top)."""
        return replace(self, x=self.x - left, y=self.y - top)
