"""*Run from here*: what a person has set on the page is what the run takes, and the page follows it to its version."""

import json
import os
import shutil
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glint import reading
from glint.flows.review.runs import Run, Runs, note
from glint.flows.runtime import signals
from glint.flows.runtime.prefect_server import Server
from glint.storage.catalogue.loading import Capture, Catalogue, Object, load, write
from glint.storage.edits.edits import Edits
from glint.storage.locations.location import Location
from tests.flows.review.conftest import ServedPage, Tab, let_in, serve
from tests.flows.review.inputs_view import INPUTS, READY, drag, saved
from tests.pictures import read_picture

pytestmark = [pytest.mark.server, pytest.mark.slow]

LEAK = range(84, 188, 8)
"""Rows of the region in the middle of strokes that together erase what leaks."""
RUN_MS = 280_000
"""Longest wait for a run, in milliseconds: several share the machine."""


def run_from_here(tab: Tab, version: str) -> None:
    """Press the button, and wait for the version that the run makes."""
    tab.page.click("text=Run from here")
    tab.page.wait_for_selector(f"aside .run .good >> text=done: {version}", timeout=RUN_MS)


def test_progress_is_what_the_run_reports() -> None:
    run = Run("glass/front")
    note(run, {"kind": "progress", "capture": "glass/front", "stage": "frames", "done": 40, "total": 160})
    note(run, {"kind": "progress", "capture": "glass/back", "stage": "survey", "done": 1, "total": 2})
    assert (run.stage, run.done, run.total) == ("frames", 40, 160)
    note(run, {"kind": "stage", "capture": "glass/front", "stage": "survey", "seconds": 0.1, "cached": True})
    assert run.stages == {"survey": None}
    row = {"capture": "glass/front", "error": "no sphere", "remedy": "give one", "version": ""}
    note(run, {"kind": "summary", "captures": [row]})
    assert (run.state, run.error, run.remedy) == ("failed", "no sphere", "give one")


def test_the_run_of_an_object_reports_all_its_captures() -> None:
    run = Run("glass")
    note(run, {"kind": "progress", "capture": "glass/front", "stage": "frames", "done": 40, "total": 160, "share": 0.5})
    note(run, {"kind": "progress", "capture": "glasses/front", "stage": "survey", "done": 1, "total": 2})
    assert (run.stage, run.done, run.total, run.share) == ("front: frames", 40, 160, None)
    for capture in ("front", "back"):
        note(run, {"kind": "stage", "capture": f"glass/{capture}", "stage": "survey", "seconds": 0.1, "cached": True})
    note(run, {"kind": "progress", "capture": "glass/model", "stage": "model", "done": 1, "total": 45})
    assert run.stage == "model", "said once"
    note(run, {"kind": "stage", "capture": "glass/model", "stage": "model", "seconds": 2.0})
    assert run.stages == {"front: survey": None, "back: survey": None, "model": 2.0}
    rows = [
        {"capture": "glass/front", "error": "", "remedy": "", "version": "v2"},
        {"capture": "glass/back", "error": "no sphere", "remedy": "give one", "version": "v2"},
    ]
    note(run, {"kind": "summary", "captures": rows})
    assert (run.state, run.error, run.remedy, run.version) == ("failed", "back: no sphere", "give one", "v2")
    run = Run("glass")
    note(run, {"kind": "summary", "captures": rows[:1]})
    assert (run.state, run.error, run.version) == ("done", "", "v2")


def test_the_run_of_a_capture_is_done_though_the_model_of_its_object_fails() -> None:
    rows = [
        {"capture": "glass/front", "error": "", "remedy": "", "version": "v2"},
        {"capture": "glass/model", "error": "the views do not meet", "remedy": "add one", "version": "v2"},
    ]
    program = f"import sys; print({json.dumps({'kind': 'summary', 'captures': rows})!r}); sys.exit(1)"
    for name, state, error in (("glass/front", "done", ""), ("glass", "failed", "model: the views do not meet")):
        run = Run(name)
        Runs("store")._follow(run, [sys.executable, "-c", program])
        assert (run.state, run.error, run.version) == (state, error, "v2")


def test_a_run_whose_reports_are_not_understood_ends_as_failed() -> None:
    report = json.dumps({"kind": "summary", "captures": [{"capture": "glass/front"}]})
    runs, run = Runs("store"), Run("glass/front")
    runs._follow(run, [sys.executable, "-c", f"print({report!r})"])
    assert run.state == "failed" and "cannot be followed" in run.error and runs.revision == 1


def test_a_run_that_was_stopped_says_so_and_how_it_goes_on() -> None:
    run = Run("glass/front")
    Runs("store")._follow(run, [sys.executable, "-c", f"import sys; sys.exit({signals.LINE!r})"])
    told = run.to_json()
    assert (told["state"], told["error"]) == ("failed", "the run was interrupted")
    assert told["remedy"].startswith("run again: it goes on where it stopped")


def test_a_moved_sphere_is_used_by_the_run_and_only_what_depends_on_it_is_computed(
    server: Server, tmp_path: Path, stored: tuple[Path, Path], chromium: Any
) -> None:
    store = tmp_path / "store"
    shutil.copytree(stored[0], store)
    served = serve(store, stored[1])
    for tab in let_in(served, chromium):
        tab.open(INPUTS, READY)
        tab.page.keyboard.press("s")
        for _ in range(2):
            tab.page.keyboard.press("ArrowRight")
        tab.page.wait_for_selector(".sphere [role=status] >> text=off the contour")
        tab.page.wait_for_timeout(600)
        tab.page.fill("aside input[autocomplete=name]", "Ada")
        run_from_here(tab, "v2")
    (sphere,) = Edits.open(Location.parse(store), "hemisphere").current("front").spheres or ()
    entry = reading.open(store)["hemisphere"].latest.metadata["captures"]["front"]
    assert entry["edits"]["revision"] == 1
    assert entry["entry"]["spheres"][0]["x"] == sphere.x
    served.stop()


def test_a_run_is_stopped_and_the_next_one_goes_on_from_there(
    server: Server, tmp_path: Path, stored: tuple[Path, Path], chromium: Any
) -> None:
    served = serve(tmp_path / "store", stored[1])
    for tab in let_in(served, chromium):
        tab.open(INPUTS, "aside .run")
        tab.page.click("text=Run from here")
        tab.page.wait_for_selector("aside .run >> text=/survey|frames|lights/", timeout=RUN_MS)
        tab.page.click("aside .run button:has-text('Stop')")
        tab.page.wait_for_selector("aside .run >> text=stopped: what is finished is kept", timeout=RUN_MS)
        run_from_here(tab, "v1")
    served.stop()


@pytest.fixture
def leaking(tmp_path: Path, shared_data: Path) -> Iterator[tuple[ServedPage, Path]]:
    """The shared hemisphere with a mask that leaks over the table, up to the region's edge, and its page."""
    import cv2

    captures = shared_data / "captures"
    (entry,) = (item for item in load(captures / "single-views.yaml").objects if item.id == "hemisphere")
    capture = entry.captures[0].model_dump(mode="json", exclude_none=True)
    region = entry.captures[0].region
    assert region is not None
    mask = read_picture(Path(capture["mask"]), cv2.IMREAD_GRAYSCALE)
    mask[LEAK.start - 4 : LEAK.stop + 4, : mask.shape[1] // 3] = 255
    cv2.imwrite(str(tmp_path / "leaking.png"), mask)
    capture["mask"] = str(tmp_path / "leaking.png")
    objects = (Object(id="hemisphere", captures=(Capture.model_validate(capture),)),)
    write(Catalogue.model_validate({"schema": 1, "name": "leaking", "objects": objects}), tmp_path / "catalogue.yaml")
    served = serve(tmp_path / "store", tmp_path / "catalogue.yaml")
    yield served, captures / "hemisphere/front"
    served.stop()


@pytest.mark.shared
@pytest.mark.timeout(900)
def test_a_person_repairs_a_leaking_mask_of_the_shared_hemisphere_until_the_run_is_right(
    server: Server, leaking: tuple[ServedPage, Path], chromium: Any
) -> None:
    served, folder = leaking
    truth = np.load(folder / "truth/normals.npy")
    errors = []
    for tab in let_in(served, chromium):
        page = tab.open(INPUTS, READY)
        run_from_here(tab, "v1")
        page.wait_for_selector("h2 >> text=/good|usable|needs|record/")
        errors.append(mean_error(served, truth))
        page.wait_for_selector("section[data-pixels]")
        page.keyboard.press("e")
        region = served.app.state.review.context("hemisphere", "front").capture.region
        for row in LEAK:
            drag(tab, (region.x, region.y + row), (region.x + leak_end(truth, row), region.y + row))
        saved(tab)
        run_from_here(tab, "v2")
        errors.append(mean_error(served, truth))
        if screenshots := os.environ.get("GLINT_SCREENSHOTS"):
            page.screenshot(path=f"{screenshots}/repaired.png")
    assert errors[1] < 0.6 * errors[0]
    assert errors[1] < 1.5


def leak_end(truth: np.ndarray, row: int) -> float:
    """The column up to which the eraser of radius 4 or so may go in a row, beside the object's true edge."""
    return float(np.flatnonzero(np.isfinite(truth[row, :, 0]))[0]) - 8.0


def mean_error(served: ServedPage, truth: np.ndarray) -> float:
    """Degrees of the newest normals against the truth, on the true object."""
    normals = reading.open(served.store)["hemisphere"].latest["front"].normals
    inside = np.isfinite(truth[..., 0])
    cosine = np.where(np.isfinite(normals[..., 0]), (normals * truth).sum(-1), 0.0)[inside]
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).mean())


def test_what_runs_is_asked_of_the_interface(served: ServedPage) -> None:
    request = urllib.request.Request(f"{served.origin}/api/captures/hemisphere/front/run", headers=served.session)
    with urllib.request.urlopen(request) as answer:
        assert json.load(answer) is None
