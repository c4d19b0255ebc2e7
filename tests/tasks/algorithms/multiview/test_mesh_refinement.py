"""Refinement: silhouettes hold a body's size, and normals that run across a step do not pull down what stands off."""

import numpy as np
import open3d as o3d
import pytest
import trimesh
from scipy import ndimage

from glint.tasks.algorithms.meshing.implicit import ImplicitFunction, ellipsoid, surface_nets
from glint.tasks.algorithms.multiview.mesh import face_normals
from glint.tasks.algorithms.multiview.mesh_refinement import refine_mesh
from glint.tasks.algorithms.multiview.raycast import raycast
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.turntable import Turntable
from tests.tasks.algorithms.multiview.figurine import true_model, views_of

TABLE = Turntable(0.0, 0.0, 0.0, np.arange(0.0, 360.0, 45.0))
BODY = ellipsoid((0, 0, 0), (30, 20, 18))


def wing_height(points: np.ndarray) -> np.ndarray:
    """Height (N,) of a wing over the body: it rises gently to the right, by 5, and ends in a cliff on three sides."""
    x, y, z = points.T
    cliff = np.clip(11 - x, 0, 1) * np.clip((9 - np.abs(y)) / 2, 0, 1) * (z > 0)
    return np.asarray(5 * np.clip((x + 14) / 24, 0, 1) * cliff)


def mesh_of(function: ImplicitFunction) -> trimesh.Trimesh:
    vertices, triangles = surface_nets(function, np.array([-34.0, -24, -22]), np.array([34.0, 24, 28]), 1.1)
    return trimesh.Trimesh(vertices, triangles, process=False)


@pytest.fixture(scope="module")
def winged() -> trimesh.Trimesh:
    return mesh_of(lambda points: BODY(points) - wing_height(points))


@pytest.fixture(scope="module")
def views(winged: trimesh.Trimesh) -> list[View]:
    """Views of the wing whose normals at the cliffs are the body's, as if there were no step."""
    shown = []
    for view, bare in zip(views_of(winged, TABLE), views_of(mesh_of(BODY), TABLE), strict=True):
        body_normals = np.where((bare.mask & view.mask)[..., None], bare.normals, view.normals)
        cosine = np.nan_to_num((raycast(true_model(winged), view)[1] * body_normals).sum(axis=-1), nan=1.0)
        is_cliff = ndimage.binary_dilation(cosine < np.cos(np.radians(30))) & view.mask
        normals = np.where(is_cliff[..., None], body_normals, view.normals).astype(np.float32)
        shown.append(view.with_normals(normals, np.where(is_cliff, np.float32(0.5), view.evidence)))
    return shown


def sunk(vertices: np.ndarray, winged: trimesh.Trimesh) -> float:
    """Return the mean distance by which the wing's upper half lies below its true surface."""
    points = np.asarray(winged.vertices)[wing_height(np.asarray(winged.vertices)) > 2.5]
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    corners, triangles = vertices.astype(np.float32), np.asarray(winged.faces, np.uint32)
    scene.add_triangles(o3d.core.Tensor.from_numpy(corners), o3d.core.Tensor.from_numpy(triangles))
    return float(scene.compute_signed_distance(o3d.core.Tensor.from_numpy(points.astype(np.float32))).numpy().mean())


def test_a_wing_stands_off_the_body_though_smooth_normals_deny_its_cliffs(
    views: list[View], winged: trimesh.Trimesh
) -> None:
    start, triangles = np.asarray(winged.vertices), np.asarray(winged.faces)
    dragged = sunk(refine_mesh(views, start, triangles, steps=10), winged)
    kept = sunk(refine_mesh(views, start, triangles, steps=10, is_robust=True), winged)
    assert dragged > 1.0
    assert kept < 0.6 * dragged


@pytest.mark.parametrize("scale", [0.97, 1.0, 1.03])
def test_silhouettes_hold_the_size_of_a_body(scale: float) -> None:
    """Normals are those of a body of any size; eight silhouettes tell its size, to a tenth of a pixel."""
    truth = mesh_of(BODY)
    views = []
    for view in views_of(truth, TABLE):
        exact = raycast(true_model(truth), view)[1]
        normals = np.where(np.isfinite(exact), exact, view.normals)
        views.append(view.with_normals(normals, np.where(view.mask, 0.3, np.nan).astype(np.float32)))
    vertices, triangles = np.asarray(truth.vertices), np.asarray(truth.faces)
    refined = trimesh.Trimesh(refine_mesh(views, scale * vertices, triangles, steps=10), triangles, process=False)
    assert refined.volume == pytest.approx(truth.volume, rel=0.012)


def test_normals_of_triangles_are_unit_and_outwards() -> None:
    sphere = trimesh.creation.icosphere(2)
    normals = face_normals(np.asarray(sphere.vertices), np.asarray(sphere.faces))
    assert np.allclose(normals, sphere.face_normals, atol=1e-6)
    flat = face_normals(np.zeros((3, 3)), np.array([[0, 1, 2]]))
    assert np.array_equal(flat, np.zeros((1, 3)))
