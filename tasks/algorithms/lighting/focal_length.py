"""Focal length from the ellipse of a sphere beside the frame's centre (tangent cone: Hartley and Zisserman 2004, 8.3).

A near camera projects a sphere to an ellipse that is elongated towards the frame's centre. Seen by a virtual camera of
the right focal length, aimed at the sphere, its contour is a circle; so the focal length is the one with the best
contour score.
"""

from itertools import product

import cv2
import numpy as np

from glint.tasks.algorithms.geometry.perspective import VirtualCamera
from glint.tasks.algorithms.lighting.circles import contour_score, log_gradient
from glint.tasks.algorithms.lighting.spheres import Sphere

FOCAL_WIDTHS = tuple(np.round(np.geomspace(0.6, 2.4, 5), 3).tolist())
"""Focal lengths in frame widths that are tried; longer ones make too small a difference from a circle."""
ORTHOGRAPHIC_FOCAL_WIDTHS = 20.0
"""Focal length in frame widths that stands for an orthographic camera."""
CENTRE_SHIFTS_PX = (-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5)
"""Offsets of the circle's centre from the given one, along x and y."""
RADIUS_RATIOS = tuple(np.arange(0.94, 1.061, 0.015).tolist())
"""Ratios of the circle's radius to the given one."""
MIN_SCORE_RATIO = 1.05
"""Ratio of the best score to an orthographic camera's from which the contour counts as an ellipse."""
MIN_CONTOUR_SCORE = 0.14
"""Contour score below which no contour is seen."""
SCORED_RADIUS_PX = 50.0
"""Radius to which larger spheres are reduced."""


def estimate_focal_length(
    median: np.ndarray, maximum: np.ndarray, sphere: Sphere, frame_centre: tuple[float, float], width: float
) -> float | None:
    """Estimate the focal length in frame widths from a sphere's contour; None if the camera may be orthographic.

    The value is accurate to a factor of about 1.5; that there is an ellipse at all is more certain.

    Args:
        median: temporal median (h, w) around the sphere.
        maximum: temporal maximum (h, w).
        sphere: in these pixels.
        frame_centre: x and y of the full frame's centre in these pixels.
        width: of the full frame in pixels.
    """
    scale = max(1, int(sphere.radius / SCORED_RADIUS_PX))
    size = (median.shape[1] // scale, median.shape[0] // scale)
    images = [cv2.resize(image.astype(np.float32), size, interpolation=cv2.INTER_AREA) for image in (median, maximum)]
    shift = 0.5 * (scale - 1)
    reduced = Sphere((sphere.x - shift) / scale, (sphere.y - shift) / scale, sphere.radius / scale)
    column, row = ((position - shift) / scale for position in frame_centre)
    scores = []
    for focal in (ORTHOGRAPHIC_FOCAL_WIDTHS, *FOCAL_WIDTHS):
        pixels = focal * width / scale
        camera = np.array([[pixels, 0.0, column], [0.0, pixels, row], [0.0, 0.0, 1.0]])
        scores.append(_circle_score(images, reduced, camera))
    best = int(np.argmax(scores))
    if best == 0 or scores[best] < max(MIN_SCORE_RATIO * scores[0], MIN_CONTOUR_SCORE):
        return None
    return FOCAL_WIDTHS[best - 1]


def _circle_score(images: list[np.ndarray], sphere: Sphere, camera: np.ndarray) -> float:
    """Return the best contour score of circles near a sphere, as seen by a camera (3, 3) aimed at it."""
    virtual = VirtualCamera.aimed_at(sphere.x, sphere.y, sphere.radius, camera)
    edges = [log_gradient(virtual.warp(image)) for image in images]
    return max(
        contour_score(edges, virtual.centre + right, virtual.centre + down, ratio * sphere.radius)
        for right, down, ratio in product(CENTRE_SHIFTS_PX, CENTRE_SHIFTS_PX, RADIUS_RATIOS)
    )
