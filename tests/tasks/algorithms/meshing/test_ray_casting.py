"""Rays cast at meshes: what they meet, and that a process stays with one thread."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from glint.tasks.algorithms.meshing.ray_casting import RayScene, interpolated

ROOT = Path(__file__).parents[4]
CORNERS = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]])
TRIANGLES = np.array([[0, 1, 2]])
DOWN = np.array([0.0, 0.0, -1.0])


def test_a_ray_meets_the_nearest_mesh_at_its_barycentric_coordinates() -> None:
    scene = RayScene((CORNERS, TRIANGLES), (CORNERS - [0.0, 0.0, 3.0], TRIANGLES))
    origins = np.array([[1.0, 2.0, 5.0], [1.0, 2.0, -1.0], [5.0, 5.0, 5.0]])
    hits = scene.cast(origins, np.tile(DOWN, (3, 1)))
    assert np.allclose(hits.distance, [5.0, 2.0, np.inf]) and hits.is_hit.tolist() == [True, True, False]
    assert hits.mesh[:2].tolist() == [0, 1] and hits.triangle[:2].tolist() == [0, 0]
    assert np.allclose(hits.uv[0], [0.25, 0.5])
    assert np.allclose(hits.facet_normals[0], [0.0, 0.0, 1.0])
    assert scene.occluded(origins, np.tile(DOWN, (3, 1))).tolist() == [True, True, False]


def test_values_at_corners_are_interpolated() -> None:
    values = np.array([[0.0, 1.0], [4.0, 1.0], [8.0, 1.0]])
    found = interpolated(values, TRIANGLES, np.zeros(2, int), np.array([[0.0, 0.0], [0.25, 0.5]]))
    assert np.allclose(found, [[0.0, 1.0], [5.0, 1.0]])


@pytest.mark.parametrize("shape", [(0, 3), (2, 0, 3), (2, 4, 3)])
def test_rays_may_have_any_shape(shape: tuple[int, ...]) -> None:
    hits = RayScene((CORNERS, TRIANGLES)).cast(np.zeros(shape), np.broadcast_to(DOWN, shape))
    assert hits.distance.shape == shape[:-1] and hits.uv.shape == (*shape[:-1], 2)


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="threads are counted in /proc")
def test_casting_rays_starts_no_threads() -> None:
    """A run has a worker for each processor: threads of one would take the processors of the others."""
    code = """
import os
import numpy as np
from glint.tasks.algorithms.meshing.depth_mesh import Surface
from glint.tasks.algorithms.meshing.shading import draw_surface
from glint.tasks.algorithms.multiview.normal_fusion import fuse_normals
from glint.tasks.algorithms.multiview.raycast import raycast
from glint.tasks.algorithms.simulation.ray_tracing import Scene
from glint.tasks.algorithms.simulation.solids import GLASS, sphere
from tests.tasks.algorithms.multiview.figurine import body, full_view, true_model

mesh, view = body(), full_view("view")
model, solid = true_model(mesh), sphere(np.zeros(3), 20.0, GLASS)
before = len(os.listdir("/proc/self/task"))
raycast(model, view)
fuse_normals([view], model.vertices, model.triangles)
vertices, normals = model.vertices.astype(np.float32), model.normals.astype(np.float32)
draw_surface(Surface(vertices, model.triangles.astype(np.int32), normals, model.confidence))
origins = np.random.default_rng(0).uniform(-9.0, 9.0, (200_000, 3))
Scene([solid]).cast(origins, np.tile([0.0, 0.0, 1.0], (len(origins), 1)))
print(len(os.listdir("/proc/self/task")) - before)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.split() == ["0"]
