"""Rounded edges of flat faces: a true face is surrounded by highlights of its edges, a false one is cut off.

Light that crosses the glass can make an apparent face, whose pixels share a false candidate. Edges of real glass are
rounded: across an edge the normal turns from the face's own outwards, perpendicular to the crease, and is observed as
long as it stays within the observable range. The border of an apparent face is where a path is cut off, without that.
"""

import numpy as np

from glint.tasks.algorithms.faces.creases import Edge
from glint.tasks.algorithms.faces.observed_faces import Face
from glint.tasks.algorithms.geometry.vectors import angles

STRIP_INRADII, MIN_STRIP_PX = 0.12, 5
"""Width in inradii of the strip outside an edge in which its rounding is looked for, and at least, in pixels."""
MAX_CREASE_DEG = 4.0
"""Degrees from the perpendicular to the crease within which a candidate may belong to the rounded edge."""
MIN_ROUNDING_DEG = 4.0
"""Degrees by which such a candidate turns away from the face at least."""
TESTED_SHARES, MIN_TESTED_PLACES = (0.1, 0.9), 5
"""Part of an edge, as shares of the way along it, that is looked at, and the least number of places: one a pixel."""
TESTED_TURN_DEG, TESTED_SLANT_DEG = 10.0, 44.0
"""An edge is tested if a normal turned outwards by so many degrees is still within this angle of the view vector."""


def rounded_share(edge: Edge, face: Face, candidates: np.ndarray, inradius: float, *, is_inside: bool = False) -> float:
    """Return the share of an edge beside which candidates show its rounding; NaN where the light could not show it.

    candidates: (K, H, W, 3), NaN where there is none. inradius: of the mask, in pixels. is_inside: whether to look
    within the face instead, where a curved wall shows the same.
    """
    direction = edge.direction(face.normal)
    outward = np.cross(direction, face.normal)
    outward *= np.sign(outward[:2] @ edge.outward) or 1.0
    turned = np.cos(np.radians(TESTED_TURN_DEG)) * face.normal + np.sin(np.radians(TESTED_TURN_DEG)) * outward
    if turned[2] < np.cos(np.radians(TESTED_SLANT_DEG)):
        return float("nan")
    strip = max(MIN_STRIP_PX, round(STRIP_INRADII * inradius))
    distances = np.arange(-1, strip) if not is_inside else np.arange(-1 - strip, -1)
    rows, columns = edge.strip(np.linspace(*TESTED_SHARES, max(MIN_TESTED_PLACES, int(edge.length))), distances)
    height, width = candidates.shape[1:3]
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    normals = candidates[:, np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
    is_rounded = np.abs(normals @ direction) < np.sin(np.radians(MAX_CREASE_DEG))
    is_rounded &= (angles(normals, face.normal) > MIN_ROUNDING_DEG) & ((normals - face.normal) @ outward > 0) & inside
    return float(is_rounded.any(axis=(0, 2)).mean())


def rounding_evidence(edges: list[Edge], face: Face, candidates: np.ndarray, inradius: float) -> tuple[float, float]:
    """Return the share of a face's edges that show their rounding, by length, and the length that could, in pixels.

    For candidates and inradius see `rounded_share`.
    """
    shares = np.array([rounded_share(edge, face, candidates, inradius) for edge in edges])
    lengths = np.array([edge.length for edge in edges])
    tested = np.isfinite(shares)
    total = float(lengths[tested].sum())
    return (float(shares[tested] @ lengths[tested]) / total if total else float("nan")), total
