"""Camera poses of a simulated object's views, and the turntable angles that its catalogue states.

Synthetic: a turntable with optional errors, or free cameras; the paper has a single view (section 6 names several).
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from glint.tasks.algorithms.simulation.options import CaptureOptions

WRONG_VIEW_ERROR_DEG = 25.0
"""Amount by which the stated angle of `wrong_view` is too large."""
FREE_POSE_PITCH_DEG = (0.0, 32.0, -18.0, 16.0, -30.0)
"""Angles from which free cameras look down, in turn."""
FREE_POSE_SCALE = 0.8
"""Size of an object under free poses relative to one on a turntable, so that pitched views still fit their region."""


@dataclass(frozen=True, slots=True)
class CameraPose:
    """Pose of one view's camera relative to the upright object.

    A point X of the object's world (pixels; y up along its axis) is at `rotation` R_y(`turn`) X + (offset, 0, 0) in the
    camera frame.

    turn: true turntable angle in degrees.
    rotation: (3, 3), lean of the axis or pitch of a free camera.
    offset: pixels by which the axis stands to the right.
    nominal_angle: turntable angle in degrees as the catalogue states it.
    """

    turn: float
    rotation: np.ndarray
    offset: float
    nominal_angle: float


def camera_poses(options: CaptureOptions) -> list[CameraPose]:
    """Return the poses of all views, in order; errors of the stated angles are seeded by `options.seed`."""
    generator = np.random.default_rng([options.seed, 77])
    errors = generator.uniform(-options.angle_error, options.angle_error, options.views)
    if options.free_poses:
        pitches = [FREE_POSE_PITCH_DEG[view % len(FREE_POSE_PITCH_DEG)] for view in range(options.views)]
        leans = [Rotation.from_euler("x", pitch, degrees=True) for pitch in pitches]
    else:
        lean = np.array([np.sqrt(4 / 13), np.sqrt(9 / 13)]) * options.axis_lean
        leans = [Rotation.from_euler("zx", [-lean[1], lean[0]], degrees=True)] * options.views
    poses = []
    for view in range(options.views):
        turn = 360.0 * view / options.views
        wrong = WRONG_VIEW_ERROR_DEG if view == options.wrong_view else 0.0
        nominal = float(np.round((turn - errors[view] + wrong) % 360, 3))
        poses.append(CameraPose(turn, leans[view].as_matrix(), options.axis_offset, nominal))
    return poses
