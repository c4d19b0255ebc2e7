import numpy as np
import pytest
import trimesh

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.perspective import view_vectors
from glint.tasks.algorithms.meshing.depth_mesh import RegionCamera, Surface, mesh_from_depth
from tests.tasks.algorithms.geometry.gradient_normals import from_gradients
from tests.tasks.algorithms.meshing.inclined_plane import plane


def face_normals(mesh: Surface) -> np.ndarray:
    corners = mesh.vertices[mesh.triangles].astype(float)
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def test_each_pixel_is_a_vertex_and_each_square_two_triangles() -> None:
    depth, mask, normals = plane()
    mesh = mesh_from_depth(depth, mask, normals)
    assert mesh.vertices.shape == (12 * 17, 3) and mesh.triangles.shape == (2 * 11 * 16, 3)
    assert mesh.vertices.dtype == np.float32 and mesh.triangles.dtype == np.int32
    assert (face_normals(mesh)[:, 2] > 0).all()
    assert np.allclose(face_normals(mesh)[:, 2].sum() / 2, 11 * 16)
    assert (mesh.confidence == 1.0).all()


def test_vertices_are_in_the_camera_frame_of_the_full_picture() -> None:
    depth, mask, normals = plane(3, 4)
    mesh = mesh_from_depth(depth, mask, normals, RegionCamera((10, 20), (101, 51), pixel_size=0.2))
    assert np.allclose(mesh.vertices[0], [0.2 * (10 - 50), 0.2 * (25 - 20), 0.0])
    assert np.allclose(mesh.vertices[-1], [0.2 * (13 - 50), 0.2 * (25 - 22), 0.2 * 1.5])


@pytest.mark.parametrize("skew", [0.0, 15.0])
def test_perspective_projects_pixels_back(skew: float) -> None:
    camera = np.array([[400.0, skew, 30.0], [0.0, 410.0, 25.0], [0.0, 0.0, 1.0]])
    depth = np.full((6, 8), 200.0, np.float32)
    normals = np.broadcast_to([0.0, 0.0, 1.0], (6, 8, 3))
    mesh = mesh_from_depth(depth, np.ones((6, 8), bool), normals, RegionCamera((27, 20), matrix=camera))
    assert np.allclose(mesh.vertices[:, 2], -200.0)
    down = (20 - 25) / 410
    assert np.allclose(mesh.vertices[0], [200 * (27 - 30 - skew * down) / 400, -200 * down, -200.0])
    assert (face_normals(mesh)[:, 2] > 0).all()


def test_a_steep_plane_is_whole_under_perspective() -> None:
    matrix = np.array([[400.0, 0.0, 11.5], [0.0, 400.0, 9.5], [0.0, 0.0, 1.0]])
    normal = np.array([0.8, 0.0, 0.6])
    rays = -view_vectors(matrix, (20, 24), 0.0, 0.0)
    depth = (-rays[..., 2] / (rays @ normal)) * -100.0
    mesh = mesh_from_depth(
        depth, np.ones((20, 24), bool), np.broadcast_to(normal, (20, 24, 3)), RegionCamera(matrix=matrix)
    )
    assert len(mesh.triangles) == 2 * 19 * 23
    assert np.ptp(mesh.vertices @ normal) < 1e-3


def test_a_step_is_cut_and_a_steep_slope_is_not() -> None:
    depth, mask, normals = plane(10, 20, p=8.0)
    assert len(mesh_from_depth(depth, mask, normals).triangles) == 2 * 9 * 19
    depth[:, 10:] += 30.0
    mesh = mesh_from_depth(depth, mask, normals)
    assert len(mesh.triangles) == 2 * 9 * 18
    assert trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False).body_count == 2
    assert len(mesh_from_depth(depth, mask, normals, max_step=100.0, max_slope=100.0).triangles) == 2 * 9 * 19


def test_a_crease_is_no_step() -> None:
    x = np.indices((12, 17))[1] - 8.0
    slope = np.where(x < 0.0, 2.0, -2.0)
    normals = from_gradients(slope, np.zeros_like(slope))
    assert len(mesh_from_depth(-2.0 * np.abs(x), np.ones(x.shape, bool), normals).triangles) == 2 * 11 * 16


def test_a_slope_too_steep_to_be_observed_is_cut() -> None:
    depth, mask, normals = plane(6, 6, p=20.0)
    with pytest.raises(UnusableCapture):
        mesh_from_depth(depth, mask, normals)
    assert len(mesh_from_depth(depth, mask, normals, max_slope=25.0).triangles) == 50


def test_no_two_triangles_overlap_at_broken_squares() -> None:
    rng = np.random.default_rng(4)
    depth = rng.choice([0.0, 0.4, 3.0], size=(40, 40)).astype(np.float32)
    normals = np.broadcast_to([0.0, 0.0, 1.0], (40, 40, 3))
    mesh = mesh_from_depth(depth, np.ones((40, 40), bool), normals)
    square = np.floor(mesh.vertices[mesh.triangles][..., :2].mean(axis=1) + 19.5)
    _, counts = np.unique(square, axis=0, return_counts=True)
    assert counts.max() <= 2
    directed = np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [2, 0]]])
    assert len(np.unique(directed, axis=0)) == len(directed)


def test_holes_and_missing_depth_have_no_triangles_and_lone_pixels_no_vertices() -> None:
    depth, mask, normals = plane(9, 9)
    mask[4, 4] = False
    depth[0, 0] = np.nan
    mask[:, 7] = False
    mesh = mesh_from_depth(depth, mask, normals)
    assert len(mesh.vertices) == 9 * 7 - 2
    assert np.isfinite(mesh.vertices).all() and mesh.triangles.max() < len(mesh.vertices)


def test_missing_normals_are_those_of_the_triangles() -> None:
    depth, mask, normals = plane()
    normals = normals.copy()
    expected = normals[5, 5].copy()
    normals[5, 5] = np.nan
    mesh = mesh_from_depth(depth, mask, normals)
    assert np.allclose(mesh.normals[5 * 17 + 5], expected, atol=1e-5)


def test_a_pixel_of_unknown_confidence_has_none() -> None:
    depth, mask, normals = plane()
    confidence = np.full(mask.shape, 0.75, np.float32)
    confidence[0, 0] = np.nan
    mesh = mesh_from_depth(depth, mask, normals, confidence=confidence)
    assert mesh.confidence[0] == 0.0 and (mesh.confidence[1:] == 0.75).all()


def test_bad_input_is_refused() -> None:
    depth, mask, normals = plane()
    with pytest.raises(ValueError, match="agree"):
        mesh_from_depth(depth[:-1], mask, normals)
    with pytest.raises(UnusableCapture, match="no triangle"):
        mesh_from_depth(depth, np.zeros_like(mask), normals)
    line = np.zeros_like(mask)
    line[3] = True
    with pytest.raises(UnusableCapture, match="no triangle"):
        mesh_from_depth(depth, line, normals)
