"""Views of a small figurine drawn from its formula: body, head and a hollow side; true masks, normals and surface."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import trimesh

from glint.tasks.algorithms.meshing.implicit import ImplicitFunction, capsule, ellipsoid, surface_nets, union
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.raycast import raycast
from glint.tasks.algorithms.multiview.view import SilhouetteMask, View
from glint.tasks.algorithms.registration.turntable import Turntable

FRAME = (96, 96)
OBSERVABLE_DEG = 45.0
"""Degrees from the camera's axis within which normals are observed."""


def difference(solid: ImplicitFunction, removed: ImplicitFunction, blend: float) -> ImplicitFunction:
    """Return the first solid less the second, smooth over about `blend` along the edge."""

    def function(points: np.ndarray) -> np.ndarray:
        a, b = solid(points), -removed(points)
        return np.maximum(a, b) + blend * np.log1p(np.exp(-np.abs(a - b) / blend))

    return function


@cache
def body() -> trimesh.Trimesh:
    """The true surface, about 70 units across; it can only be read."""
    solid = union([ellipsoid((0, -8, 0), (30, 18, 16)), ellipsoid((18, 14, 3), (12, 12, 10))], 3.0)
    solid = union([solid, capsule((-26, -4, 0), (-34, 14, -4), 6.0, 3.0)], 2.0)
    solid = difference(solid, ellipsoid((-2, -6, 20), (12, 9, 8)), 1.5)
    vertices, triangles = surface_nets(solid, np.array([-42.0, -30, -22]), np.array([38.0, 30, 22]), 0.8)
    return trimesh.Trimesh(vertices, triangles, process=False)


def views_of(
    mesh: trimesh.Trimesh, table: Turntable, noise: float = 1.0, seed: int = 0, pixel_size: float = 1.0
) -> list[View]:
    """Return views of a mesh on a turntable: perfect silhouettes, and normals with `noise` degrees of error."""
    poses = [table.pose(number) for number in range(len(table.angles))]
    return views_at(mesh, poses, noise, seed, pixel_size=pixel_size)


def views_at(
    mesh: trimesh.Trimesh,
    poses: Sequence[tuple[np.ndarray, np.ndarray]],
    noise: float = 1.0,
    seed: int = 0,
    matrix: np.ndarray | None = None,
    pixel_size: float = 1.0,
) -> list[View]:
    """Return views of a mesh from poses: perfect silhouettes, and normals with `noise` degrees of error.

    matrix (3, 3): the camera's; None: orthographic, of frames that show as much whatever their pixel size. Normals
    beyond OBSERVABLE_DEG degrees are guesses 12 degrees off and of little confidence.
    """
    generator = np.random.default_rng(seed)
    empty = full_view("view", matrix, pixel_size)
    truth = true_model(mesh)
    views = []
    for number, view in enumerate(empty.with_pose(*pose) for pose in poses):
        normals = raycast(truth, view)[1].astype(float)
        mask = np.isfinite(normals[..., 0])
        observable = normals[..., 2] > np.cos(np.radians(OBSERVABLE_DEG))
        scatter = np.where(observable, np.radians(noise), np.radians(12.0))[..., None]
        normals += scatter * generator.normal(size=normals.shape)
        normals[..., 2] = np.maximum(normals[..., 2], 0.0)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        confidence = np.where(mask, np.where(observable, 0.97, 0.2), np.nan).astype(np.float32)
        shown = replace(view, name=f"view-{number}", silhouette=SilhouetteMask(mask))
        views.append(shown.with_normals(normals.astype(np.float32), confidence))
    return views


def full_view(name: str, matrix: np.ndarray | None = None, pixel_size: float = 1.0) -> View:
    """Return a view whose mask is the whole frame, with the world as its camera frame."""
    width, height = (round(edge / pixel_size) for edge in FRAME)
    shape = height, width
    mask, normals, confidence = SilhouetteMask(np.ones(shape, bool)), np.zeros((*shape, 3)), np.zeros(shape)
    return View(name, mask, normals, confidence, np.eye(3), np.zeros(3), (0, 0), (width, height), pixel_size, matrix)


def true_model(mesh: trimesh.Trimesh) -> Model:
    """The true surface as a model, its normals exact."""
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    unseen = np.zeros(len(vertices))
    normals = np.asarray(mesh.vertex_normals)
    return Model(vertices, triangles, normals, unseen, unseen.astype(int), 0.8)
