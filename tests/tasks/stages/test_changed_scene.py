"""A capture whose object was moved while it was recorded."""

from pathlib import Path

import numpy as np
import pytest

from glint.storage.catalogue.loading import load
from glint.storage.footage.source import open_footage
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from tests.storage.footage.videos import write_video
from tests.tasks.make_context import make_context, perform_all


@pytest.mark.usefixtures("smooth_labels")
def test_nothing_is_confident_of_a_capture_whose_object_was_moved(tmp_path: Path) -> None:
    catalogue = simulate("hemisphere", tmp_path / "scene", CaptureOptions(frames=400, scale=0.4)).catalogue
    capture = load(catalogue).objects[0].captures[0]
    assert capture.region is not None
    columns = capture.region.columns
    with open_footage(capture.frames) as footage:
        frames = [np.array(frame) for frame in footage.frames()]
    for frame in frames[200:]:
        frame[:, columns] = np.roll(frame[:, columns], 6, axis=1)
    moved = write_video(tmp_path / "moved.mp4", frames, options={"crf": "14"})
    still = make_context(catalogue, tmp_path / "still")
    work = make_context(catalogue, tmp_path / "store", frames=str(moved))
    perform_all(still, "survey")
    perform_all(work, "labels")
    survey = work.load("survey").record
    (warning,) = [warning for warning in survey["warnings"] if warning["cause"] == "video"]
    assert "frame 20" in warning["message"] and "cut it there" in warning["message"]
    assert abs(survey["scene_change"] - 0.5) < 0.02
    assert still.load("survey").record["scene_change"] is None
    assert work.load("labels").record["counts"]["confident share"] == 0.0
