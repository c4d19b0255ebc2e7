"""Doubt of the half vectors by the camera: its matrix is not given and it is, or may be, near, or a wrong one is given.

Two spheres measure the focal length before anything else is known. With one sphere, the object's own normals do. They
also contradict a matrix that is given, as that of another lens or resolution.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import log_ndtr

from glint.tasks.algorithms.geometry.perspective import (
    areal_focal_length,
    half_vectors_on_axis,
    rotate_to_view,
    view_vectors,
)
from glint.tasks.algorithms.geometry.vectors import half_vectors_of, lights_of
from glint.tasks.algorithms.lighting.lights import Lights
from glint.tasks.algorithms.near_light.focal_length_of_normals import (
    InverseFocal,
    UnknownCamera,
    focal_length_of_normals,
)
from glint.tasks.algorithms.near_light.focal_length_of_parallax import focal_length_of_parallax
from glint.tasks.algorithms.near_light.half_vector_error import unknown_camera_error
from glint.tasks.algorithms.near_light.positions import median_distance
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import CaptureGeometry
from glint.tasks.stages.light_distance import DistanceResult, region_pixels

MIN_CAMERA_COST_DEG, MIN_UNKNOWN_COST_DEG = 1.0, 2.5
"""Usual error below which there is no warning: of a camera that is near, and of one that may be near, where
confidence begins to fall."""
LEAST_FOCAL_WIDTHS = 85.0 / 36.0
"""Focal length in frame widths of the shortest lens that the guide to photographing recommends without a matrix."""
NORMALS_ERROR_WIDTHS, NORMALS_RELATIVE_ERROR = 0.1, 0.1
"""Standard deviation of an inverse focal length by the normals, per frame width and relative to it, beyond the
estimate's own: that of simulated captures (`python -m tests.benchmarks.near_camera`)."""
MIN_DEVIATIONS = 2.5
"""Standard deviations by which normals must speak for a near camera: they include what a misplaced sphere explains."""
CONTRADICTED_DEVIATIONS = 3.0
"""Standard deviations from which normals contradict the focal length of a given matrix: right ones differ by 2.3 at
most on 20 captures."""
MAX_CENTRE_OFFSET = 0.15
"""Distance of a given principal point from the frame's middle, in frame widths, which only a crop explains."""
MAX_SHAPE_DIFFERENCE = 0.02
"""Relative difference of two ratios of width to height up to which they are the same."""


@dataclass(frozen=True, slots=True)
class CameraDoubt:
    """half_vector_sd: (H, W) radians per axis, what the unknown camera may cost; warnings."""

    half_vector_sd: np.ndarray
    warnings: Sequence[StageWarning] = ()


def with_camera_of_spheres(
    geometry: CaptureGeometry, by_sphere: Sequence[Lights], measured: DistanceResult
) -> tuple[DistanceResult, Mapping[str, Any] | None]:
    """Return the lights in doubt by the view vectors if several spheres show a near camera whose matrix is not given.

    With them the record of the camera: None if its matrix is given or spheres measured it, else the least focal length
    in pixels that is to be expected, which only the object can exclude.

    by_sphere: lights of each sphere; measured: those of all.
    """
    if geometry.camera is not None:
        return measured, None
    width, _ = geometry.frame_size
    centre = unknown_camera(geometry).centre
    focal = focal_length_of_parallax([lights.half_vectors for lights in by_sphere], geometry.spheres, centre)
    if focal == np.inf:
        return measured, None
    if focal is None:
        # Light and camera stand on the same side of the object: a camera may be as near as a light that is near.
        light = np.inf if measured.near is None else median_distance(measured.near.inverse_distance)
        return measured, {"least_focal": min(LEAST_FOCAL_WIDTHS * width, light), "is_light_near": light < np.inf}
    error = unknown_camera_error(region_pixels(geometry), geometry.spheres, centre, focal)
    evidence = "the spheres show the light in directions that only a near camera explains"
    warning = _near_camera(evidence, geometry, focal, _cost_deg(error))
    return replace(measured, errors=[*measured.errors, error], warnings=[*measured.warnings, warning]), None


def doubt_camera(
    geometry: CaptureGeometry, record: Mapping[str, Any], normals: np.ndarray, spheres_sd: float
) -> CameraDoubt:
    """Return the doubt that remains of an unknown camera after the object's normals have spoken.

    Args:
        geometry: of the capture.
        record: of the camera, by the stage of the lights.
        normals: (H, W, 3), accepted ones, NaN elsewhere.
        spheres_sd: radians per axis, what the spheres' fits leave uncertain in the half vectors.
    """
    width, _ = geometry.frame_size
    camera = unknown_camera(geometry)
    estimate = focal_length_of_normals(normals, camera)
    expected = 1.0 / float(record["least_focal"])
    square, is_seen = expected**2, False
    if estimate is not None:
        deviation = _estimate_sd(estimate, width)
        is_seen = estimate.value > MIN_DEVIATIONS * float(np.hypot(deviation, _sphere_sd(camera, spheres_sd)))
        square = estimate.value**2 + deviation**2 if is_seen else _mean_square(estimate.value, deviation, expected)
    focal = 1.0 / float(np.sqrt(square))
    error = unknown_camera_error(region_pixels(geometry), geometry.spheres, camera.centre, focal)
    cost = _cost_deg(error)
    if cost < (MIN_CAMERA_COST_DEG if is_seen else MIN_UNKNOWN_COST_DEG):
        return CameraDoubt(error)
    if is_seen and estimate is not None:
        evidence = "only under a near camera are the object's normals those of a surface"
        return CameraDoubt(error, [_near_camera(evidence, geometry, 1.0 / estimate.value, cost)])
    light = "the light was near, and " if record["is_light_near"] else ""
    message = (
        f"{light}neither the single sphere nor the object's normals exclude a camera as near, with a focal length of"
        f" some {focal:.0f} pixels: give the camera's matrix (`camera`), also of a long lens, or use two spheres"
    )
    return CameraDoubt(error, [StageWarning(message, "camera", cost)])


def doubt_given_camera(geometry: CaptureGeometry, normals: np.ndarray, spheres_sd: float) -> CameraDoubt:
    """Return the doubt about a camera whose matrix is given: the object's normals contradict its focal length, or its
    principal point lies where only a crop explains it, and they do not confirm the focal length.

    For the arguments see `doubt_camera`; geometry: with the camera.
    """
    width, _ = geometry.frame_size
    matrix = geometry.camera
    assert matrix is not None
    camera = replace(unknown_camera(geometry), principal_point=(float(matrix[0, 2]), float(matrix[1, 2])))
    estimate = focal_length_of_normals(_orthographic_normals(normals, geometry, camera), camera)
    given, is_confirmed = 1.0 / areal_focal_length(matrix), False
    if estimate is not None:
        limit = CONTRADICTED_DEVIATIONS * float(np.hypot(_estimate_sd(estimate, width), _sphere_sd(camera, spheres_sd)))
        difference = abs(estimate.value - given)
        if difference > limit:
            pixels, centre = region_pixels(geometry), camera.centre
            error = unknown_camera_error(pixels, geometry.spheres, centre, 1.0 / difference)
            return CameraDoubt(error, [_contradicted(1.0 / given, estimate.value, limit, _cost_deg(error))])
        is_confirmed = estimate.value > limit
    centre_x, centre_y = unknown_camera(geometry).centre
    offset = float(np.hypot(camera.centre[0] - centre_x, camera.centre[1] - centre_y))
    if is_confirmed or offset <= MAX_CENTRE_OFFSET * width:
        return CameraDoubt(np.zeros(normals.shape[:2], np.float32))
    # With the principal point of another resolution, all that is measured turns about the camera.
    turn = float(np.arctan(offset * given))
    message = (
        f"the camera's principal point ({camera.centre[0]:g}, {camera.centre[1]:g}) is {offset:.0f} pixels beside the"
        f" middle of the frame, as after a crop{_other_resolution(camera)}, and the object's normals do not confirm the"
        f" focal length of {1.0 / given:.0f} pixels: check that `camera` is the matrix of this resolution"
    )
    error = np.full(normals.shape[:2], turn / np.sqrt(2.0), np.float32)
    return CameraDoubt(error, [StageWarning(message, "camera", float(np.degrees(turn)))])


def _other_resolution(camera: UnknownCamera) -> str:
    """Return words on the picture whose middle the principal point is, if that has the shape of the frame."""
    width, height = (2.0 * coordinate + 1.0 for coordinate in camera.centre)
    if min(width, height) <= 0.0 or abs(width * camera.height / (height * camera.width) - 1.0) > MAX_SHAPE_DIFFERENCE:
        return ""
    return f" or in a picture of {width:.0f} x {height:.0f} pixels (times {camera.width / width:.4g})"


def _orthographic_normals(normals: np.ndarray, geometry: CaptureGeometry, camera: UnknownCamera) -> np.ndarray:
    """Return what normals (H, W, 3) that were measured by the camera's matrix would be under an orthographic camera."""
    matrix, region = geometry.camera, geometry.region
    assert matrix is not None
    lights = lights_of(half_vectors_on_axis(normals, view_vectors(matrix, normals.shape[:2], region.x, region.y)))
    of_spheres = view_vectors(matrix, (1, 1), camera.sphere_x, camera.sphere_y)
    return half_vectors_of(rotate_to_view(lights, np.broadcast_to(of_spheres, lights.shape)))


def _contradicted(given: float, inverse: float, limit: float, cost_deg: float) -> StageWarning:
    """Return the warning that normals contradict a given focal length in pixels; inverse: what they show, 1/pixels."""
    shown = f"of some {1.0 / inverse:.0f} pixels" if inverse > limit else "of a distant camera"
    message = (
        f"under the given camera, with a focal length of {given:.0f} pixels, the object's normals are not those of a"
        f" surface; they are with that {shown}: check that `camera` is the matrix of this lens and of this resolution"
    )
    return StageWarning(message, "camera", cost_deg)


def _estimate_sd(estimate: InverseFocal, width: int) -> float:
    """Return the standard deviation of an inverse focal length by the normals, 1/pixels."""
    parts = [estimate.deviation, NORMALS_ERROR_WIDTHS / width, NORMALS_RELATIVE_ERROR * estimate.value]
    return float(np.linalg.norm(parts))


def _sphere_sd(camera: UnknownCamera, spheres_sd: float) -> float:
    """Return what misplaced spheres add to it, 1/pixels.

    A half vector turns by half the angle between the sphere and the optical axis.
    """
    offset = float(np.hypot(camera.sphere_x - camera.centre[0], camera.sphere_y - camera.centre[1]))
    return 2.0 * spheres_sd / max(offset, 1.0)


def _mean_square(value: float, deviation: float, expected: float) -> float:
    """Return the mean square of an inverse focal length by an estimate, its standard deviation and what is expected.

    The prior is half a normal distribution about a distant camera: no inverse focal length is negative, so an estimate
    that is shows an error of its own size.
    """
    deviation = max(deviation, -value)
    share = expected**2 / (expected**2 + deviation**2)
    mean, spread = share * value, float(np.sqrt(share)) * deviation
    # Second moment of the normal distribution of the posterior where it is positive.
    ratio = mean / spread
    density = float(np.exp(-0.5 * ratio**2 - log_ndtr(ratio)) / np.sqrt(2.0 * np.pi))
    return spread**2 * (1.0 + ratio**2 + ratio * density)


def unknown_camera(geometry: CaptureGeometry) -> UnknownCamera:
    """Return what is known of the camera of a capture without its matrix."""
    width, height = geometry.frame_size
    x, y = np.mean([(sphere.x, sphere.y) for sphere in geometry.spheres], axis=0)
    return UnknownCamera(geometry.region.x, geometry.region.y, float(x), float(y), width, height)


def _near_camera(evidence: str, geometry: CaptureGeometry, focal: float, cost_deg: float) -> StageWarning:
    """Return the warning of a near camera whose focal length in pixels was measured."""
    x, y = unknown_camera(geometry).centre
    matrix = f"[[{focal:.0f}, 0, {x:g}], [0, {focal:.0f}, {y:g}], [0, 0, 1]]"
    message = (
        f"{evidence}, with a focal length of some {focal:.0f} pixels: give the camera's matrix, about"
        f" `camera: {{matrix: {matrix}}}`, or record from farther away with a longer lens"
    )
    return StageWarning(message, "camera", cost_deg)


def _cost_deg(error: np.ndarray) -> float:
    """Return the usual size in degrees of an error (H, W) per axis, radians."""
    return float(np.degrees(np.sqrt(2.0) * np.median(error)))
