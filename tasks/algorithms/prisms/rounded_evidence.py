"""How much candidates speak for a right prism with rounded edges: whole faces that flashed, and highlights of edges.

Across a rounded edge the normal turns from that of one face to that of the other, and so the edges show the light where
neither face does. Light that crosses the glass shows such normals too, but anywhere: what counts is how many more of
them lie where the solid has them than beside.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numba import njit

from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.geometry.perspective import centred_view_vectors, rotate_from_view, rotate_to_view
from glint.tasks.algorithms.geometry.vectors import pixel_positions
from glint.tasks.algorithms.prior.swept_normals import SweptNormals
from glint.tasks.algorithms.prisms.prism_evidence import (
    FALSE_FACE_SHARE,
    FLASHED_DEG,
    PIECE_INRADII,
    STRAY_SHARE,
    share_log_ratio,
)
from glint.tasks.algorithms.prisms.rounded_prism import RoundedPrism, RoundedSurface

BESIDE_INRADII = 0.35
"""How far in inradii the normals of edges are moved to each side to see how many candidates have them by chance."""
ARC_WEIGHT = 1.0 / 3.0
"""Weight of a candidate's deviation along the arc over which the normal turns at an edge: whatever the edge's profile,
its normals are perpendicular to it, but few profiles are arcs of a circle."""
EDGE_REACH_PX = 1
"""Pixels by which the place of an edge may be off: across a sharp one, normals turn by much from pixel to pixel."""
STRAY_DEG = 6.0
"""Angle from a normal beyond which a candidate is no closer to it than a stray one."""
MIN_EDGE_PIXELS, MIN_FACE_PIXELS = 20, 30
"""Pixels of edges, and of a face's flat part, from which they are looked at."""
MIN_REACHED_SHARE = 0.9
"""Share of a face that the lights must have reached for its missing highlights to speak against it."""


@dataclass(frozen=True, eq=False)
class ShownCandidates:
    """Candidates of a view in which prisms are compared.

    layers: (H + 2, W + 2, K, 3) float32, in the camera frame, 0 where there is none, with a border of a pixel. mask:
    (H, W) bool. inverse_focal: 1 over the focal length in pixels, 0 for parallel rays. swept: normals that the lights
    reached, relative to the view rays.
    """

    layers: np.ndarray
    mask: np.ndarray
    inverse_focal: float
    swept: SweptNormals

    @classmethod
    def of(cls, candidates: np.ndarray, mask: np.ndarray, inverse_focal: float = 0.0) -> "ShownCandidates | None":
        """Return those of candidates (K, H, W, 3; NaN without), relative to the view rays, in a mask; None: none."""
        inside = np.where(mask[..., None], candidates, np.nan)
        swept = SweptNormals.of(inside)
        if swept is None:
            return None
        view = centred_view_vectors(mask.shape, inverse_focal)
        layers = np.moveaxis(np.nan_to_num(rotate_from_view(inside, view)), 0, 2)
        return cls(np.pad(layers, ((1, 1), (1, 1), (0, 0), (0, 0))).astype(np.float32), mask, inverse_focal, swept)

    @cached_property
    def inradius(self) -> float:
        """Inradius of the silhouette in pixels."""
        return inradius_of(self.mask)

    @cached_property
    def pixels(self) -> np.ndarray:
        """Rows and columns (M, 2) of the pixels in the mask."""
        return np.argwhere(self.mask)

    @cached_property
    def positions(self) -> tuple[np.ndarray, np.ndarray]:
        """Image positions x and y (M,) of these pixels."""
        return pixel_positions(self.mask)

    @cached_property
    def view(self) -> np.ndarray:
        """Unit view vectors (M, 3) of these pixels."""
        return centred_view_vectors(self.mask.shape, self.inverse_focal)[self.mask]

    def flashing(self, normals: np.ndarray) -> np.ndarray:
        """Return which of the normals (M, 3) of these pixels, camera frame, the lights reached; not those NaN."""
        return self.swept.flashes(rotate_to_view(normals, self.view))

    def deviations(self, pixels: np.ndarray, surface: RoundedSurface, reach: int) -> np.ndarray:
        """Return the degrees (M,) from a surface's normals to the nearest candidates of their pixels (N, 2).

        Those along the arc of an edge count less, see ARC_WEIGHT. Candidates of a pixel are those within `reach`
        pixels; where there are none, the result is infinite. Pixels beside the mask are left out.
        """
        rows, columns = pixels.T
        height, width = self.mask.shape
        is_inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
        is_inside[is_inside] = self.mask[rows[is_inside], columns[is_inside]]
        normals, edges = surface.normals[is_inside], surface.edges[is_inside]
        return _least_deviations(self.layers, pixels[is_inside], normals, edges, reach, ARC_WEIGHT)


def rounded_log_ratio(solid: RoundedPrism, shown: ShownCandidates, tolerance_deg: float = FLASHED_DEG) -> float:
    """Return the log-likelihood ratio, nats, of candidates with this prism against candidates of another solid.

    tolerance_deg: degrees from a normal of the prism within which a candidate has it.
    """
    surface = solid.surface(*shown.positions)
    lit, faces = shown.flashing(surface.normals), solid.flat_faces(surface.normals)
    ratio = _edges_log_ratio(lit & (faces < 0), surface, solid.radius, shown, tolerance_deg)
    return ratio + sum(
        _face_log_ratio(faces == number, lit, surface, shown, tolerance_deg)
        for number in range(len(solid.core.normals))
    )


def mean_deviation(solid: RoundedPrism, shown: ShownCandidates) -> float:
    """Return the mean deviation in degrees of the nearest candidates from the prism's normals that the lights reached.

    It counts as STRAY_DEG at most, since far candidates are false.
    """
    surface = solid.surface(*shown.positions)
    lit = shown.flashing(surface.normals)
    if not lit.any():
        return STRAY_DEG
    return float(np.minimum(shown.deviations(shown.pixels[lit], _at(surface, lit), 0), STRAY_DEG).mean())


def _at(surface: RoundedSurface, chosen: np.ndarray) -> RoundedSurface:
    """Return the surface at the chosen ones, (N,) bool, of its rays."""
    return RoundedSurface(*(values[chosen] for values in surface))


def _edges_log_ratio(
    edges: np.ndarray, surface: RoundedSurface, radius: float, shown: ShownCandidates, tolerance_deg: float
) -> float:
    """Return what edges (M,) bool that the lights reached say; radius: of the edges, pixels."""
    if edges.sum() < MIN_EDGE_PIXELS:
        return 0.0
    pixels, turned = shown.pixels[edges], _at(surface, edges)
    near = shown.deviations(pixels, turned, EDGE_REACH_PX) < tolerance_deg
    step = max(2, round(BESIDE_INRADII * shown.inradius))
    ways = step * np.array([way for way in product((-1, 0, 1), repeat=2) if way != (0, 0)])
    beside = [shown.deviations(pixels + way, turned, EDGE_REACH_PX) < tolerance_deg for way in ways]
    shares = [by_chance.mean() for by_chance in beside if by_chance.size]
    stray = float(np.clip(np.mean(shares) if shares else np.inf, *STRAY_SHARE))
    piece = PIECE_INRADII * shown.inradius
    pieces = edges.sum() / (piece * min(piece, max(radius, 1.0)))
    return float(share_log_ratio(near.mean(), stray) * pieces)


def _face_log_ratio(
    face: np.ndarray, lit: np.ndarray, surface: RoundedSurface, shown: ShownCandidates, tolerance_deg: float
) -> float:
    """Return what the flat part of a face, pixels (M,) bool, says; lit (M,) bool: what the lights reached."""
    if face.sum() < MIN_FACE_PIXELS:
        return 0.0
    flashed = shown.deviations(shown.pixels[face], _at(surface, face), 0) < tolerance_deg
    ratio = share_log_ratio(flashed.mean(), FALSE_FACE_SHARE)
    if ratio < 0.0 and lit[face].mean() < MIN_REACHED_SHARE:
        return 0.0
    return float(ratio * np.sqrt(face.sum()) / (PIECE_INRADII * shown.inradius))


@njit(cache=True)
def _least_deviations(
    layers: np.ndarray, pixels: np.ndarray, normals: np.ndarray, edges: np.ndarray, reach: int, arc_weight: float
) -> np.ndarray:
    """Return how many degrees (N,) the nearest candidates within `reach` pixels deviate from normals (N, 3).

    layers: (H + 2, W + 2, K, 3), see `ShownCandidates`. pixels: (N, 2), rows and columns. edges: (N, 3), unit, or 0.
    arc_weight: of the deviation across an edge, where the normal turns. Infinite without a candidate.
    """
    result = np.full(len(pixels), np.inf)
    for number in range(len(pixels)):
        normal, edge = normals[number], edges[number]
        weight = arc_weight if edge[0] != 0.0 or edge[1] != 0.0 or edge[2] != 0.0 else 1.0
        for row in range(pixels[number, 0] + 1 - reach, pixels[number, 0] + 2 + reach):
            for column in range(pixels[number, 1] + 1 - reach, pixels[number, 1] + 2 + reach):
                for layer in range(layers.shape[2]):
                    candidate = layers[row, column, layer]
                    if candidate[2] != 0.0:
                        cosine = candidate[0] * normal[0] + candidate[1] * normal[1] + candidate[2] * normal[2]
                        lean = candidate[0] * edge[0] + candidate[1] * edge[1] + candidate[2] * edge[2]
                        along = max(2.0 - 2.0 * cosine - lean * lean, 0.0)
                        result[number] = min(result[number], lean * lean + weight * weight * along)
    return np.degrees(np.sqrt(result))
