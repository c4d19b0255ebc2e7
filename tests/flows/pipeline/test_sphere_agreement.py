"""Captures of one object after their stages: a sphere that lies elsewhere is named, one that is missing is offered."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from glint.flows.pipeline.context import activate
from glint.flows.pipeline.object import ObjectCaptures, run_reported, with_agreement
from glint.flows.pipeline.worker import compare_captures
from glint.flows.reporting.events import CaptureWarning
from glint.flows.results import CaptureResult
from glint.flows.runtime.dask_cluster import Cluster
from glint.storage.errors import InputError
from glint.storage.footage.source import open_footage
from glint.tasks.algorithms.errors import UnusableSphere
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.errors import MisplacedSphere
from glint.tasks.engine.stage import StageRecord
from glint.tasks.stages.capture_geometry import load_geometry
from tests.flows.recording_sink import RecordingSink
from tests.tasks.make_context import make_context, perform_all

pytestmark = [pytest.mark.server, pytest.mark.usefixtures("server")]
SHIFT_PX, N_FRAMES = 2, 24


@pytest.fixture(scope="module")
def captures(simulated: Path, tmp_path_factory: pytest.TempPathFactory) -> ObjectCaptures:
    """Three captures alike, one whose camera stood two pixels farther to the left, one that is dark."""
    place = tmp_path_factory.mktemp("captures")
    video = make_context(simulated, place).capture.frames
    with open_footage(video) as footage:
        frames = np.stack(footage.spread(N_FRAMES))
    contexts = list[CaptureContext]()
    for name in ("a", "b", "c", "odd", "dark"):
        folder = place / name
        folder.mkdir()
        shown = np.roll(frames, SHIFT_PX, axis=2) if name == "odd" else frames * np.uint8(name != "dark")
        for number, frame in enumerate(shown):
            cv2.imwrite(str(folder / f"{number:03d}.png"), frame)
        pattern = str(folder / "*.png")
        contexts.append(make_context(simulated, place / "store", id=name, frames=pattern, spheres=[], markup=None))
    return ObjectCaptures(tuple(contexts), tuple(contexts), "catalogue.yaml", len(contexts))


@pytest.fixture(scope="module")
def surveys(captures: ObjectCaptures) -> list[tuple[StageRecord, ...]]:
    """The records of the captures that are not dark, which are surveyed."""
    return [tuple(perform_all(work, "survey")) for work in captures.chosen[:-1]]


def test_the_spheres_of_an_objects_captures_are_compared(
    captures: ObjectCaptures, surveys: list[tuple[StageRecord, ...]], cluster: Cluster
) -> None:
    *seen, _ = captures.chosen
    results = [
        CaptureResult("glass", work.capture.id, 1.0, records) for work, records in zip(seen, surveys, strict=True)
    ]
    refused = CaptureResult("glass", "dark", 1.0, (), "no chrome sphere found in a frame", "put one there", True)
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
    unread = replace(
        refused,
        error="no frame can be read from /data/hemisphere.mp4",
        remedy="record it again",
        failed_for_sphere=False,
    )
    with activate(cluster.client, sink):
        assert with_agreement(captures, [*results, unread])[-1] == unread


@pytest.mark.usefixtures("surveys")
@pytest.mark.parametrize("failed", [set[str](), {"dark"}])
def test_a_capture_whose_address_cannot_be_used_does_not_keep_the_others_from_being_compared(
    captures: ObjectCaptures, failed: set[str]
) -> None:
    *seen, dark = captures.chosen
    misnamed = replace(dark, capture=dark.capture.model_copy(update={"mask": "http://host/mask.png"}))
    warnings, _ = compare_captures([*seen, misnamed], failed, ())
    assert list(warnings) == ["odd"]


def test_one_capture_is_compared_with_nothing(captures: ObjectCaptures, cluster: Cluster) -> None:
    alone = replace(captures, chosen=captures.chosen[-1:], all=captures.chosen[-1:])
    result = CaptureResult("glass", "dark", 1.0, (), "no chrome sphere found in a frame", "put one there", True)
    with activate(cluster.client):
        assert with_agreement(alone, [result]) == (result,)


@pytest.mark.parametrize(
    ("error", "failed_for_sphere"),
    [
        (UnusableSphere("no chrome sphere found", "put one there"), True),
        (MisplacedSphere("the sphere leaves the frame", "correct it"), True),
        (InputError("no frame can be read from the sphere of /data/hemisphere.mp4", "record it again"), False),
    ],
)
def test_a_result_states_whether_its_error_is_one_of_the_spheres(
    error: Exception, failed_for_sphere: bool, cluster: Cluster
) -> None:
    def process() -> list[StageRecord]:
        raise error

    with activate(cluster.client):
        result = run_reported("glass", "dark", process)
    assert result.failed_for_sphere is failed_for_sphere and result.error
