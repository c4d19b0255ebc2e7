"""The cache of frames holds what its name says, whatever happened between the stages."""

import shutil
from pathlib import Path

import pytest

from glint.storage.errors import StoreError
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.frames import open_frames
from tests.tasks.make_context import make_context, perform_all


def test_frames_that_are_gone_are_not_replaced_by_those_of_a_later_survey(tiny: Path, tmp_path: Path) -> None:
    store = tmp_path / "store"
    work = make_context(tiny, store)
    perform_all(work, "frames")
    assert work.capture.region is not None
    region = work.capture.region.model_dump()
    moved = make_context(tiny, store, region=region | {"x": region["x"] + 3, "width": region["width"] - 3}, mask=None)
    perform_all(moved, "survey")
    shutil.rmtree(store / "frames")
    with pytest.raises(StoreError, match=r"changed since: run the capture again"):
        open_frames(moved)
    perform_all(moved, "frames")
    assert open_frames(moved).crops == load_geometry(moved).crops
