"""Focal length from the ellipse of a sphere beside the frame's centre (tangent cone: Hartley and Zisserman 2004, 8.3).

A near camera projects a sphere to an ellipse that is elongated towards the frame's centre. Seen by a virtual camera of
the right focal length, aimed at the sphere, its contour is a circle; so the focal length is the one with the best
contour score. A shadow beside the sphere makes a circle look elongated too, so the elongation of the contour, with its
standard deviation, must speak for the focal length as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np

from glint.tasks.algorithms.geometry.perspective import VirtualCamera
from glint.tasks.algorithms.lighting.circles import contour_score, log_gradient
from glint.tasks.algorithms.lighting.contour import SCORE_DEVIATION, level_evidence, sample_rays
from glint.tasks.algorithms.lighting.pyramid import log_frames, reduced_image
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
ELONGATIONS = np.arange(-0.04, 0.1001, 0.005)
"""Elongations that are tried: half the difference of the half axes, in mean half axes."""
ELLIPSE_CENTRE_RATIOS, ELLIPSE_RADIUS_RATIOS = np.arange(-0.06, 0.061, 0.01), np.arange(0.93, 1.071, 0.005)
"""Offsets of an ellipse's centre and its mean half axes, in radii of the sphere."""
ELLIPSE_RADIUS_PX = 100.0
"""Radius in pixels to which the image of a larger sphere is reduced."""
ELLIPSE_MARGIN_RATIO = 0.45
"""Distance beyond the contour, in radii, of the crop in which the elongation is measured."""
MIN_ELONGATION_PX = 1.0
"""Pixels by which an ellipse's half axes must differ at the focal length that it suggests: a shadow beside a sphere
makes a circle seem elongated by up to 0.7."""
MIN_NEAR_CAMERA_NATS = -2.0
"""Log-likelihood ratio of a near camera by a sphere's elongation up to which the elongation contradicts the ellipse."""
MIN_ELLIPSE_NATS = 2.0
"""The same of the best focal length, from which the elongation alone is believed: 24 round contours show up to 1.4."""


@dataclass(frozen=True, slots=True)
class Elongation:
    """Elongation of a contour towards the frame's centre, half the difference of its half axes in mean half axes, and
    its standard deviation."""

    value: float
    deviation: float

    def near_camera_nats(self, offset_ratio: float) -> float:
        """Return the log-likelihood ratio of a near camera against a distant one.

        offset_ratio: distance of the sphere from the frame's centre in focal lengths of the near camera.
        """
        expected = 0.5 * (float(np.hypot(1.0, offset_ratio)) - 1.0)
        return (self.value**2 - (self.value - expected) ** 2) / (2.0 * self.deviation**2)

    @property
    def nats(self) -> float:
        """Log-likelihood ratio of the near camera that explains it best."""
        return max(self.value, 0.0) ** 2 / (2.0 * self.deviation**2)


def focal_length_of_ellipse(
    background: np.ndarray,
    peak: np.ndarray,
    elongation: Elongation,
    sphere: Sphere,
    frame_centre: tuple[float, float],
    width: float,
) -> float | None:
    """Return the focal length in frame widths by a sphere's ellipse; None if the camera may be orthographic.

    Args:
        background: temporal median (h, w) around the sphere.
        peak: temporal maximum (h, w).
        elongation: of the contour.
        sphere: in these pixels.
        frame_centre: x and y of the full frame's centre in these pixels.
        width: of the full frame in pixels.
    """
    offset = float(np.hypot(sphere.x - frame_centre[0], sphere.y - frame_centre[1])) / width
    if elongation.nats > MIN_ELLIPSE_NATS and 2.0 * elongation.value * sphere.radius > MIN_ELONGATION_PX:
        # The long half axis of a sphere at an angle from the axis exceeds the short one by 1 / cos.
        return offset / float(np.sqrt((1.0 + 2.0 * elongation.value) ** 2 - 1.0))
    focal = estimate_focal_length(background, peak, sphere, frame_centre, width)
    if focal is None or sphere.radius * (np.hypot(1.0, offset / focal) - 1.0) < MIN_ELONGATION_PX:
        return None
    return focal if elongation.near_camera_nats(offset / focal) > MIN_NEAR_CAMERA_NATS else None


def measure_elongation(
    frames: Sequence[np.ndarray] | np.ndarray, sphere: Sphere, frame_centre: tuple[float, float]
) -> Elongation:
    """Measure the elongation of a sphere's contour in many frames.

    The best ellipse of each elongation is scored by the mean evidence along it, as circles are in `contour`.

    Args:
        frames: (h, w) each, 0 to 255, around the sphere.
        sphere: in these pixels.
        frame_centre: x and y of the full frame's centre in these pixels.
    """
    margin = (1.0 + ELLIPSE_MARGIN_RATIO) * sphere.radius
    top, left = max(int(sphere.y - margin), 0), max(int(sphere.x - margin), 0)
    rows, columns = slice(top, int(sphere.y + margin) + 2), slice(left, int(sphere.x + margin) + 2)
    scale = max(1, int(sphere.radius / ELLIPSE_RADIUS_PX))
    crops = log_frames([reduced_image(frame[rows, columns], scale) for frame in frames])
    radius, shift = sphere.radius / scale, 0.5 * (scale - 1)
    x, y = (sphere.x - left - shift) / scale, (sphere.y - top - shift) / scale
    evidence = level_evidence(sample_rays(crops, x, y, 0.82 * radius, 1.33 * radius))
    towards_centre = np.arctan2(frame_centre[1] - sphere.y, frame_centre[0] - sphere.x)
    stretch = radius * np.cos(2.0 * (evidence.angles - towards_centre))
    scores = np.zeros(len(ELONGATIONS))
    for number, elongation in enumerate(ELONGATIONS):
        circles = evidence.shifted(elongation * stretch)
        scores[number] = circles.scores(ELLIPSE_CENTRE_RATIOS * radius, ELLIPSE_RADIUS_RATIOS * radius).max()
    weight = np.exp((scores - scores.max()) / SCORE_DEVIATION)
    weight /= weight.sum()
    mean = float(weight @ ELONGATIONS)
    step = float(ELONGATIONS[1] - ELONGATIONS[0])
    return Elongation(mean, float(np.hypot(np.sqrt(weight @ (ELONGATIONS - mean) ** 2), 0.5 * step)))


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
