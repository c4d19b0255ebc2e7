"""A camera that is near shows a ball beside the frame's middle as an ellipse, longer towards the middle.

Its outline then fits a circle best as a camera of the right focal length, turned to the ball, would see it.
"""

from itertools import product

import cv2
import numpy as np

from glint.tasks.algorithms.geometry.perspective import Turned
from glint.tasks.algorithms.lighting.circles import edge_picture, outline
from glint.tasks.algorithms.lighting.spheres import LEAST_SCORE, Sphere

FOCALS = tuple(np.round(np.geomspace(0.6, 2.4, 5), 3).tolist())
"""Focal lengths in frame widths that are tried; longer ones leave too little of an ellipse."""
FAR = 20.0
SHIFTS, SHARES = (-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5), tuple(np.arange(0.94, 1.061, 0.015).tolist())
"""Pixels by which the ball may lie beside its given place, and ratios of its radius to the given one."""
BETTER = 1.03
"""Ratio of the best outline's score to that of a far camera from which the outline counts as an ellipse."""
MEASURED = 50.0
"""Radius in pixels to which larger balls are shrunk."""


def find_focal(
    typical: np.ndarray, brightest: np.ndarray, sphere: Sphere, middle: tuple[float, float], width: float
) -> float | None:
    """Focal length in frame widths that a ball's outline tells, None where it may as well be a far camera's.

    typical, brightest (h, w): temporal median and maximum round the ball; sphere and the frame's middle (x, y) in their
    pixels; width of the frame in pixels. The length is rough, by half; that there is an ellipse is surer.
    """
    scale = max(1, int(sphere.radius / MEASURED))
    size = (typical.shape[1] // scale, typical.shape[0] // scale)
    pictures = [
        cv2.resize(each.astype(np.float32), size, interpolation=cv2.INTER_AREA) for each in (typical, brightest)
    ]
    shift = 0.5 * (scale - 1)
    ball = Sphere((sphere.x - shift) / scale, (sphere.y - shift) / scale, sphere.radius / scale)
    column, row = ((each - shift) / scale for each in middle)
    scores = []
    for focal in (FAR, *FOCALS):
        pixels = focal * width / scale
        camera = np.array([[pixels, 0.0, column], [0.0, pixels, row], [0.0, 0.0, 1.0]])
        turned = Turned.to(ball.x, ball.y, ball.radius, camera)
        edges = [edge_picture(turned.picture(each)) for each in pictures]
        scores.append(
            max(
                outline(edges, turned.middle + right, turned.middle + down, share * ball.radius)
                for right, down, share in product(SHIFTS, SHIFTS, SHARES)
            )
        )
    best = int(np.argmax(scores))
    if best == 0 or scores[best] < max(BETTER * scores[0], LEAST_SCORE):
        return None
    return FOCALS[best - 1]
