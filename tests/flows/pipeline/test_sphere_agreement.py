"""Captures of one object after their stages: a sphere that lies elsewhere is named, one that is missing is offered."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from glint.flows.pipeline.context import activate
from glint.flows.pipeline.object import ObjectCaptures, with_agreement
from glint.flows.reporting.events import CaptureWarning
from glint.flows.results import CaptureResult
from glint.flows.runtime.dask_cluster import Cluster
from glint.storage.footage.source import open_footage
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.stages.capture_geometry import load_geometry
from tests.flows.recording_sink import RecordingSink
from tests.tasks.make_context import make_context, perform_all

pytestmark = [pytest.mark.server, pytest.mark.usefixtures("server")]
SHIFT_PX, N_FRAMES = 2, 24


@pytest.fixture
def captures(simulated: Path, tmp_path: Path) -> ObjectCaptures:
    """Three captures alike, one whose camera stood two pixels farther to the left, one that is dark."""
    video = make_context(simulated, tmp_path).capture.frames
    with open_footage(video) as footage:
        frames = np.stack(footage.spread(N_FRAMES))
    contexts = list[CaptureContext]()
    for name in ("a", "b", "c", "odd", "dark"):
        folder = tmp_path / name
        folder.mkdir()
        shown = np.roll(frames, SHIFT_PX, axis=2) if name == "odd" else frames * np.uint8(name != "dark")
        for number, frame in enumerate(shown):
            cv2.imwrite(str(folder / f"{number:03d}.png"), frame)
        entry = {"id": name, "frames": str(folder / "*.png"), "spheres": [], "markup": None}
        contexts.append(make_context(simulated, tmp_path / "store", **entry))
    return ObjectCaptures(tuple(contexts), tuple(contexts), "catalogue.yaml", len(contexts))


def test_the_spheres_of_an_objects_captures_are_compared(captures: ObjectCaptures, cluster: Cluster) -> None:
    *seen, _ = captures.chosen
    results = [CaptureResult("glass", work.capture.id, 1.0, tuple(perform_all(work, "survey"))) for work in seen]
    refused = CaptureResult("glass", "dark", 1.0, (), "no chrome sphere found in a frame", "put one there")
    sink = RecordingSink()
    with activate(cluster.client, sink):
        agreed = with_agreement(captures, [*results, refused])
    by_name = {result.capture_id: result for result in agreed}
    usual = load_geometry(seen[0]).spheres[0]
    assert by_name["a"] == results[0]
    warning = by_name["odd"].warnings[0]
    assert f"x: {usual.x:.1f}" in warning and "lies elsewhere in 3 captures" in warning
    assert by_name["dark"].remedy.startswith("put one there; if camera and sphere stood still")
    assert f"x: {usual.x:.1f}" in by_name["dark"].remedy
    reported = {event.capture for event in sink.events if isinstance(event, CaptureWarning)}
    assert reported == {"glass/odd", "glass/dark"}
    unread = replace(refused, error="no frame can be read from /data/hemisphere.mp4", remedy="record it again")
    with activate(cluster.client, sink):
        assert with_agreement(captures, [*results, unread])[-1] == unread


def test_one_capture_is_compared_with_nothing(captures: ObjectCaptures, cluster: Cluster) -> None:
    alone = replace(captures, chosen=captures.chosen[-1:], all=captures.chosen[-1:])
    result = CaptureResult("glass", "dark", 1.0, (), "no chrome sphere found in a frame", "put one there")
    with activate(cluster.client):
        assert with_agreement(alone, [result]) == (result,)
