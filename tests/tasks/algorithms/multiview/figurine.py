"""Views of a small figurine drawn from its formula: body, head and a hollow side; true masks, normals and surface."""

from collections.abc import Sequence

import numpy as np
import trimesh

from glint.tasks.algorithms.meshing.implicit import ImplicitFunction, capsule, ellipsoid, surface_nets, union
from glint.tasks.algorithms.multiview.raycast import cast
from glint.tasks.algorithms.multiview.reconstruction import Model
from glint.tasks.algorithms.multiview.turntable import Turntable
from glint.tasks.algorithms.multiview.view import View

FRAME = (96, 96)
SEEN = 45.0
"""Degrees from the camera's axis within which normals are observed."""


def difference(solid: ImplicitFunction, removed: ImplicitFunction, blend: float) -> ImplicitFunction:
    """The first solid less the second, smooth over about `blend` along the edge."""

    def function(points: np.ndarray) -> np.ndarray:
        a, b = solid(points), -removed(points)
        return np.maximum(a, b) + blend * np.log1p(np.exp(-np.abs(a - b) / blend))

    return function


def body() -> trimesh.Trimesh:
    """The true surface, about 70 units across."""
    solid = union([ellipsoid((0, -8, 0), (30, 18, 16)), ellipsoid((18, 14, 3), (12, 12, 10))], 3.0)
    solid = union([solid, capsule((-26, -4, 0), (-34, 14, -4), 6.0, 3.0)], 2.0)
    solid = difference(solid, ellipsoid((-2, -6, 20), (12, 9, 8)), 1.5)
    vertices, triangles = surface_nets(solid, np.array([-42.0, -30, -22]), np.array([38.0, 30, 22]), 0.8)
    return trimesh.Trimesh(vertices, triangles, process=False)


def views_of(mesh: trimesh.Trimesh, table: Turntable, noise: float = 1.0, seed: int = 0) -> list[View]:
    """What perfect silhouettes, and normals with `noise` degrees, say of a mesh on a turntable."""
    return seen_from(mesh, [table.pose(number) for number in range(len(table.angles))], noise, seed)


def seen_from(
    mesh: trimesh.Trimesh, poses: Sequence[tuple[np.ndarray, np.ndarray]], noise: float = 1.0, seed: int = 0
) -> list[View]:
    """What perfect silhouettes, and normals with `noise` degrees, say of a mesh from rotations and translations.

    Normals beyond SEEN degrees are guesses 12 degrees off, of little confidence.
    """
    generator = np.random.default_rng(seed)
    empty = View(
        "view", np.ones(FRAME[::-1], bool), np.zeros((*FRAME[::-1], 3)), np.zeros(FRAME[::-1]), np.eye(3), np.zeros(3),
        (0, 0), FRAME,
    )  # fmt: skip
    truth = true_model(mesh)
    views = []
    for number, view in enumerate(empty.placed(*pose) for pose in poses):
        normals = cast(truth, view)[1].astype(float)
        mask = np.isfinite(normals[..., 0])
        sure = normals[..., 2] > np.cos(np.radians(SEEN))
        scatter = np.where(sure, np.radians(noise), np.radians(12.0))[..., None]
        normals += scatter * generator.normal(size=normals.shape)
        normals[..., 2] = np.maximum(normals[..., 2], 0.0)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        confidence = np.where(mask, np.where(sure, 0.97, 0.2), np.nan).astype(np.float32)
        views.append(
            View(f"view-{number}", mask, normals.astype(np.float32), confidence, view.rotation, view.translation,
                 (0, 0), FRAME)
        )  # fmt: skip
    return views


def true_model(mesh: trimesh.Trimesh) -> Model:
    """The true surface as a model, its normals exact."""
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    nobody = np.zeros(len(vertices))
    normals = np.asarray(mesh.vertex_normals)
    return Model(vertices, triangles, normals, nobody, nobody.astype(int), 0.8)
