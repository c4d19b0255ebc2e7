"""The projection of a capture's need for memory, from what its survey says."""

from pathlib import Path

from glint.storage.catalogue.loading import load
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.engine.tiles import TILE_BYTES
from glint.tasks.memory import LOADED_BYTES, largest_need
from glint.tasks.pipeline import TILES_HELD


def need(simulated: Path, store: Path, edge: int, bits: int = 8, frame: int = 4000) -> tuple[int, str]:
    """What is projected for a square region of a square frame."""
    work = CaptureContext.of(load(simulated, Parameters), "hemisphere", "front", str(store))
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
