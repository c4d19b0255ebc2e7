"""Focal length from the light that two spheres show.

Under a perspective camera every sphere has its own view vector. Read as if that were the optical axis, a sphere shows
the light rotated by the angle between the two, so two spheres differ by a rotation, which no distance of the light
explains.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from glint.tasks.algorithms.geometry.perspective import rotate_from_view
from glint.tasks.algorithms.geometry.vectors import lights_of, unit
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.near_light.positions import SphereLights
from glint.tasks.algorithms.near_light.triangulation import fit_parallax

MIN_ROTATION = 0.03
"""Difference of two spheres' normals, along their baseline, from which the camera counts as near; wrong centres, by 2%
of the radius each, explain less."""
MAX_ACROSS_RATIO = 0.35
"""Ratio of their difference across the baseline to that along it, beyond which a sphere is wrong and not the camera."""
SECANT_STEPS = 4
"""Steps of the secant method."""


def focal_length_of_parallax(
    half_vectors: Sequence[np.ndarray], spheres: Sequence[Sphere], frame_centre: tuple[float, float]
) -> float | None:
    """Estimate the focal length in pixels from the light that several spheres show.

    Read as if its view vector were the optical axis, every sphere shows the light rotated by the angle between the two.
    At the right focal length the spheres agree. The parallax of a near light is no rotation, and is fitted with it.

    Args:
        half_vectors: (T, 3) of each sphere, measured as under an orthographic camera, NaN where rejected.
        spheres: in pixels of the full frame.
        frame_centre: x and y of the optical axis, likewise.

    Returns:
        The focal length, accurate to a factor of about 1.2; infinite if the spheres agree under an orthographic camera;
        None if they share too few frames, or disagree in another way.
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
    if before is None or before[0] < -MIN_ROTATION or abs(before[1]) > max(MAX_ACROSS_RATIO * before[0], MIN_ROTATION):
        return None
    if before[0] < MIN_ROTATION:
        return float(np.inf)
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
