"""Imports of large libraries: garbage is collected again afterwards, and Open3D comes without its plots."""

import gc
import subprocess
import sys
from pathlib import Path

import pytest

from glint.tasks.engine.imports import collection_paused

ROOT = Path(__file__).parents[3]


def test_collection_goes_on_after_imports_and_leaves_them_out() -> None:
    frozen = gc.get_freeze_count()
    try:
        with collection_paused():
            assert not gc.isenabled()
        assert gc.isenabled()
        assert gc.get_freeze_count() > frozen
    finally:
        gc.unfreeze()


def test_collection_goes_on_after_an_import_that_fails() -> None:
    try:
        with pytest.raises(ImportError), collection_paused():
            raise ImportError
        assert gc.isenabled()
    finally:
        gc.unfreeze()


def test_workers_get_open3d_that_casts_rays_and_nothing_for_plots() -> None:
    code = """
import sys
import glint.tasks.forked
import numpy as np
import open3d as o3d

scene = o3d.t.geometry.RaycastingScene(nthreads=1)
corners = np.array([[0, 0, 5], [4, 0, 5], [0, 4, 5]], np.float32)
scene.add_triangles(o3d.core.Tensor(corners), o3d.core.Tensor(np.array([[0, 1, 2]], np.uint32)))
hits = scene.cast_rays(o3d.core.Tensor(np.array([[1, 1, 0, 0, 0, 1]], np.float32)), nthreads=1)
print(round(float(hits["t_hit"].numpy()[0]), 3), *sorted({"dash", "plotly", "IPython"} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.split() == ["5.0"]
