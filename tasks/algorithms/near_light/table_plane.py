"""The plane of the matte table on which sphere and object stand, by how its brightness follows the light.

By Lambert's law the irradiance of a plane is linear in the light's direction, with the plane's normal as its gradient
and the room's light as the constant (photometric stereo: Woodham 1980). All places are of one plane, so that the median
over them leaves out shadows and caustics. The sphere touches the plane from above.
"""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.geometry.robust import robust_deviation
from glint.tasks.algorithms.geometry.vectors import unit

CAMERA_EXPONENT = 1.0 / 2.2
"""Exponent of a usual camera's levels over irradiance."""
SHADOWED_PLACES_PERCENTILE, SHADOW_PERCENTILE = 2.0, 1.0
"""Percentile over the places of the levels in a frame, and of these over the frames: the darkest shadow."""
NOISE_QUANTILE = 2.05
"""Standard deviations that this percentile of the places lies below the median of all that are equally dark."""
MIN_NORMAL_Z = 0.1
"""Least z of the plane's normal: at less the table would hardly be seen."""
MIN_INCIDENCE = 0.02
"""Least cosine of the incidence in the model of levels: at less the table is not lit."""
NORMAL_ROUNDS, UNEXPLAINED_DEVIATIONS = 5, 2.0
"""Rounds of the robust fit, and robust standard deviations beyond which the weight of a frame falls."""


@dataclass(frozen=True, slots=True)
class TablePlane:
    """The plane normal . p = offset.

    normal: (3,), unit, in the camera frame, towards the light. offset: pixels from the reference point.
    """

    normal: np.ndarray
    offset: float

    @classmethod
    def below(cls, normal: np.ndarray, centre: np.ndarray, radius: float) -> "TablePlane":
        """Return the plane of a normal (3,) that touches a sphere from below.

        centre: (3,) of the sphere relative to the reference point, y up; radius: of it; both in pixels.
        """
        return cls(normal, float(centre @ normal) - radius)

    def points(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the points (N, 3) of the plane that are seen at x, y (N,), pixels from the reference point, y up."""
        depth = (self.offset - x * self.normal[0] - y * self.normal[1]) / self.normal[2]
        return np.stack([x, y, depth], axis=-1)

    def log_levels(
        self, points: np.ndarray, lights: np.ndarray, inverse_distance: float, room_share: float
    ) -> np.ndarray:
        """Return the logarithm (T, N) of levels at points (N, 3) of the plane, up to a term of each frame and place.

        lights (T, 3): directions at the reference point; inverse_distance: of the light from there, 1/pixels;
        room_share: of the room's light in a usual level.
        """
        to_light = lights[:, None] - inverse_distance * points
        square = (to_light**2).sum(axis=-1)
        irradiance = np.maximum(to_light @ self.normal, MIN_INCIDENCE * np.sqrt(square)) / square**1.5
        return np.asarray(
            CAMERA_EXPONENT * np.log(room_share + (1.0 - room_share) * irradiance / np.median(irradiance))
        )


def shadow_share(levels: np.ndarray) -> float:
    """Return the share of the room's light in the table's that the darkest shadow in levels (T, N) leaves possible."""
    brightness = np.log(levels / np.median(levels, axis=0))
    usual = np.median(brightness, axis=1)
    noise = robust_deviation(brightness - usual[:, None])
    shadowed = np.percentile(brightness, SHADOWED_PLACES_PERCENTILE, axis=1) + NOISE_QUANTILE * noise
    # The whole table is dark where the light is off or behind it.
    darkest = np.percentile(np.minimum(shadowed, usual), SHADOW_PERCENTILE)
    return float(np.exp(darkest / CAMERA_EXPONENT))


def table_normal(levels: np.ndarray, lights: np.ndarray) -> np.ndarray:
    """Return the normal (3,) of the table.

    Args:
        levels: (T, N) of N places of the table, above 0.
        lights: (T, 3) of these frames.
    """
    irradiance = levels.astype(np.float64) ** (1.0 / CAMERA_EXPONENT)
    brightness = np.median(irradiance / np.median(irradiance, axis=0), axis=1)
    directions, most_room = lights.astype(np.float64), shadow_share(levels)
    with_room = np.column_stack([directions, np.ones(len(directions))])
    weights, normal = np.ones(len(brightness)), np.array([0.0, 0.0, 1.0])
    for _ in range(NORMAL_ROUNDS):
        # From below, a light leaves the table dark, and does not darken it further.
        weights[directions @ normal < 0.0] = 0.0
        room = min(max(float(_least_squares(with_room, brightness, weights)[3]), 0.0), most_room)
        gradient = _least_squares(directions, brightness - room, weights)
        residual = brightness - room - directions @ gradient
        limit = UNEXPLAINED_DEVIATIONS * robust_deviation(residual[weights > 0.0]) + 1e-9
        weights = 1.0 / (1.0 + (residual / limit) ** 2)
        least = MIN_NORMAL_Z * float(np.linalg.norm(gradient))
        normal = unit(np.array([gradient[0], gradient[1], max(gradient[2], least)]))
    return np.asarray(normal)


def _least_squares(matrix: np.ndarray, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the weighted least-squares solution (K,) of a matrix (T, K) and values (T,)."""
    root = np.sqrt(weights)
    return np.asarray(np.linalg.lstsq(matrix * root[:, None], values * root, rcond=None)[0])
