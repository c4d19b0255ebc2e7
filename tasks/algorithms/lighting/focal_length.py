"""Focal length from a sphere's ellipse, or from the light that two spheres show (Hartley and Zisserman 2004, 8.3).

A near camera projects a sphere to an ellipse that is elongated towards the frame's centre. Seen by a virtual camera of
the right focal length, aimed at the sphere, its contour is a circle; so the focal length is the one with the best
contour score.
"""

from collections.abc import Sequence
from itertools import combinations, product

import cv2
import numpy as np

from glint.tasks.algorithms.geometry.perspective import VirtualCamera, rotate_from_view
from glint.tasks.algorithms.geometry.vectors import lights_of, unit
from glint.tasks.algorithms.lighting.circles import contour_score, log_gradient
from glint.tasks.algorithms.lighting.near_light import SphereLights
from glint.tasks.algorithms.lighting.spheres import MIN_SPHERE_SCORE, Sphere
from glint.tasks.algorithms.lighting.triangulation import fit_parallax

FOCAL_WIDTHS = tuple(np.round(np.geomspace(0.6, 2.4, 5), 3).tolist())
"""Focal lengths in frame widths that are tried; longer ones make too small a difference from a circle."""
ORTHOGRAPHIC_FOCAL_WIDTHS = 20.0
"""Focal length in frame widths that stands for an orthographic camera."""
CENTRE_SHIFTS_PX = (-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5)
"""Offsets of the circle's centre from the given one, along x and y."""
RADIUS_RATIOS = tuple(np.arange(0.94, 1.061, 0.015).tolist())
"""Ratios of the circle's radius to the given one."""
MIN_SCORE_RATIO = 1.03
"""Ratio of the best score to an orthographic camera's from which the contour counts as an ellipse."""
MIN_ROTATION = 0.03
"""Difference of two spheres' normals, along their baseline, from which the camera counts as near; wrong centres, by 2%
of the radius each, explain less."""
MAX_ACROSS_RATIO = 0.35
"""Ratio of their difference across the baseline to that along it, beyond which a sphere is wrong and not the camera."""
SECANT_STEPS = 4
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
    if best == 0 or scores[best] < max(MIN_SCORE_RATIO * scores[0], MIN_SPHERE_SCORE):
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


def focal_length_of_parallax(
    half_vectors: Sequence[np.ndarray], spheres: Sequence[Sphere], frame_centre: tuple[float, float]
) -> float | None:
    """Estimate the focal length in pixels from the light that several spheres show; None if it may be orthographic.

    Read as if its view vector were the optical axis, every sphere shows the light rotated by the angle between the two.
    At the right focal length the spheres agree. The parallax of a near light is no rotation, and is fitted with it.

    Args:
        half_vectors: (T, 3) of each sphere, measured as under an orthographic camera, NaN where rejected.
        spheres: in pixels of the full frame.
        frame_centre: x and y of the optical axis, likewise.
    """
    if len(spheres) < 2:
        return None
    first, second = max(combinations(range(len(spheres)), 2), key=lambda pair: _distance(spheres, *pair))
    baseline = np.array([spheres[first].x - spheres[second].x, spheres[second].y - spheres[first].y])
    length = float(np.linalg.norm(baseline))

    def rotation(inverse_focal: float) -> np.ndarray | None:
        """Return by how much (2,) the two spheres disagree at a focal length, along and across their baseline."""
        sites = [
            _site(values, sphere, frame_centre, inverse_focal)
            for values, sphere in zip(half_vectors, spheres, strict=True)
        ]
        fit = fit_parallax(sites)
        if fit is None:
            return None
        x, y = fit.rotations[first] - fit.rotations[second]
        return np.array([x * baseline[0] + y * baseline[1], x * baseline[1] - y * baseline[0]]) / length

    before = rotation(0.0)
    if before is None or before[0] < MIN_ROTATION or abs(before[1]) > MAX_ACROSS_RATIO * before[0]:
        return None
    # Half of the view's rotation shows in the normals; secant steps from there.
    previous, present = 0.0, 2.0 * float(before[0]) / length
    for _ in range(SECANT_STEPS):
        after = rotation(present)
        if after is None or abs(after[0] - before[0]) < 1e-6:
            break
        change = (present - previous) * float(after[0] / (after[0] - before[0]))
        previous, present, before = present, float(np.clip(present - change, 1e-6, 2.0 / length)), after
    return 1.0 / present


def _site(
    half_vectors: np.ndarray, sphere: Sphere, frame_centre: tuple[float, float], inverse_focal: float
) -> SphereLights:
    """Return the lights of a sphere under a perspective camera; positions are relative to the frame's centre."""
    x, y = sphere.x - frame_centre[0], frame_centre[1] - sphere.y
    view = unit(np.array([-x * inverse_focal, -y * inverse_focal, 1.0]))
    lights = rotate_from_view(lights_of(half_vectors.astype(np.float64)), view).astype(np.float64)
    return SphereLights(lights, np.array([x, y, 0.0]) + sphere.radius * unit(lights + view))


def _distance(spheres: Sequence[Sphere], first: int, second: int) -> float:
    return float(np.hypot(spheres[first].x - spheres[second].x, spheres[first].y - spheres[second].y))
