"""What a camera sees of a solid that a function of the points in the camera frame gives."""

from collections.abc import Callable

import numpy as np

from glint.tasks.algorithms.geometry.vectors import to_camera, unit

STEP, HALVINGS = 2.0, 14


def rendered(
    distance: Callable[[np.ndarray], np.ndarray], high: float, shape: tuple[int, int], inverse_focal: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return normals (H, W, 3), camera frame, and z (H, W) of a solid; NaN beside it.

    distance: of points (N, 3) from it, negative inside. high: its z is between this and its negative.
    """
    rows, columns = np.indices(shape).astype(float)
    x, y = to_camera(columns.ravel(), rows.ravel(), shape[1], shape[0])
    rays = np.column_stack([-inverse_focal * x, -inverse_focal * y, np.ones_like(x)])
    starts = np.column_stack([x, y, np.zeros_like(x)])
    near = np.full(len(x), np.nan)
    for z in np.arange(high, -high, -STEP):
        is_hit = np.isnan(near) & (distance(starts + z * rays) < 0.0)
        near[is_hit] = z
    above, below = near + STEP, near
    for _ in range(HALVINGS):
        middle = (above + below) / 2.0
        is_inside = distance(starts + middle[:, None] * rays) < 0.0
        above, below = np.where(is_inside, above, middle), np.where(is_inside, middle, below)
    points = starts + below[:, None] * rays
    shifts = 1e-3 * np.eye(3)
    slopes = [distance(points + shift) - distance(points - shift) for shift in shifts]
    return unit(np.column_stack(slopes)).reshape(*shape, 3), points[:, 2].reshape(shape)


def rounded_box_distance(beyond: np.ndarray, radius: float) -> np.ndarray:
    """Return the distances (N,) from a rectangle or box that a ball has grown, negative inside.

    beyond: (N, 2) or (N, 3), how far points lie beyond its sides before it has grown. radius: of the ball.
    """
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0) - radius
