"""Views are labelled again along the rays of their own cameras."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest

from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.model import view_registration
from glint.tasks.model.view_registration import relabelled, view_of
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from glint.tasks.stages.labels import LabelledView, load_view
from tests.tasks.make_context import make_context, perform_all


def sphere_around(columns: np.ndarray, rows: np.ndarray, matrix: np.ndarray, pixel_size: float) -> Model:
    """Return a ball that fills these pixels (N,) of the full frame of a camera at a turntable's distance."""
    x, y = (columns - matrix[0, 2]) * pixel_size, (matrix[1, 2] - rows) * pixel_size
    mesh = o3d.geometry.TriangleMesh.create_sphere(np.ptp(x) / 2, resolution=30)
    mesh.compute_vertex_normals()
    vertices = np.asarray(mesh.vertices) + np.array([x.mean(), y.mean(), 0.0])
    triangles = np.asarray(mesh.triangles).astype(np.int64)
    count = len(vertices)
    return Model(vertices, triangles, np.asarray(mesh.vertex_normals), np.ones(count), np.zeros(count, int), pixel_size)


@pytest.mark.usefixtures("smooth_labels")
def test_a_perspective_view_is_labelled_with_its_cameras_matrix(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = CaptureOptions(frames=300, scale=0.3, sphere_radius=22.0, focal=2.0)
    work = make_context(simulate("hemisphere", tmp_path, options).catalogue, tmp_path / "store")
    perform_all(work, "labels")
    view, truth = view_of(work), work.capture.truth
    assert view.matrix is not None and truth is not None
    rows, columns = np.nonzero(view.mask)
    model = sphere_around(columns + view.origin[0], rows + view.origin[1], view.matrix, view.pixel_size)
    normals = read_truth(truth, view.mask.shape).normals
    assert normals is not None
    error = angles(relabelled(view, model, work).normals, normals)[view.mask]
    assert np.nanmedian(error) < 1.5 and np.nanpercentile(error, 90) < 6.0

    def without_matrix(work: CaptureContext) -> LabelledView:
        return replace(load_view(work), camera=None)

    monkeypatch.setattr(view_registration, "load_view", without_matrix)
    without = angles(relabelled(view, model, work).normals, normals)[view.mask]
    assert np.nanmean(error) < np.nanmean(without) - 0.01
