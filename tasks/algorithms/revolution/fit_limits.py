"""How well a surface of revolution must fit accepted normals to be taken for the object."""

from typing import NamedTuple

import numpy as np

from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.revolution.relief import capped_angles


class FitLimits(NamedTuple):
    """Largest mean angle from accepted normals to a surface, each angle capped, and its ratio to that of simpler ones.

    is_of_slopes: whether the profile's slopes are fitted first. relief_excuses: whether one with relief may fit worse.
    """

    error_deg: float
    simpler_error_ratio: float
    is_of_slopes: bool = False
    relief_excuses: bool = True

    def largest_error(self, accepted: np.ndarray, field: np.ndarray | None) -> float:
        """Return the largest mean angle in degrees from accepted normals to a surface that fits well enough.

        Args:
            accepted: (H, W, 3), NaN where there is none.
            field: (H, W, 3), the silhouette's smooth normal field; None: not compared.
        """
        is_accepted = np.isfinite(accepted[..., 0])
        normals = accepted[is_accepted]
        if not len(normals):
            return self.error_deg
        # A single flat face may be the end of any surface of revolution: it shows no axis.
        simpler = [np.broadcast_to(unit(normals.sum(axis=0)), normals.shape)]
        if field is not None:
            simpler.append(field[is_accepted])
        errors = [float(capped_angles(surface, normals).mean()) for surface in simpler]
        return min(self.error_deg, self.simpler_error_ratio * min(errors))


SYMMETRIC_LIMITS = FitLimits(5.0, 0.4)
"""Limits for a symmetric silhouette."""
