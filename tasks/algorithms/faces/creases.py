"""Creases: the straight edges of flat faces, what lies behind each, and whether two faces meet as their normals say.

Where two planes meet, the gradients of their depths differ by a vector perpendicular to the image of the crease, since
the depth along it is the same on both (Mackworth 1973). That tests two faces that were observed, and restricts a face
that never showed the light to the normals perpendicular to its creases.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from glint.tasks.algorithms.faces.observed_faces import Face
from glint.tasks.algorithms.geometry.vectors import angles, gradients, unit

CORNER_INRADII, MIN_CORNER_PX = 0.03, 1.5
"""Deviation of a polygon from a face's contour, in inradii, and at least, in pixels."""
MIN_EDGE_INRADII = 0.15
"""Length in inradii of the shortest edge that is used."""
GAP_INRADII = 0.25
"""Distance in inradii over which an edge may be rounded: what is nearer to it lies behind the crease."""
INNER_SHARES = (0.15, 0.85)
"""Part of an edge, as shares of the way along it, beside which is looked what lies behind: ends are rounded corners."""
EDGE_SAMPLES = 21
"""Places in this part that are looked at."""
BEHIND_SHARE = 0.6
"""Share of an edge behind which one and the same thing must lie."""
SILHOUETTE, UNSEEN = -1, -2
"""What lies behind an edge if it is no face: nothing, or a part of the object without a face."""
DEFAULT_ROUNDING_INRADII = 0.05
"""Radius in inradii of rounded edges where no crease between two faces shows it."""
MIN_NORMAL_STEP = 0.1
"""Least change of the normal's image component across a crease that is divided by: flat creases are noisy."""
EDGE_ERROR_PX, NORMAL_ERROR_DEG = 1.0, 1.5
"""Standard deviations of an edge's ends, and of a face's normal by the sparse lights."""


def image_points(pixels: np.ndarray) -> np.ndarray:
    """Return the positions (N, 2) of the set pixels (H, W) bool, x and y in pixels, y upwards, in the order of rows."""
    return np.argwhere(pixels)[:, ::-1] * np.array([1.0, -1.0])


def strip_pixels(
    start: np.ndarray, end: np.ndarray, outward: np.ndarray, along: np.ndarray, distances: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns (A, D) of the pixels beside an edge; they may lie outside the image.

    start, end, outward (2,): see `Edge`. along (A,): shares of the way from start to end; distances (D,): outwards, in
    pixels.
    """
    points = start + along[:, None, None] * (end - start) + distances[None, :, None] * outward
    return np.round(-points[..., 1]).astype(int), np.round(points[..., 0]).astype(int)


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """A straight edge of a face.

    face: number of the face; start, end (2,): x and y in pixels, y upwards; outward (2,): unit vector away from the
    face; behind: number of the face behind it, SILHOUETTE or UNSEEN.
    """

    face: int
    start: np.ndarray
    end: np.ndarray
    outward: np.ndarray
    behind: int

    @property
    def length(self) -> float:
        """Length in pixels."""
        return float(np.linalg.norm(self.end - self.start))

    def strip(self, along: np.ndarray, distances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return rows and columns (A, D) of the pixels beside it; along (A,), distances (D,): see `strip_pixels`."""
        return strip_pixels(self.start, self.end, self.outward, along, distances)

    def direction(self, normal: np.ndarray) -> np.ndarray:
        """Return the unit direction (3,) of the crease on a face with this unit normal (3,)."""
        return crease_direction(self.end - self.start, normal)


def face_edges(faces: list[Face], mask: np.ndarray, inradius: float) -> list[Edge]:
    """Return the straight edges of faces.

    mask: (H, W) bool; inradius: of the mask, in pixels.
    """
    owner = np.where(mask, UNSEEN, SILHOUETTE)
    for number, face in reversed(list(enumerate(faces))):
        owner[face.hull] = number
    edges = []
    for number, face in enumerate(faces):
        contour = max(
            cv2.findContours(face.hull.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0], key=len
        )
        corners = cv2.approxPolyDP(contour, max(CORNER_INRADII * inradius, MIN_CORNER_PX), closed=True)[:, 0]
        points = corners * np.array([1.0, -1.0])
        centre = points.mean(axis=0)
        for start, end in zip(points, np.roll(points, -1, axis=0), strict=True):
            along = end - start
            if np.linalg.norm(along) < MIN_EDGE_INRADII * inradius:
                continue
            outward = np.array([along[1], -along[0]]) / np.linalg.norm(along)
            outward *= np.sign(outward @ (start - centre)) or 1.0
            edges.append(Edge(number, start, end, outward, _behind(start, end, outward, number, owner, inradius)))
    return edges


def _behind(
    start: np.ndarray, end: np.ndarray, outward: np.ndarray, number: int, owner: np.ndarray, inradius: float
) -> int:
    """Return what lies behind an edge of face `number`; owner (H, W): number of the face at each pixel, or its code."""
    gap = max(3, round(GAP_INRADII * inradius))
    rows, columns = strip_pixels(start, end, outward, np.linspace(*INNER_SHARES, EDGE_SAMPLES), np.arange(1, gap + 1))
    inside = (columns >= 0) & (columns < owner.shape[1]) & (rows >= 0) & (rows < owner.shape[0])
    codes = np.where(inside, owner[np.clip(rows, 0, owner.shape[0] - 1), np.clip(columns, 0, owner.shape[1] - 1)], -1)
    # The first thing on the way outwards that is neither the face itself nor without a face.
    is_other = (codes != UNSEEN) & (codes != number)
    first = np.where(is_other.any(axis=1), codes[np.arange(len(codes)), is_other.argmax(axis=1)], UNSEEN)
    values, counts = np.unique(first, return_counts=True)
    return int(values[counts.argmax()]) if counts.max() >= BEHIND_SHARE * len(first) else UNSEEN


def crease_direction(along: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return the unit direction (3,) of a crease with image direction `along` (2,) on a face with this normal (3,)."""
    p, q = gradients(normal)
    return unit(np.array([along[0], along[1], p * along[0] + q * along[1]]))


def creases(edges: list[Edge]) -> dict[tuple[int, int], np.ndarray]:
    """Return the image direction (2,) of the crease between each pair of faces, as long as their edges together."""
    result: dict[tuple[int, int], np.ndarray] = {}
    for edge in edges:
        if edge.behind >= 0:
            pair = (min(edge.face, edge.behind), max(edge.face, edge.behind))
            along = edge.end - edge.start
            total = result.get(pair, np.zeros(2))
            result[pair] = total + (along if along @ total >= 0 else -along)
    return result


def crease_residual(along: np.ndarray, first: np.ndarray, second: np.ndarray) -> float:
    """Return by how many standard deviations a crease differs from where two planes meet.

    along: its image direction (2,), as long as the edges that show it; first, second: unit normals (3,).
    """
    difference = np.subtract(gradients(first), gradients(second))
    length = float(np.linalg.norm(along))
    sine = abs(float(difference @ along)) / max(float(np.linalg.norm(difference)) * length, 1e-9)
    turn = max(float(angles(first, second)), NORMAL_ERROR_DEG)
    deviation = np.hypot(np.sqrt(2.0) * EDGE_ERROR_PX / length, np.sqrt(2.0) * NORMAL_ERROR_DEG / turn)
    return float(np.arcsin(min(sine, 1.0)) / deviation)


@dataclass(frozen=True, slots=True)
class ObservedFaces:
    """Flat faces that showed the light, their straight edges, and the radius in pixels with which these are rounded."""

    faces: list[Face]
    edges: list[Edge]
    rounding: float

    @classmethod
    def of(cls, faces: list[Face], mask: np.ndarray, inradius: float) -> "ObservedFaces":
        """Return faces with their edges; mask: (H, W) bool; inradius: of the mask, in pixels."""
        edges = face_edges(faces, mask, inradius)
        return cls(faces, edges, rounding_radius(edges, faces, inradius))


def rounding_radius(edges: list[Edge], faces: list[Face], inradius: float) -> float:
    """Return the radius in pixels with which edges are rounded: the median of those between observed faces.

    Across an edge of radius r the normal's image component grows by 1 in r pixels, and so fills the gap between faces.
    """
    radii = []
    for edge in edges:
        if edge.behind >= 0:
            difference = (faces[edge.behind].normal - faces[edge.face].normal)[:2] @ edge.outward
            middle = (edge.start + edge.end) / 2.0
            distances = np.linalg.norm(image_points(faces[edge.behind].hull) - middle, axis=1)
            # The hulls of two faces may overlap at an edge that is not rounded.
            gap = max(float(distances.min()) - 1.0, 0.0)
            radii.append(gap / max(abs(float(difference)), MIN_NORMAL_STEP))
    return float(np.median(radii)) if radii else DEFAULT_ROUNDING_INRADII * inradius
