"""Six range scans of a figurine, merged and held against the surface that their makers merged from more."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from glint.tasks.algorithms.multiview.poisson import merge_depth_maps
from tests.tasks.algorithms.multiview.range_scans import view_of_scan

SCANS = ("bun000.ply", "bun045.ply", "bun090.ply", "bun180.ply", "bun270.ply", "bun315.ply")


@pytest.mark.shared
@pytest.mark.slow
def test_range_scans_merge_to_the_true_surface(shared_data: Path) -> None:
    folder = shared_data / "real" / "bunny"
    views, depths = zip(*(view_of_scan(name, folder) for name in SCANS), strict=True)
    model = merge_depth_maps(views, depths, cell=0.7)
    mesh = trimesh.Trimesh(model.vertices, model.triangles, process=False)
    assert mesh.is_watertight and mesh.body_count == 1
    reference = trimesh.load(folder / "bun_zipper_res2.ply")
    surface = trimesh.sample.sample_surface(reference, 400_000, seed=0)[0] * 1000.0
    distance = cKDTree(surface).query(model.vertices[model.source >= 0])[0]
    assert (model.source >= 0).mean() > 0.8
    assert np.median(distance) < 0.25 and np.percentile(distance, 95) < 1.0
