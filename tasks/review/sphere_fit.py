"""The answer to a sphere that a person draws: where its contour is seen near there, and by how much it misses."""

from dataclasses import dataclass

from glint.storage.inputs.masks_and_truth import camera_matrix
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.sphere_checks.given_circle import confirm_sphere
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.review.pictures import first_frame, frame_sample
from glint.tasks.stages.frame_parts import check_camera, check_spheres


@dataclass(frozen=True, slots=True)
class SphereFit:
    """x, y, radius: of the fitted contour, pixels of the full frame; contrast: of the contour, 0 to 1; is_clear: it is
    seen; is_corrected: a run would use the fit instead of what was drawn, unless the highlights' shapes contradict it;
    misfit_px, misfit_radius_px: distance of the centres and difference of the radii, in pixels; centre_sd, radius_sd:
    standard deviations of the fit, in pixels."""

    x: float
    y: float
    radius: float
    contrast: float
    is_clear: bool
    is_corrected: bool
    misfit_px: float
    misfit_radius_px: float
    centre_sd: float
    radius_sd: float


def fit_sphere(context: CaptureContext, x: float, y: float, radius: float) -> SphereFit:
    """Measure the sphere near a drawn circle, in pixels of the full frame, by its contour alone.

    The survey measures a given one likewise, before it compares it with the highlights' shapes.

    Raises:
        InputError: the circle leaves the frame, as that of no capture that is run may; the camera's matrix is not in
            pixels; or the video cannot be read.
    """
    drawn, size = Sphere(x, y, radius), first_frame(context).shape
    check_spheres([drawn], size)
    check_camera(context.capture.camera, size)
    confirmed = confirm_sphere(frame_sample(context), drawn, camera=camera_matrix(context.capture.camera))
    fit = confirmed.fit
    return SphereFit(
        fit.x,
        fit.y,
        fit.radius,
        fit.score,
        confirmed.is_clear,
        confirmed.is_corrected,
        drawn.distance(fit),
        abs(radius - fit.radius),
        fit.centre_sd,
        fit.radius_sd,
    )
