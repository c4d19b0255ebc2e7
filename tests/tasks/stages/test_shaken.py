"""Frames of a camera that moved."""

from pathlib import Path

import numpy as np

from glint.storage.catalogue.loading import load
from glint.storage.footage.source import open_footage
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from glint.tasks.stages.capture_geometry import OBJECT
from glint.tasks.stages.frames import open_frames
from tests.tasks.make_context import make_context, perform_all


def test_frames_of_a_shaken_camera_are_moved_back(tmp_path: Path) -> None:
    options = CaptureOptions(frames=150, scale=0.3, rays=1, sphere_radius=15)
    still = simulate("fish", tmp_path / "still", options).catalogue
    shaken = simulate(
        "fish", tmp_path / "shaken", CaptureOptions(frames=150, scale=0.3, rays=1, sphere_radius=15, shake=1.5)
    )
    levels = {}
    for name, catalogue in (("still", still), ("shaken", shaken.catalogue)):
        work = make_context(catalogue, tmp_path / name / "store")
        records = perform_all(work, "frames")
        levels[name] = open_frames(work).read(OBJECT).astype(float)
        assert any("the camera moved" in warning.message for warning in records[0].warnings) == (name == "shaken")
        assert work.load("survey").record["stabilization"]["applied"] == (name == "shaken")
        assert all(each.cached for each in perform_all(work, "frames"))
    capture = load(shaken.catalogue).objects[0].captures[0]
    assert capture.region is not None
    with open_footage(capture.frames) as footage:
        levels["raw"] = np.array([each[capture.region.rows, capture.region.columns] for each in footage.frames()])
    inner = np.s_[:, 8:-8, 8:-8]
    off = {name: np.median(np.abs(levels["still"] - levels[name])[inner]) for name in ("raw", "shaken")}
    assert off["shaken"] < 0.6 * off["raw"]
