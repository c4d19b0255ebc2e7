"""The centre of a contour from the edges of single rays, with those left out that lie elsewhere than the rest.

A circle's score is the mean evidence of all rays, and evidence is as wide as the distance over which levels change.
Where the rim mirrors the object, the strongest change lies inside the contour on a whole arc, and draws the best circle
to the other side. The positions of the edges themselves are sharper, and Tukey's biweight (Huber 1981) leaves such an
arc out.
"""

import numpy as np

from glint.tasks.algorithms.lighting.circles import EdgeEvidence

REACH_RATIO = 0.035
"""Distance from the contour within which a ray's edge is sought, in radii."""
MIN_EVIDENCE = 0.15
"""Evidence below which a ray shows no edge."""
CUTOFF_RATIO = 0.02
"""Distance from the circle, in radii, from which an edge does not count: single rays are off by 0.7% where nothing
disturbs them."""
MIN_WEIGHT = 12.0
"""Sum of the weights, of at most one per ray, below which the rays determine no centre."""
MAX_ROUNDS = 30


def edge_radii(evidence: EdgeEvidence, x: float, y: float, radius: float) -> np.ndarray:
    """Return the distance (A,) of each ray's strongest edge from (x, y), in pixels, near a circle; NaN without one."""
    moved = evidence.moved(x - evidence.x, y - evidence.y)
    radii = moved.start + moved.spacing * np.arange(moved.evidence.shape[1])
    near = np.flatnonzero(np.abs(radii - radius) < REACH_RATIO * radius)
    rays = np.arange(len(moved.angles))
    if len(near) < 3:
        return np.full(len(rays), np.nan)
    strongest = moved.evidence[:, near].argmax(axis=1)
    # The vertex of the parabola through three samples; the ends of the range are no maxima.
    index = near[np.clip(strongest, 1, len(near) - 2)]
    before, peak, after = (moved.evidence[rays, index + step].astype(float) for step in (-1, 0, 1))
    curvature = before - 2.0 * peak + after
    is_edge = (strongest > 0) & (strongest < len(near) - 1) & (peak > MIN_EVIDENCE) & (curvature < 0.0)
    offset = 0.5 * (before - after) / np.where(is_edge, curvature, 1.0)
    return np.where(is_edge, radii[index] + offset * moved.spacing, np.nan)


def centre_offset(evidence: EdgeEvidence, x: float, y: float, radius: float) -> np.ndarray:
    """Return the offset (2,) in pixels, x and y, of the circle through the rays' edges from a circle near them.

    Zero if too few edges agree.
    """
    positions = edge_radii(evidence, x, y, radius)
    known = np.isfinite(positions)
    if known.sum() < MIN_WEIGHT:
        return np.zeros(2)
    angles = evidence.angles[known]
    # To first order an offset (x, y) and a larger radius move the contour along a ray by these.
    design = np.stack([np.cos(angles), np.sin(angles), np.ones(len(angles))], axis=1)
    excess = positions[known] - radius
    circle = np.array([0.0, 0.0, np.median(excess)])
    for _ in range(MAX_ROUNDS):
        residual = (excess - design @ circle) / (CUTOFF_RATIO * radius)
        weight = np.where(np.abs(residual) < 1.0, (1.0 - residual**2) ** 2, 0.0)
        if weight.sum() < MIN_WEIGHT:
            return np.zeros(2)
        root = np.sqrt(weight)
        circle = np.linalg.lstsq(design * root[:, None], excess * root, rcond=None)[0]
    return circle[:2]
