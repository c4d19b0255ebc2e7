"""The projection of a capture's need for memory, from what its survey says."""

import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glint.storage.catalogue.loading import load
from glint.tasks.algorithms.faces.proven_faces import face_evidence
from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.sheets.sheet_graph import sheet_graph
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.engine.stage import CaptureSize
from glint.tasks.engine.tiles import TILE_BYTES
from glint.tasks.memory import LOADED_BYTES, largest_need
from glint.tasks.pipeline import BY_NAME, TILES_HELD


def need(
    simulated: Path, store: Path, edge: int, bits: int = 8, frame: int = 4000, candidates: int = 3
) -> tuple[int, str]:
    """What is projected for a square region of a square frame."""
    work = CaptureContext.of(load(simulated, Parameters), "hemisphere", "front", str(store))
    parameters = Parameters.model_validate({"clusters": {"clusters": candidates}})
    work = replace(work, parameters=parameters)
    region = {"x": 0, "y": 0, "width": edge, "height": edge}
    work.repository.save(
        "front", "survey", f"{edge}", {}, {"region": region, "frame_size": [frame, frame], "bits": bits}
    )
    return largest_need(work)


def test_the_need_grows_with_the_region_and_names_the_stage(simulated: Path, tmp_path: Path) -> None:
    assert need(simulated, tmp_path, 10, frame=100) == (LOADED_BYTES + TILES_HELD * TILE_BYTES, "clusters")
    small, large = need(simulated, tmp_path, 1000), need(simulated, tmp_path, 2000)
    assert small[1] == large[1] == "labels" and large[0] - LOADED_BYTES == 4 * (small[0] - LOADED_BYTES)


def test_frames_of_16_bits_and_huge_frames_count(simulated: Path, tmp_path: Path) -> None:
    assert need(simulated, tmp_path, 1000, bits=16, frame=12_000)[1] == "frames"
    assert need(simulated, tmp_path, 100, frame=20_000)[0] > LOADED_BYTES + 8 * 20_000**2


def test_the_need_grows_with_the_candidates_of_a_pixel(simulated: Path, tmp_path: Path) -> None:
    few, usual, most = (need(simulated, tmp_path, 1000, candidates=count)[0] - LOADED_BYTES for count in (2, 3, 6))
    assert few == usual and most == 2 * usual


@pytest.mark.parametrize("candidates", [3, 6])
def test_sheets_and_faces_of_pixels_that_have_all_candidates_take_no_more_than_is_declared(candidates: int) -> None:
    edge = 200
    generator, slopes = np.random.default_rng(0), np.linspace(-0.5, 0.5, candidates)
    tilts = generator.normal(0.0, 0.02, (candidates, edge, edge, 2)) + slopes[:, None, None, None]
    normals = unit(np.concatenate([tilts, np.ones((candidates, edge, edge, 1))], axis=-1)).astype(np.float32)
    camera = np.array([[600.0, 0.0, 100.0], [0.0, 600.0, 100.0], [0.0, 0.0, 1.0]])
    sheet_graph(normals[:, :8, :8])  # compiles what it calls
    declared = BY_NAME["labels"].peak_bytes(CaptureSize(edge**2, edge**2, 1, candidates))
    for action in (
        lambda: sheet_graph(normals),
        lambda: face_evidence(normals, np.ones((edge, edge), bool), 99.0, camera),
    ):
        tracemalloc.start()
        action()
        assert tracemalloc.get_traced_memory()[1] < declared
        tracemalloc.stop()
