"""Solids for ray tracing: a fine mesh for intersections, and exact normals where a solid has an implicit function.

Made as surfaces of revolution, from implicit functions (`meshing.implicit`), or as spheres.
"""

from dataclasses import dataclass, replace

import numpy as np

from glint.tasks.algorithms.meshing.implicit import ImplicitFunction, surface_nets, surface_normals

GLASS, CHROME, MATTE = range(3)
"""Materials: refracting, mirroring, diffuse."""
MESH_STEP = 0.8
"""Spacing of a mesh along its profile."""
SEGMENT_LENGTH = 1.2
"""Length of a mesh segment round the axis of a surface of revolution, at its largest radius."""
MIN_SEGMENTS, MAX_SEGMENTS = 96, 720
"""Bounds of the segments round the axis."""


@dataclass(frozen=True, slots=True)
class Solid:
    """A closed surface, moved from its own frame by `rotation` and `offset`: x = rotation @ local + offset.

    vertices: (V, 3) float64, moved.
    triangles: (F, 3) int64, wound so that their normals point out of the glass.
    vertex_normals: (V, 3) float64, unit, moved, exact at the vertices.
    function: implicit function in the solid's own frame; its normals replace those interpolated over the mesh.
    material: GLASS, CHROME or MATTE.
    inner: whether it is a cavity or an inclusion, and so no part of the outer surface.
    rotation, offset: (3, 3) and (3,), None for the identity.
    inverted: whether the glass lies outside the solid.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    vertex_normals: np.ndarray
    function: ImplicitFunction | None = None
    material: int = GLASS
    inner: bool = False
    rotation: np.ndarray | None = None
    offset: np.ndarray | None = None
    inverted: bool = False

    def scaled(self, factor: float) -> "Solid":
        """Return the solid `factor` times as large; only before it is moved."""
        function = self.function
        return replace(
            self,
            vertices=self.vertices * factor,
            function=None if function is None else lambda points: factor * function(points / factor),
        )

    def transformed(self, rotation: np.ndarray, offset: np.ndarray) -> "Solid":
        """Return the solid rotated (3, 3) and then shifted (3,); the implicit function stays in its own frame."""
        return replace(
            self,
            vertices=self.vertices @ rotation.T + offset,
            vertex_normals=self.vertex_normals @ rotation.T,
            rotation=rotation if self.rotation is None else rotation @ self.rotation,
            offset=offset if self.offset is None else rotation @ self.offset + offset,
        )

    def to_local(self, points: np.ndarray) -> np.ndarray:
        """Return points (N, 3) of the scene in the solid's own frame."""
        if self.rotation is None or self.offset is None:
            return points
        return (points - self.offset) @ self.rotation

    def exact_normals(self, points: np.ndarray) -> np.ndarray | None:
        """Return unit normals (N, 3) at points (N, 3) of the scene, out of the glass; None without a function."""
        if self.function is None:
            return None
        normals = surface_normals(self.function, self.to_local(points)) * (-1.0 if self.inverted else 1.0)
        return normals if self.rotation is None else normals @ self.rotation.T


def revolve(profile: np.ndarray) -> Solid:
    """Return the solid of revolution about the y axis of a profile.

    profile (N, 2): (radius, height), from the axis at the bottom to the axis at the top, joined by straight lines.
    """
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(profile, axis=0).T))])
    fine = np.linspace(0.0, length[-1], max(2, int(np.ceil(length[-1] / MESH_STEP)) + 1))
    points = np.column_stack([np.interp(fine, length, profile[:, axis]) for axis in (0, 1)])
    tangent = np.gradient(points, fine, axis=0)
    points[:, 0] = np.maximum(points[:, 0], 0.0)
    # The profile runs upwards with the solid on its left, so its normal is the tangent turned to the right.
    normals = np.column_stack([tangent[:, 1], -tangent[:, 0]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return _lathe(points, normals)


def _lathe(points: np.ndarray, normals: np.ndarray) -> Solid:
    """Return the mesh of a profile (N, 2) with normals (N, 2), both (radius, height), swept about the y axis."""
    around = int(np.clip(2.0 * np.pi * points[:, 0].max() / SEGMENT_LENGTH, MIN_SEGMENTS, MAX_SEGMENTS))
    angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    sine, cosine = np.sin(angle), np.cos(angle)

    def swept(profile: np.ndarray) -> np.ndarray:
        radius, height = profile[:, :1], profile[:, 1:]
        return np.stack([radius * sine, height + 0.0 * sine, radius * cosine], axis=-1).reshape(-1, 3)

    ring = np.arange(around)
    triangles: list[np.ndarray] = []
    for row in range(len(points) - 1):
        first, second = row * around + ring, row * around + (ring + 1) % around
        triangles += [
            np.column_stack([first, second, second + around]),
            np.column_stack([first, second + around, first + around]),
        ]
    return Solid(swept(points), np.concatenate(triangles), swept(normals))


def from_implicit(
    function: ImplicitFunction, low: np.ndarray, high: np.ndarray, cell: float, material: int = GLASS
) -> Solid:
    """Return the solid of an implicit function, meshed with cells of edge `cell` in the box from low to high (3,)."""
    vertices, triangles = surface_nets(function, np.asarray(low, float), np.asarray(high, float), cell)
    return Solid(vertices, triangles, surface_normals(function, vertices), function, material)


def as_cavity(solid: Solid) -> Solid:
    """Return the solid as a cavity in glass: its normals point out of the glass, into the cavity."""
    return replace(
        solid, triangles=solid.triangles[:, ::-1], vertex_normals=-solid.vertex_normals, inner=True, inverted=True
    )


def sphere(centre: np.ndarray, radius: float, material: int) -> Solid:
    """Return a sphere about centre (3,) with exact normals."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, max(48, int(np.pi * radius / 0.8)))
    normals = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.column_stack([np.maximum(radius * np.cos(angle), 0.0), radius * np.sin(angle)])

    def function(points: np.ndarray) -> np.ndarray:
        return np.linalg.norm(points, axis=1) - radius

    mesh = replace(_lathe(points, normals), function=function, material=material)
    return mesh.transformed(np.eye(3), np.asarray(centre, float))
