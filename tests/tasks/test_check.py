"""A check of a capture that can be processed, and of one that cannot."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from glint.storage.inputs.lp_file import write_lights
from glint.tasks.check import check
from tests.tasks.make_context import make_context


def test_a_capture_has_a_verdict_and_its_picture(simulated: Path, tmp_path: Path) -> None:
    result = check(make_context(simulated, tmp_path / "store"), tmp_path / "out", lambda *_: None)
    assert result.error == "" and result.frames == 300
    assert result.verdict.word in ("good", "usable")
    assert result.picture is not None and result.picture in result.pictures


def test_a_failed_capture_has_a_verdict_and_a_picture(simulated: Path, tmp_path: Path) -> None:
    work = make_context(simulated, tmp_path / "store", spheres=[{"x": 500.0, "y": 20.0, "radius": 22.0}])
    result = check(work, tmp_path / "out", lambda *_: None)
    assert result.verdict.word == "correct the catalogue" and "500.0" in result.error
    assert (result.frames, result.lights, result.observable, result.observed) == (None,) * 4
    assert result.picture == tmp_path / "out" / "overview.png"
    picture = cv2.imread(str(result.picture))
    assert picture is not None and picture.max() > 200, "highlights show in the brightest of the frames"


def test_a_sphere_given_on_the_background_is_named(simulated: Path, tmp_path: Path) -> None:
    work = make_context(simulated, tmp_path / "store", spheres=[{"x": 30.0, "y": 65.0, "radius": 12.0}])
    result = check(work, tmp_path / "out", lambda *_: None)
    assert result.verdict.word == "needs a sphere" and "(30.0, 65.0)" in result.verdict.reason


def test_an_address_that_cannot_be_read_has_a_verdict(simulated: Path, tmp_path: Path) -> None:
    work = make_context(simulated, tmp_path / "store", frames="https://example.org/video.mp4")
    result = check(work, tmp_path / "out", lambda *_: None)
    assert result.verdict.word == "correct the catalogue" and "https://" in result.error and result.pictures == ()


@pytest.mark.parametrize("name", ["lights", "markup"])
def test_a_wrong_file_is_found_before_anything_is_decoded(simulated: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / "wrong").write_text("12\nnonsense\n")
    spheres: dict[str, object] = {"spheres": []} if name == "lights" else {}
    work = make_context(simulated, tmp_path / "store", **{name: str(tmp_path / "wrong")}, **spheres)
    stages: list[str] = []
    result = check(work, tmp_path / "out", lambda stage, *_: stages.append(stage))
    assert result.verdict.word == "correct the catalogue" and stages == []


@pytest.mark.parametrize(
    ("place", "says"),
    [({"frame": 5000}, "5000, x 60, y 60 is after the last frame, 299"), ({"x": 3.0, "y": 3.0}, "lies outside the ")],
)
def test_a_mark_elsewhere_is_found(simulated: Path, tmp_path: Path, place: dict[str, float], says: str) -> None:
    mark = {"frame": 150, "x": 60.0, "y": 60.0, "kind": "true", **place}
    (tmp_path / "marks.json").write_text(json.dumps([mark]))
    work = make_context(simulated, tmp_path / "store", markup=str(tmp_path / "marks.json"))
    result = check(work, tmp_path / "out", lambda *_: None)
    assert result.verdict.word == "correct the catalogue" and says in result.error


def test_a_verdict_says_that_known_lights_are_not_compared(simulated: Path, tmp_path: Path) -> None:
    given = np.load(Path(str(make_context(simulated, tmp_path / "store").capture.truth)) / "lights.npy")
    lights = np.where(np.isfinite(given[:, :1]), given, (0.0, 0.0, -1.0))
    write_lights(tmp_path / "a.lp", lights, [str(number) for number in range(len(lights))])
    work = make_context(simulated, tmp_path / "store", spheres=[], lights=str(tmp_path / "a.lp"))
    result = check(work, tmp_path / "out", lambda *_: None)
    assert result.verdict.word in ("good", "usable")
    assert result.verdict.reason.endswith("only `glint run` compares the lights of the `.lp` file with the object")
