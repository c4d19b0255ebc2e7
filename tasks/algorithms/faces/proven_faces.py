"""Flat faces that candidates prove, whatever labels accept: large, of one normal, and with edges that are rounded.

Seen through a face, those behind it look flat as well, and may lie nearer to the smooth field than the face itself. But
each of them fills a part of it only, and is cut off at its borders, where a true face is surrounded by the highlights
of its rounded edges.
"""

from collections.abc import Iterator

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.faces.creases import SILHOUETTE, face_edges
from glint.tasks.algorithms.faces.observed_faces import FACE_DEG, Face
from glint.tasks.algorithms.faces.rounded_edges import rounded_share, rounding_evidence
from glint.tasks.algorithms.geometry.connected_parts import largest_part
from glint.tasks.algorithms.geometry.convex_hull import convex_hull
from glint.tasks.algorithms.geometry.perspective import rotate_from_view, view_vectors
from glint.tasks.algorithms.geometry.vectors import angles, unit

NORMAL_CELL_DEG, PEAK_CELLS = 1.0, 3
"""Cells of the histogram of normals, in n_x and n_y, and how many of them to a side a peak is summed over."""
SOLID_WINDOW_PX, SOLID_SHARE = 5, 0.6
"""Side of the window in which this share of the pixels must have the face's normal, since lights leave gaps."""
MIN_PROVEN_SHARE = 0.08
"""Share of the mask of the smallest face; on prisms, false ones with rounded edges have 0.06 at most."""
PROVEN_ROUNDED_SHARE, MIN_PROVEN_INRADII = 0.7, 1.0
"""Share of a face's edges that must show their rounding, and their length in inradii: what is seen through curved glass
shows 0.56 of it at most, but for strips along a cylinder."""
MAX_INSIDE_SHARE = 0.8
"""Share of an edge inside of which candidates turn as its rounding does, beyond which the edge shows nothing: they are
those of a curved wall."""
MAX_PROVEN_SLANT_DEG = 40.0
"""Largest angle of a face to the view vector: the normals of more slanted ones, of which the lights reach one side
alone, are several degrees wrong."""
MAX_COVERED_SHARE = 0.25
"""Share of a face that may lie within a larger one: more of it is seen through that."""
PROVEN_NATS = 10.0
"""Evidence for the candidates of a proven face, and against all others within it."""


def face_evidence(
    candidates: np.ndarray, mask: np.ndarray, inradius: float, camera: np.ndarray | None = None
) -> np.ndarray:
    """Return the log-likelihood ratios (K, H, W), nats, of candidates by the flat faces that they prove.

    Args:
        candidates: (K, H, W, 3), relative to the view rays, NaN where there is none.
        mask: (H, W) bool.
        inradius: of the mask, in pixels.
        camera: (3, 3), the perspective camera's matrix in pixels of the mask; None for parallel rays.
    """
    if camera is not None:
        # A plane has one normal in the camera frame, and another relative to each ray.
        candidates = rotate_from_view(candidates, view_vectors(camera, mask.shape, 0.0, 0.0))
    evidence = np.zeros(candidates.shape[:3])
    for face in proven_faces(candidates, mask, inradius):
        belongs = angles(candidates[:, face.hull], face.normal) < FACE_DEG
        evidence[:, face.hull] = np.where(belongs, PROVEN_NATS, -PROVEN_NATS)
    return evidence


def proven_faces(candidates: np.ndarray, mask: np.ndarray, inradius: float) -> list[Face]:
    """Return the flat faces that candidates (K, H, W, 3), camera frame, prove, largest first.

    mask: (H, W) bool; inradius: of the mask, in pixels; see `face_evidence`.
    """
    proven: list[Face] = []
    taken = np.zeros_like(mask)
    for face in sorted(apparent_faces(candidates, mask), key=lambda face: -int(face.pixels.sum())):
        is_slanted = face.normal[2] < np.cos(np.radians(MAX_PROVEN_SLANT_DEG))
        if is_slanted or (face.pixels & taken).sum() > MAX_COVERED_SHARE * face.pixels.sum():
            continue
        edges = [
            edge
            for edge in face_edges([face], mask, inradius)
            if edge.behind != SILHOUETTE
            and not rounded_share(edge, face, candidates, inradius, is_inside=True) > MAX_INSIDE_SHARE
        ]
        share, length = rounding_evidence(edges, face, candidates, inradius)
        if share >= PROVEN_ROUNDED_SHARE and length >= MIN_PROVEN_INRADII * inradius:
            proven.append(face)
            taken |= face.hull
    return proven


def apparent_faces(candidates: np.ndarray, mask: np.ndarray) -> Iterator[Face]:
    """Yield connected regions of candidates (K, H, W, 3) in a mask (H, W) bool that share a normal: histogram peaks."""
    is_known = np.isfinite(candidates[..., 0]) & mask
    # Large objects have many million candidates: their pixels' numbers and cells take few bytes each.
    pixel = np.broadcast_to(np.arange(mask.size, dtype=np.int32).reshape(mask.shape), is_known.shape)[is_known]
    normals, least = candidates[is_known], MIN_PROVEN_SHARE * mask.sum()
    cells = np.floor(normals[:, :2] / np.sin(np.radians(NORMAL_CELL_DEG))).astype(np.int16)
    if not len(cells):
        return
    cells -= cells.min(axis=0)
    counts = np.zeros(cells.max(axis=0) + 1)
    np.add.at(counts, tuple(cells.T), 1.0)
    peaks = ndimage.uniform_filter(counts, PEAK_CELLS, mode="constant") * PEAK_CELLS**2
    while peaks.max() >= least:
        peak = np.array(np.unravel_index(int(peaks.argmax()), peaks.shape), np.int16)
        is_near = (np.abs(cells - peak) <= PEAK_CELLS // 2).all(axis=1)
        # Lights on either side of a face's normal show peaks beside one another, of which the largest region counts.
        peaks[tuple(slice(max(0, at - PEAK_CELLS // 2), at + PEAK_CELLS // 2 + 1) for at in peak)] = 0.0
        normal = unit(np.median(normals[is_near], axis=0))
        belongs = normals @ normal > np.cos(np.radians(FACE_DEG))
        region = np.zeros_like(mask)
        region.ravel()[pixel[belongs]] = True
        solid = largest_part((ndimage.uniform_filter(region.astype(float), SOLID_WINDOW_PX) > SOLID_SHARE) & mask)
        pixels = solid & region
        if pixels.sum() >= least:
            yield Face(normal, pixels, convex_hull(pixels) & mask)
