"""Where the cameras of a simulated object stand, and what the catalogue says of it."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from glint.tasks.algorithms.simulation.options import CaptureOptions

WRONG = 25.0
"""Degrees by which the angle of `wrong_view` is too large in the catalogue."""
ABOVE = (0.0, 32.0, -18.0, 16.0, -30.0)
"""Degrees from which free cameras look down, one after the other."""
ROOM = 0.8
"""Size of an object that is seen from above too, relative to one on a turntable."""


@dataclass(frozen=True, slots=True)
class Placement:
    """A view's camera. A point X of the upright object's world (pixels; y up, the axis through it) is at
    rotation (X turned by `turn` degrees) + (offset, 0, 0); `said`: the turntable's angle as the catalogue gives it."""

    turn: float
    rotation: np.ndarray
    offset: float
    said: float


def placements(options: CaptureOptions) -> list[Placement]:
    """The cameras of all views."""
    generator = np.random.default_rng([options.seed, 77])
    errors = generator.uniform(-options.angle_error, options.angle_error, options.views)
    if options.free_poses:
        leans = [Rotation.from_euler("x", ABOVE[view % len(ABOVE)], degrees=True) for view in range(options.views)]
    else:
        lean = np.array([np.sqrt(4 / 13), np.sqrt(9 / 13)]) * options.axis_lean
        leans = [Rotation.from_euler("zx", [-lean[1], lean[0]], degrees=True)] * options.views
    found = []
    for view in range(options.views):
        turn = 360.0 * view / options.views
        wrong = WRONG if view == options.wrong_view else 0.0
        said = turn - errors[view] + wrong
        found.append(Placement(turn, leans[view].as_matrix(), options.axis_offset, float(np.round(said % 360, 3))))
    return found
