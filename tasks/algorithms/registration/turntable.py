"""Turntable calibration: its axis and its angles, from silhouettes and, once there is a model, from normals.

Camera calibration under circular motion by silhouette coherence (Hernandez, Schmitt and Cipolla, TPAMI 2007), solved by
nonlinear least squares with a robust loss. Silhouettes determine the axis to a tenth of a degree and of a pixel, and
the angles of bodies whose silhouette changes with the angle; normals determine the other angles. Priors hold the axis
upright and the angles near the given ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import theilslopes

from glint.tasks.algorithms.multiview.normal_fusion import FusedNormals
from glint.tasks.algorithms.multiview.view import View, rotation_about_y
from glint.tasks.algorithms.multiview.visual_hull import bounding_sphere
from glint.tasks.algorithms.registration.epipolar_tangency import DIFFERENCE_STEP, fit_silhouettes
from glint.tasks.algorithms.registration.normal_consistency import NormalConsistency, normal_consistency

LEANS_TO_CAMERA_DEG = (0.0, 25.0, -25.0)
"""Leans of the axis from which it is fitted first: cameras look down on turntables."""
ANGLE_ERROR_DEG, LEAN_ERROR_DEG = 1.0, 4.0
"""Standard deviation of the given angles, and of the axis from upright, in degrees."""
AXIS_ERRORS = np.array([np.inf, LEAN_ERROR_DEG, LEAN_ERROR_DEG])
"""Standard deviations of the axis's offset, which has no prior, and of its leans in degrees."""
STEP_ERROR = 0.02
"""Relative standard deviation of the turntable's step, where an error is sought that all given angles share."""
MIN_STEP_DEVIATIONS, MAX_STEP_DEVIATIONS = 1.5, 3.0
"""Corrections of the step beyond which it is wrong, in standard deviations of what single angles make of it: where only
these may be wrong, and where the step may."""


@dataclass(frozen=True, slots=True)
class Turntable:
    """A turntable's axis in the camera frame, and the angles of its K views.

    offset: world units from the camera's optical axis (orthographic: the frame's centre) to the axis, positive to the
    right; lean_to_camera, lean_right: degrees by which its upper end leans to the camera and to the right; angles: (K,)
    degrees. Of V >= K views of an object the first K stand on it; the others have poses of their own in the turntable's
    world.
    """

    offset: float
    lean_to_camera: float
    lean_right: float
    angles: np.ndarray

    def changed(self, changes: np.ndarray, offset_unit: float) -> "Turntable":
        """Return the turntable with changes (3 + K,) of its offset, in `offset_unit`, of its leans and its angles."""
        offset, to_camera, right = changes[:3].tolist()
        return Turntable(
            self.offset + offset * offset_unit,
            self.lean_to_camera + to_camera,
            self.lean_right + right,
            self.angles + changes[3:],
        )

    @property
    def lean(self) -> np.ndarray:
        """The rotation (3, 3) of the camera frame from an upright turntable to this one: about z, then about x."""
        right, to_camera = np.radians(-self.lean_right), np.radians(self.lean_to_camera)
        cos_right, sin_right = np.cos(right), np.sin(right)
        cos_camera, sin_camera = np.cos(to_camera), np.sin(to_camera)
        return np.array(
            [
                [cos_right, -sin_right, 0.0],
                [cos_camera * sin_right, cos_camera * cos_right, -sin_camera],
                [sin_camera * sin_right, sin_camera * cos_right, cos_camera],
            ]
        )

    def pose(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation (3, 3) and translation (3,), world to camera, of view `number`."""
        return self.lean @ rotation_about_y(float(self.angles[number])), np.array([self.offset, 0.0, 0.0])


def wrapped(degrees: np.ndarray) -> np.ndarray:
    """Return angles (...) in -180..180 degrees."""
    return (degrees + 180.0) % 360.0 - 180.0


def relative_turns(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return by how many degrees each angle (K,) changes, less the turn of the whole turntable: their median."""
    turns = wrapped(after - before)
    return np.asarray(turns - np.median(turns))


def initial_turntable(views: Sequence[View], angles: Sequence[float]) -> Turntable:
    """Estimate an upright turntable from the silhouettes' centre columns at the given angles (degrees).

    The centre of a silhouette is the axis plus the odd harmonics of the object's width function. These cancel over a
    full turn; the first and third are fitted if there are enough views.
    """
    centres, radians = [], np.radians(np.asarray(angles, float))
    for view in views:
        columns = np.flatnonzero(view.mask.any(axis=0)) + view.origin[0]
        optical_axis = (view.frame[0] - 1) / 2 if view.matrix is None else float(view.matrix[0, 2])
        centres.append(((columns[0] + columns[-1]) / 2 - optical_axis) * view.pixel_size)
    terms = [np.ones(len(radians))]
    for harmonic in (1, 3):
        if len(radians) >= len(terms) + 3:
            terms += [np.cos(harmonic * radians), np.sin(harmonic * radians)]
    coefficients = np.linalg.lstsq(np.stack(terms, axis=1), np.array(centres), rcond=None)[0]
    return Turntable(float(coefficients[0]), 0.0, 0.0, np.asarray(angles, float))


def views_on_turntable(views: Sequence[View], table: Turntable) -> list[View]:
    """Return V views, the first K with the poses of a turntable; a perspective camera keeps its distance from the axis.

    The others, whose poses are given, stay where they are.
    """
    posed = []
    for number, view in enumerate(views):
        if number >= len(table.angles):
            posed.append(view)
            continue
        rotation, translation = table.pose(number)
        posed.append(view.with_pose(rotation, translation + np.array([0.0, 0.0, view.translation[2]])))
    return posed


def calibrate_axis(views: Sequence[View], start: Turntable, leans: Sequence[float] = (0.0,)) -> Turntable:
    """Fit the axis to the views' silhouettes; the angles stay as they are.

    leans: degrees by which the axis leans more to the camera than at the start, from each of which it is fitted; the
    best fit is returned. Few views nearly agree at the opposite lean too.
    """
    held = np.zeros((0, len(start.angles))), np.zeros(0)
    starts = [replace(start, lean_to_camera=start.lean_to_camera + lean) for lean in leans]
    fits = [_calibrate(views, table, start.angles, None, *held) for table in starts]
    return min(fits, key=lambda fit: fit[1])[0]


def calibrate_turntable(
    views: Sequence[View],
    start: Turntable,
    given_angles: np.ndarray,
    angle_errors: np.ndarray,
    normals: NormalConsistency | None = None,
    step_error: float = 0.0,
) -> tuple[Turntable, float]:
    """Fit axis and angles to the views' silhouettes, and to their normals' consistency as measured at the start.

    given_angles (K,): degrees, expected to be right within `angle_errors` (K,), and their step within the share
    `step_error`; if all views stand on the turntable, their weighted mean is kept, since turning all views together
    changes nothing. The cost of the fit, in nats, is returned beside it.
    """
    turned = given_angles - given_angles.mean()
    covariance = np.diag(angle_errors**2) + step_error**2 * np.outer(turned, turned)
    variances, directions = np.linalg.eigh(covariance)
    solved, cost = _calibrate(views, start, given_angles, normals, directions.T, 1.0 / np.sqrt(variances))
    if len(views) > len(given_angles):
        return solved, cost
    turn_of_all = np.average(solved.angles - given_angles, weights=angle_errors**-2.0)
    return replace(solved, angles=solved.angles - turn_of_all), cost


def step_factor(views: Sequence[View], start: Turntable, given_angles: np.ndarray, angle_errors: np.ndarray) -> float:
    """Return the factor of the given angles (K,), degrees, by which the silhouettes correct their step; 1 if none.

    angle_errors: as of `calibrate_turntable`.
    """
    if len(given_angles) < 3:
        return 1.0
    slope = 0.0
    # Few silhouettes hardly hold the step: it must deviate even where single angles alone may be wrong.
    for step_error, least in ((0.0, MIN_STEP_DEVIATIONS), (STEP_ERROR, MAX_STEP_DEVIATIONS)):
        solved, _ = calibrate_turntable(views, start, given_angles, angle_errors, step_error=step_error)
        change = relative_turns(given_angles, solved.angles)
        # The median slope (Theil and Sen) hardly follows a single wrong angle, and does not explain the others then.
        slope, level = map(float, theilslopes(change, given_angles)[:2])
        if abs(slope) * np.sqrt(len(given_angles)) * given_angles.std() < least * ANGLE_ERROR_DEG:
            return 1.0
    left = np.median(np.abs(change - level - slope * given_angles))
    return 1.0 + slope if left < np.median(np.abs(change)) / 2 else 1.0


def turntable_consistency(
    views: Sequence[View], table: Turntable, vertices: np.ndarray, fused: FusedNormals
) -> NormalConsistency:
    """Measure how the normals of the views agree at the vertices (N, 3) of a model, by the turntable's angles."""
    forward, backward = (
        views_on_turntable(views, replace(table, angles=table.angles + sign * DIFFERENCE_STEP)) for sign in (1.0, -1.0)
    )
    turned = [(ahead, behind, 2.0 * DIFFERENCE_STEP) for ahead, behind in zip(forward, backward, strict=True)]
    return normal_consistency(views, turned, vertices, fused)


def _calibrate(
    views: Sequence[View],
    start: Turntable,
    given_angles: np.ndarray,
    normals: NormalConsistency | None,
    free: np.ndarray,
    precision: np.ndarray,
) -> tuple[Turntable, float]:
    """Return the least-squares solution for the changes of offset, leans and angles from the start, and its cost.

    free (F, K): the directions in which the angles may change; precision (F,): the inverse standard deviations, per
    degree, of these changes.
    """
    # The offset is counted in percent of the object's size, so that all unknowns have a similar scale.
    percent = max(float(np.hypot(*view.mask.shape)) * view.pixel_size for view in views) / 100
    centre = bounding_sphere(views)[0][None]
    pixel_sizes = np.array([view.footprint(centre)[0] for view in views])
    on_table = len(start.angles)
    matrix, vector = (np.zeros((0, on_table)), np.zeros(0)) if normals is None else normals.residuals()
    # Views with a pose of their own do not turn.
    matrix = matrix[:, :on_table]
    prior_weight = np.concatenate([1.0 / AXIS_ERRORS, precision])
    prior_mean = np.concatenate([[0.0, -start.lean_to_camera, -start.lean_right], free @ (given_angles - start.angles)])

    def turntable(unknowns: np.ndarray) -> Turntable:
        return start.changed(np.append(unknowns[:3], unknowns[3:] @ free), percent)

    def views_at(unknowns: np.ndarray) -> list[View]:
        return views_on_turntable(views, turntable(unknowns))

    def further_residuals(unknowns: np.ndarray) -> np.ndarray:
        return np.concatenate([prior_weight * (unknowns - prior_mean), matrix @ (unknowns[3:] @ free) + vector])

    normal_rows = np.hstack([np.zeros((len(matrix), 3)), matrix @ free.T])
    # An angle that is loosely held may need a large step.
    scales = np.concatenate([np.ones(len(AXIS_ERRORS)), 1.0 / precision])
    unknowns, cost = fit_silhouettes(
        views_at, scales, pixel_sizes, further_residuals, np.vstack([np.diag(prior_weight), normal_rows])
    )
    return turntable(unknowns), cost
