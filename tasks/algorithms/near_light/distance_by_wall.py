"""Distance of a near light from the wall of a surface of revolution, which a single sphere's half vectors bend.

To first order a wrong distance adds a paraboloid to the surface, which integrates as well as the truth. But the contour
of a body of revolution tells how its normals turn along each circle, whatever its profile: a light that is nearer than
supposed turns them faster. A misplaced sphere turns all half vectors alike, and an oval body turns its normals faster
or slower than a round one: unknowns that are known beforehand to be small take these up.
"""

from typing import NamedTuple

import numpy as np

from glint.tasks.algorithms.geometry.perspective import lights_for_view
from glint.tasks.algorithms.geometry.robust import robust_deviation
from glint.tasks.algorithms.geometry.vectors import angles, component_derivatives, unit

NEAR_DEG = 8.0
"""Angle from the wall's normal up to which an accepted normal is the wall's."""
MIN_WALL_NORMALS = 200
"""Accepted normals from which the distance is measured."""
AXIS_ERROR_DEG, OVALITY = 0.3, 0.02
"""Standard deviations of the angle by which a wrong axis turns all circles, and of the share by which a body is longer
than wide across its axis, as hand-made glass is, along the view or aslant to it."""
ROBUST_ROUNDS, OUTLIER_DEVIATIONS = 4, 4.0
"""Rounds of the robust fit, and robust standard deviations from which a normal is left out."""
INDEPENDENT_NORMALS = 25.0
"""Independent normals that all of a wall count as: neighbours err alike, over lengths that grow with the object."""
CIRCLE_GROUPS = 8
"""Groups of neighbouring circles of which each is left out in turn: the normals of one err alike."""


class DistanceChange(NamedTuple):
    """Change of a light's inverse distance that the wall shows, 1/pixels, and its standard deviation."""

    change: float
    standard_deviation: float


class WallNormals(NamedTuple):
    """N accepted normals of a wall, in the camera frame.

    accepted, expected: (N, 3), as they are and as the surface has them. tangents: (N, 3), unit, along the circles.
    view: (N, 3), unit, towards the camera. offsets: (N, 3), pixels from the sphere that shows the light's directions,
    y up. circles: (N,), order of the circles.
    """

    accepted: np.ndarray
    expected: np.ndarray
    tangents: np.ndarray
    view: np.ndarray
    offsets: np.ndarray
    circles: np.ndarray


def wall_normals(
    accepted: np.ndarray, expected: np.ndarray, tangents: np.ndarray, offsets: np.ndarray, view: np.ndarray | None
) -> WallNormals:
    """Return the accepted normals that are a wall's.

    Args:
        accepted: (H, W, 3), NaN where there is none.
        expected, tangents: (H, W, 3), NaN beside the wall.
        offsets: (H, W, 2), pixels from the sphere that shows the light's directions, y up.
        view: (H, W, 3), unit vectors towards the camera; None for parallel rays.
    """
    used = np.isfinite(tangents[..., 0]) & (angles(accepted, expected) < NEAR_DEG)
    view_vectors = np.broadcast_to([0.0, 0.0, 1.0], accepted.shape) if view is None else view
    flat = np.concatenate([offsets[used], np.zeros((np.count_nonzero(used), 1))], axis=1)
    return WallNormals(
        accepted[used].astype(np.float64), expected[used], tangents[used], view_vectors[used], flat, np.nonzero(used)[0]
    )


def distance_by_wall(wall: WallNormals, sphere_sd: float) -> DistanceChange | None:
    """Measure by how much the inverse distance of a light is to change; None where the wall does not show it.

    sphere_sd: standard deviation per axis, in radians, of the half vectors of the sphere.
    """
    count = len(wall.accepted)
    if count < MIN_WALL_NORMALS:
        return None
    # Sine and cosine of the place on the circle, as seen from the axis.
    sine = -_dot(wall.tangents, wall.view)
    cosine = np.sqrt(np.maximum(1.0 - sine**2, 0.0))
    columns = [
        _dot(wall.tangents, turned_by_light(wall.accepted, wall.view, -wall.offsets)),
        *(_dot(wall.tangents, turn) for turn in np.moveaxis(component_derivatives(wall.accepted), -1, 0)),
        sine * cosine,
        0.5 * (cosine**2 - sine**2),
    ]
    matrix, residual = np.stack(columns, axis=1), _dot(wall.tangents, wall.expected - wall.accepted)
    turn = 1.0 / np.hypot(sphere_sd, np.radians(AXIS_ERROR_DEG)) ** 2
    precision = np.array([0.0, turn, turn, OVALITY**-2, OVALITY**-2])
    if not np.abs(columns[0]).max() > 0.0:
        return None
    change, deviation = _robust_fit(matrix, residual, precision)
    group = np.empty(count, np.int64)
    group[np.argsort(wall.circles, kind="stable")] = np.arange(count) * CIRCLE_GROUPS // count
    parts = [
        _robust_fit(matrix[group != number], residual[group != number], precision)[0] for number in range(CIRCLE_GROUPS)
    ]
    return DistanceChange(change, float(np.hypot(deviation, np.sqrt(CIRCLE_GROUPS - 1.0) * np.std(parts))))


def turned_by_light(half_vectors: np.ndarray, view: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Return the derivatives (.., 3) of half vectors by a motion of the light.

    half_vectors, view: (.., 3), unit. motion: (.., 3), of the vector to the light, which has unit length before.
    """
    light = lights_for_view(half_vectors, view)
    change = motion - _dot(motion, light)[..., None] * light
    across = change - _dot(change, half_vectors)[..., None] * half_vectors
    return np.asarray(across / np.linalg.norm(light + view, axis=-1)[..., None])


def moved_by_light(half_vectors: np.ndarray, view: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Return half vectors (.., 3) after a motion of the light; for the arguments see `turned_by_light`."""
    return np.asarray(unit(unit(lights_for_view(half_vectors, view) + motion) + view))


def _dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the scalar products (..) of vectors (.., 3)."""
    return np.asarray((first * second).sum(axis=-1))


def _robust_fit(matrix: np.ndarray, values: np.ndarray, precision: np.ndarray) -> tuple[float, float]:
    """Return the first unknown of a robust fit of values (N,) by a matrix (N, P), and its standard deviation.

    precision: (P,), inverse variances of the unknowns beforehand.
    """
    solution = np.zeros(matrix.shape[1])
    for _ in range(ROBUST_ROUNDS):
        remaining = np.abs(values - matrix @ solution)
        deviation = robust_deviation(remaining) + 1e-9
        kept = remaining < OUTLIER_DEVIATIONS * deviation
        weight = np.sqrt(INDEPENDENT_NORMALS / len(values)) / deviation
        used = weight * matrix[kept]
        covariance = np.linalg.inv(used.T @ used + np.diag(precision))
        solution = covariance @ used.T @ (weight * values[kept])
    return float(solution[0]), float(np.sqrt(covariance[0, 0]))
