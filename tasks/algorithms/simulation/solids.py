"""Solids that rays meet: a fine mesh to find the place, and the exact normal there."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from glint.tasks.algorithms.meshing.implicit import Field, hit_along, mesh_of, surface_normals

GLASS, CHROME, MATTE = range(3)
"""Materials: refracting, mirroring, diffuse."""


@dataclass(frozen=True, slots=True)
class Solid:
    """A closed surface in the object's own frame, moved by `rotation` and `offset`: x = rotation @ own + offset.

    vertices (V, 3), triangles (F, 3) wound so that their normals leave the glass, vertex_normals (V, 3) exact at the
    vertices. Where there is a `field`, normals and hits are its own; otherwise interpolated over the fine mesh.
    `inner` solids (bubbles, inclusions) are no part of the outer surface. colour: RGB reflectances of a matte one.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    vertex_normals: np.ndarray
    field: Field | None = None
    material: int = GLASS
    inner: bool = False
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    rotation: np.ndarray | None = None
    offset: np.ndarray | None = None
    inverted: bool = False

    def scaled(self, factor: float) -> "Solid":
        """The solid before it is moved, `factor` times as large."""
        field = self.field
        return replace(
            self,
            vertices=self.vertices * factor,
            field=None if field is None else lambda points: factor * field(points / factor),
        )

    def moved(self, rotation: np.ndarray, offset: np.ndarray) -> "Solid":
        """The same solid at another place: the mesh and its normals move, the field stays in its own frame."""
        return replace(
            self,
            vertices=self.vertices @ rotation.T + offset,
            vertex_normals=self.vertex_normals @ rotation.T,
            rotation=rotation if self.rotation is None else rotation @ self.rotation,
            offset=offset if self.offset is None else rotation @ self.offset + offset,
        )

    def own(self, points: np.ndarray) -> np.ndarray:
        """Points (N, 3) of the scene in the frame of the field."""
        if self.rotation is None or self.offset is None:
            return points
        return (points - self.offset) @ self.rotation

    def normals(self, points: np.ndarray, triangles: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """Unit normals (N, 3) at points on the given triangles (N,) with barycentric uv (N, 2)."""
        if self.field is None:
            corner = self.vertex_normals[self.triangles[triangles]]
            weights = np.column_stack([1.0 - uv.sum(axis=1), uv])
            normals = np.einsum("nkc,nk->nc", corner, weights)
            return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        normals = surface_normals(self.field, self.own(points)) * (-1.0 if self.inverted else 1.0)
        return normals if self.rotation is None else normals @ self.rotation.T

    def exact(self, origins: np.ndarray, directions: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Ray parameters (N,) of the exact surface near those of the mesh, which stay where there is no field."""
        if self.field is None:
            return start
        turned = directions if self.rotation is None else directions @ self.rotation
        hits = hit_along(self.field, self.own(origins), turned, start, 2.0)
        return np.where(np.isfinite(hits), hits, start)


def turned(profile: np.ndarray, corners: tuple[int, ...] = (), step: float = 1.0, smooth: bool = True) -> Solid:
    """Solid of revolution about y of a profile (N, 2) of (radius, height), from the axis at the bottom up to the axis.

    The profile is a cubic spline between the rows named in `corners`, where it has sharp edges, or straight lines
    where `smooth` is off; its normals are those of the spline. `step`: spacing of the mesh along the profile.
    """
    stops = [0, *corners, len(profile) - 1]
    points, normals = [], []
    for first, last in pairwise(stops):
        piece = profile[first : last + 1]
        length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(piece, axis=0).T))])
        fine = np.linspace(0.0, length[-1], max(2, int(np.ceil(length[-1] / step)) + 1))
        if smooth and len(piece) > 2:
            on_axis = piece[[0, -1], 0] < 1e-9
            flat = [(1, np.array([sign, 0.0])) for sign in (1.0, -1.0)]
            ends = tuple(slope if on else (2, np.zeros(2)) for on, slope in zip(on_axis, flat, strict=True))
            spline = CubicSpline(length, piece, bc_type=ends)
            place, tangent = spline(fine), spline(fine, 1)
        else:
            place = np.column_stack([np.interp(fine, length, piece[:, k]) for k in (0, 1)])
            tangent = np.gradient(place, fine, axis=0)
        place[:, 0] = np.maximum(place[:, 0], 0.0)
        points.append(place)
        normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
        normals.append(normal / np.linalg.norm(normal, axis=1, keepdims=True))
    return _revolved(points, normals)


def _revolved(pieces: list[np.ndarray], normals: list[np.ndarray]) -> Solid:
    """Each piece of the profile (N, 2) with its normals swept about the y axis; pieces share no vertices."""
    reach = max(piece[:, 0].max() for piece in pieces)
    around = int(np.clip(2.0 * np.pi * reach / 1.2, 96, 720))
    angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    s, c = np.sin(angle), np.cos(angle)
    vertices: list[np.ndarray] = []
    directions: list[np.ndarray] = []
    triangles: list[np.ndarray] = []
    base = 0
    for piece, normal in zip(pieces, normals, strict=True):
        for target, source in ((vertices, piece), (directions, normal)):
            r, y = source[:, :1], source[:, 1:]
            target.append(np.stack([r * s, y + 0.0 * s, r * c], axis=-1).reshape(-1, 3))
        ring = np.arange(around)
        for i in range(len(piece) - 1):
            a, b = base + i * around + ring, base + i * around + (ring + 1) % around
            triangles += [np.column_stack([a, b, b + around]), np.column_stack([a, b + around, a + around])]
        base += len(piece) * around
    return Solid(np.concatenate(vertices), np.concatenate(triangles), np.concatenate(directions))


def moulded(field: Field, low: np.ndarray, high: np.ndarray, cell: float, material: int = GLASS) -> Solid:
    """Solid of an implicit field, meshed with the given cell within a box."""
    vertices, triangles = mesh_of(field, np.asarray(low, float), np.asarray(high, float), cell)
    return Solid(vertices, triangles, surface_normals(field, vertices), field, material)


def bubble(solid: Solid) -> Solid:
    """The solid as a hollow in glass: its normals point out of the glass, into the hollow."""
    return replace(
        solid, triangles=solid.triangles[:, ::-1], vertex_normals=-solid.vertex_normals, inner=True, inverted=True
    )


def ball(centre: np.ndarray, radius: float, material: int) -> Solid:
    """A sphere with exact normals."""
    a = np.linspace(-np.pi / 2, np.pi / 2, max(48, int(np.pi * radius / 0.8)))
    r, y = np.maximum(radius * np.cos(a), 0.0), radius * np.sin(a)
    mesh = _revolved([np.column_stack([r, y])], [np.column_stack([np.cos(a), np.sin(a)])])
    field: Field = lambda points: np.linalg.norm(points, axis=1) - radius  # noqa: E731
    return replace(mesh, field=field, material=material).moved(np.eye(3), np.asarray(centre, float))
