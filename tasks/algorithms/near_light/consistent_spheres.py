"""Chrome spheres of one capture mirror the same light: of those that contradict each other, one is none, or misplaced.

A near light is seen in different directions from two spheres: so two of them contradict each other only if no distance
of the light explains the difference. A misplaced circle turns all its half vectors alike, which a near light does only
if the circle lies too far outward, and then hardly as exactly.
"""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of
from glint.tasks.algorithms.lighting.lights import find_lights
from glint.tasks.algorithms.lighting.sphere_tests import MIN_TESTED_FRAMES, crop_of_circle
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.near_light.positions import SphereLights

MAX_CONTRADICTION_DEG = 6.0
"""Median angle between the half vectors of two spheres from which they contradict each other, unless a near light
explains it."""
MAX_NEAR_CONTRADICTION_DEG = 3.0
"""Median angle, with the light at the distance that explains most, up to which it does: 0.3 to 1.8 degrees on eleven
pairs of spheres and lights at 2.5 to 10 frame widths, 1.6 to 4.5 on circles a quarter of the radius too far outward."""
MIN_SPANS, DISTANCES = 2.0, 21
"""Least distance of the light, in the largest distance of two spheres, and number of inverse distances that are tried:
nearer ones stand between the spheres."""


@dataclass(frozen=True, slots=True)
class ContradictedSphere:
    """A sphere whose lights contradict those of a reference, in the median by an angle in degrees of half vectors.

    is_outvoted: whether another sphere agrees with the reference.
    """

    sphere: Sphere
    reference: Sphere
    angle_deg: float
    is_outvoted: bool

    def __str__(self) -> str:
        """Return the sentence that says so, with the remedy."""
        sphere, reference = self.sphere, self.reference
        return (
            f"the sphere at ({sphere.x:.0f}, {sphere.y:.0f}) is left out: its lights are {self.angle_deg:.0f} degrees"
            f" from those of the sphere at ({reference.x:.0f}, {reference.y:.0f}): compare both with the frame, and"
            " give `spheres` in the catalogue if the wrong one is left out"
        )


def consistent_spheres(
    frames: np.ndarray, spheres: list[Sphere], camera: np.ndarray | None = None
) -> tuple[list[Sphere], list[ContradictedSphere]]:
    """Drop spheres whose lights contradict those of the sphere with which most agree, the better one of two.

    Args:
        frames: (T, H, W), spread over the capture.
        spheres: best first, in the frames' pixels.
        camera: perspective camera's matrix (3, 3).

    Returns:
        The rest, and those that are dropped.
    """
    kept, contradicted = list[Sphere](), list[ContradictedSphere]()
    if len(spheres) < 2 or len(frames) < MIN_TESTED_FRAMES:
        return spheres, contradicted
    crops = [crop_of_circle(frames, sphere, camera) for sphere in spheres]
    shown = [find_lights(crop, inside, camera=matrix).half_vectors for crop, inside, matrix in crops]
    pairs = list(zip(spheres, shown, strict=True))
    span = max(first.distance(second) for first in spheres for second in spheres)
    matrix = np.array([[_unexplained(first, second, camera, span) for second in pairs] for first in pairs])
    # The reference is the sphere that the others agree with best; of two, the better one.
    agreeing = (matrix == 0.0).sum(axis=1)
    reference = int(np.argmax(agreeing))
    # It agrees with itself.
    is_outvoted = bool(agreeing[reference] > 1)
    for k, sphere in enumerate(spheres):
        angle = float(matrix[reference, k])
        if angle == 0.0:
            kept.append(sphere)
        else:
            contradicted.append(ContradictedSphere(sphere, spheres[reference], angle, is_outvoted))
    return kept, contradicted


def _unexplained(
    first: tuple[Sphere, np.ndarray], second: tuple[Sphere, np.ndarray], camera: np.ndarray | None, span: float
) -> float:
    """Return the median angle in degrees between the half vectors (T, 3) of two spheres; 0 where they may agree.

    span: largest distance of two spheres, in pixels.
    """
    shared = np.isfinite(first[1][:, 0]) & np.isfinite(second[1][:, 0])
    if not shared.any():
        return 0.0
    angle = float(np.median(angles(first[1][shared], second[1][shared])))
    if angle < MAX_CONTRADICTION_DEG:
        return 0.0
    middle = (first[0].x + second[0].x) / 2.0, (first[0].y + second[0].y) / 2.0
    sites = [SphereLights.of(shown[shared], sphere, middle, camera) for sphere, shown in (first, second)]
    return 0.0 if _parallax_residual(sites, MIN_SPANS * span) < MAX_NEAR_CONTRADICTION_DEG else angle


def _parallax_residual(sites: list[SphereLights], least_distance: float) -> float:
    """Return the least median angle in degrees between the half vectors of two sites midway, over lights' distances.

    least_distance: in pixels.
    """
    residuals = []
    for inverse in np.linspace(0.0, 1.0 / least_distance, DISTANCES):
        of_frames = np.full(len(sites[0].lights), inverse)
        half_vectors = [half_vectors_of(site.at_reference(of_frames)) for site in sites]
        residuals.append(float(np.median(angles(*half_vectors))))
    return min(residuals)
