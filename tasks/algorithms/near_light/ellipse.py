"""Whether all frames confirm that a sphere's contour is the ellipse that a near camera sees.

A near camera projects a sphere to an ellipse that is elongated towards the frame's centre (tangent cone: Hartley and
Zisserman 2004, 8.3). What the sphere mirrors beside its contour may look elongated as well, in any direction. So the
evidence of edges in all frames (`lighting/contour`) is compared along the ellipse, along the circle, and along ellipses
in the three directions that no camera explains.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import ndimage, special

from glint.tasks.algorithms.lighting.circles import EdgeEvidence
from glint.tasks.algorithms.lighting.contour import SCORE_DEVIATION, edge_evidence
from glint.tasks.algorithms.lighting.pyramid import log_frames
from glint.tasks.algorithms.lighting.spheres import Sphere

SMOOTHING_SAMPLES = 1.0
"""Standard deviation, in samples, by which the evidence is smoothed along the rays, so that moving it costs none."""
MEASURED_RATIOS = 0.85, 1.2
"""Radii, relative to the sphere's, between which its contour is looked for."""
CENTRE_OFFSETS = np.arange(-0.03, 0.0301, 0.0075)
"""Offsets of the contour's centre from the sphere's along each axis, in radii."""
MEAN_RADIUS_RATIOS = np.arange(0.96, 1.0401, 0.005)
"""Mean radii of the contour, in radii of the sphere."""
ELONGATION_SHARES = (0.25, 0.5, 0.75, 1.0, 1.25)
"""Elongations that are tried, as shares of the one in question, which is known to half of itself."""
MAX_CIRCLE_GAIN, MAX_CONTROL_GAIN = 0.3, 0.8
"""Log evidence by which the circle, and an ellipse in a direction that no camera explains, may exceed the ellipse: true
ellipses of near cameras lose 0.2 at most to them, false ones 0.3 to 1.5 to one of
them (`python -m tests.benchmarks.light_distance`)."""
CONTROL_TURNS = (np.pi / 2, np.pi / 4, -np.pi / 4)
"""Directions of the control's long axis, relative to the direction of the frame's centre."""


def is_confirmed_ellipse(
    frames: Sequence[np.ndarray] | np.ndarray, sphere: Sphere, frame_centre: tuple[float, float], focal: float
) -> bool:
    """Return whether the frames do not contradict the ellipse that a camera of a focal length sees.

    Args:
        frames: (T, h, w) around the sphere, in levels of 8 bits, under different lights.
        sphere: in these pixels.
        frame_centre: x and y of the full frame's centre in these pixels.
        focal: focal length in pixels.
    """
    low, high = (ratio * sphere.radius for ratio in MEASURED_RATIOS)
    evidence = edge_evidence(log_frames(frames), sphere.x, sphere.y, low, high)
    smooth = ndimage.gaussian_filter1d(evidence.evidence, SMOOTHING_SAMPLES, axis=1)
    evidence = replace(evidence, evidence=np.asarray(smooth, np.float32))
    right, down = frame_centre[0] - sphere.x, frame_centre[1] - sphere.y
    # The long half axis of a sphere at an angle from the axis exceeds the short one by 1 / cos.
    elongation = float(np.hypot(1.0, np.hypot(right, down) / focal)) - 1.0

    def gain(direction: float) -> float:
        """Return the log evidence of an ellipse in a direction (radians, y down), of any elongation tried."""
        return max(_log_evidence(evidence, sphere.radius, share * elongation, direction) for share in ELONGATION_SHARES)

    towards_centre = float(np.arctan2(down, right))
    ellipse, circle = gain(towards_centre), _log_evidence(evidence, sphere.radius, 0.0, 0.0)
    control = max(gain(towards_centre + turn) for turn in CONTROL_TURNS)
    return ellipse > max(circle - MAX_CIRCLE_GAIN, control - MAX_CONTROL_GAIN)


def _log_evidence(evidence: EdgeEvidence, radius: float, elongation: float, direction: float) -> float:
    """Return the log evidence of a contour whose half axes differ by `elongation` radii, over all centres and radii.

    direction: of the long axis, radians, y down.
    """
    bulges = 0.5 * elongation * radius * np.cos(2.0 * (evidence.angles - direction))
    samples = np.arange(evidence.evidence.shape[1])
    moved = [
        np.interp(samples + bulge / evidence.spacing, samples, row)
        for bulge, row in zip(bulges, evidence.evidence, strict=True)
    ]
    scores = replace(evidence, evidence=np.asarray(moved, np.float32)).scores(
        CENTRE_OFFSETS * radius, MEAN_RADIUS_RATIOS * radius
    )
    return float(special.logsumexp(scores / SCORE_DEVIATION))
