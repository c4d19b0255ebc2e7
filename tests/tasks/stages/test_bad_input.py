"""Bad input of every kind is refused early, with the offending value and what to do about it."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from glint.flows.review.remedies import on_page
from glint.storage.catalogue.loading import CatalogueError, load
from glint.storage.errors import GlintError, InputError, StoreError
from glint.storage.footage.source import open_footage
from glint.tasks.algorithms.errors import UnusableCapture, UnusableSphere
from glint.tasks.engine.references import load_catalogue
from tests.storage.footage.videos import write_images, write_video
from tests.tasks.algorithms.lighting.chrome_table import Scene, render
from tests.tasks.make_context import make_context, perform_all


@pytest.fixture(scope="module")
def frames(simulated: Path) -> list[np.ndarray]:
    with open_footage(load(simulated).objects[0].captures[0].frames) as footage:
        return [frame.copy() for frame in footage.frames()][:120]


Refused = Callable[..., Exception]


@pytest.fixture
def refused(simulated: Path, tmp_path: Path) -> Refused:
    """Run the changed capture until it is refused, and give the refusal."""

    def run(**changed: Any) -> Exception:
        with pytest.raises((GlintError, UnusableCapture)) as caught:
            perform_all(make_context(simulated, tmp_path / "store", **changed))
        error = caught.value
        assert getattr(error, "remedy", ""), "says what to do"
        return error

    return run


def test_missing_video(refused: Refused, tmp_path: Path) -> None:
    assert str(tmp_path / "no.mp4") in str(refused(frames=str(tmp_path / "no.mp4")))


def test_corrupt_video(refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "bad.mp4").write_bytes(os.urandom(20_000))
    error = refused(frames=str(tmp_path / "bad.mp4"))
    assert isinstance(error, InputError) and "bad.mp4" in error.message


def test_empty_mask(refused: Refused, simulated: Path, tmp_path: Path) -> None:
    mask = cv2.imread(str(load(simulated).objects[0].captures[0].mask), cv2.IMREAD_GRAYSCALE)
    cv2.imwrite(str(tmp_path / "mask.png"), np.zeros_like(mask))
    assert "empty" in str(refused(mask=str(tmp_path / "mask.png")))


def test_mask_of_the_wrong_size(refused: Refused, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "mask.png"), np.full((33, 44), 255, np.uint8))
    assert "44 x 33" in str(refused(mask=str(tmp_path / "mask.png")))


@pytest.mark.parametrize("focal", [35.0, 1.2])
def test_a_camera_matrix_that_is_not_in_pixels(refused: Refused, focal: float) -> None:
    error = refused(camera={"matrix": [[focal, 0.0, 12.0], [0.0, focal, 8.0], [0.0, 0.0, 1.0]]})
    assert f"focal length of {focal:g}" in str(error) and "the matrix is in pixels" in str(error)


def test_sphere_out_of_frame(refused: Refused) -> None:
    error = refused(spheres=[{"x": 400.0, "y": 20.0, "radius": 22.0}])
    assert "400.0" in str(error) and "leaves the frame" in str(error)


def test_a_given_circle_beside_the_sphere(refused: Refused) -> None:
    error = refused(spheres=[{"x": 100.0, "y": 12.0, "radius": 9.0}])
    assert isinstance(error, UnusableSphere) and error.message.startswith("the sphere at (100.0, 12.0)")
    assert "no moving light" in error.message and error.remedy.startswith("correct `spheres` in the catalogue if")
    assert on_page(error.remedy).startswith("correct its circle with Spheres if the chrome sphere lies elsewhere; if")


def test_no_sphere_to_be_found(refused: Refused, tmp_path: Path) -> None:
    path = write_video(tmp_path / "table.mp4", list(render(Scene([]))))
    assert "no chrome sphere" in str(refused(frames=str(path), spheres=[], mask=None))


def test_region_out_of_frame(refused: Refused) -> None:
    error = refused(region={"x": 10, "y": 10, "width": 5000, "height": 20}, mask=None)
    assert "5009" in str(error)


@pytest.mark.parametrize("is_masked", [True, False])
def test_frames_one_pixel_high(refused: Refused, frames: list[np.ndarray], tmp_path: Path, is_masked: bool) -> None:
    strips = [frame[40:41] for frame in frames]
    cv2.imwrite(str(tmp_path / "mask.png"), np.full(strips[0].shape[:2], 255, np.uint8))
    mask = str(tmp_path / "mask.png") if is_masked else None
    error = refused(frames=str(write_images(tmp_path / "strips", strips)[0].parent), mask=mask, region=None)
    assert f"the frames are {strips[0].shape[1]} x 1 pixels, too small for any object" in str(error)


@pytest.mark.parametrize(("width", "height"), [(40, 1), (3, 40)])
def test_a_region_of_a_line(refused: Refused, width: int, height: int) -> None:
    error = refused(region={"x": 10, "y": 10, "width": width, "height": height}, mask=None)
    assert f"is {width} x {height} pixels, too small for any object" in str(error)


def test_a_region_that_misses_the_object(refused: Refused, simulated: Path) -> None:
    region = load(simulated).objects[0].captures[0].region
    assert region is not None
    beside = {"x": 0, "y": 0, "width": region.x, "height": 20}
    error = refused(region=beside, mask=None)
    assert f"no object is found in the region x 0 to {region.x - 1}, y 0 to 19: no highlight, 0 of" in str(error)


@pytest.mark.parametrize("region", [None, {"x": 0, "y": 0, "width": 120, "height": 90}])
def test_flashes_that_are_no_connected_area(refused: Refused, tmp_path: Path, region: dict[str, int] | None) -> None:
    generator = np.random.default_rng(0)
    levels = 100.0 + 10.0 * np.sin(np.arange(40) / 3.0)[:, None, None] * np.linspace(0.8, 1.2, 120)
    frames = (levels + generator.normal(0.0, 2.0, (40, 90, 120))).astype(np.uint8)
    for number, frame in enumerate(frames):
        frame[40 + number % 16, 50 + number % 16] = 255
    write_images(tmp_path / "images", list(frames))
    error = refused(
        frames=str(tmp_path / "images"),
        mask=None,
        region=region,
        spheres=[{"x": 20.0, "y": 20.0, "radius": 10.0}],
    )
    assert "what flashes is no connected area" in str(error) and "paint a mask" in str(error)
    assert ("in the region x 0 to 119, y 0 to 89" in str(error)) == (region is not None)


def test_no_light_in_any_frame(refused: Refused, frames: list[np.ndarray], tmp_path: Path) -> None:
    still = [frames[0].clip(0, 60)] * 80
    path = write_video(tmp_path / "still.mp4", still)
    assert "no moving light" in str(refused(frames=str(path)))


def test_too_few_lights_before_the_object(refused: Refused, simulated: Path, tmp_path: Path) -> None:
    """The reasons why frames are rejected tell whether the light, the sphere or the mask is to be moved."""
    capture = load(simulated).objects[0].captures[0]
    z = np.load(Path(str(capture.truth)) / "lights.npy")[:, 2]
    with open_footage(capture.frames) as footage:
        film = [frame.copy() for frame in footage.frames()]
    chosen = [*np.flatnonzero(z < 0.0), *np.flatnonzero(np.isnan(z)), int(np.nanargmax(z))]
    write_images(tmp_path / "images", [film[number] for number in chosen])
    error = refused(frames=str(tmp_path / "images"))
    expected = (
        "1 of 7 frames has a light before the object (rejected: 3 no light, 3 behind the object): record for longer"
    )
    assert str(error).startswith(expected)


def test_one_frame(refused: Refused, frames: list[np.ndarray], tmp_path: Path) -> None:
    path = write_video(tmp_path / "one.mp4", frames[40:41])
    error = refused(frames=str(path))
    assert isinstance(error, UnusableCapture) and "1" in error.message


def test_all_frames_dark(refused: Refused, frames: list[np.ndarray], tmp_path: Path) -> None:
    path = write_video(tmp_path / "dark.mp4", [np.full_like(frame, 3) for frame in frames])
    assert isinstance(refused(frames=str(path)), UnusableCapture)


def test_all_frames_saturated(refused: Refused, frames: list[np.ndarray], tmp_path: Path) -> None:
    path = write_video(tmp_path / "white.mp4", [np.full_like(frame, 255) for frame in frames])
    assert isinstance(refused(frames=str(path)), UnusableCapture)


def test_object_that_never_glints(refused: Refused, frames: list[np.ndarray], simulated: Path, tmp_path: Path) -> None:
    region = load(simulated).objects[0].captures[0].region
    assert region is not None
    dull = [frame.copy() for frame in frames]
    for frame in dull:
        frame[region.rows, region.columns] = 40
    path = write_video(tmp_path / "dull.mp4", dull)
    assert "shows no highlights" in str(refused(frames=str(path)))


def test_object_that_is_always_saturated(
    refused: Refused, frames: list[np.ndarray], simulated: Path, tmp_path: Path
) -> None:
    region = load(simulated).objects[0].captures[0].region
    assert region is not None
    bright = [frame.copy() for frame in frames]
    for frame in bright:
        frame[region.rows, region.columns] = 254
    path = write_video(tmp_path / "bright.mp4", bright)
    assert "saturated" in str(refused(frames=str(path)))


@pytest.mark.parametrize("row", ["a nan 0 1", "a 0 0 0", "a inf 0 1", "nothing"])
def test_lights_that_are_no_directions(refused: Refused, tmp_path: Path, row: str) -> None:
    rows = ["300", *["a 0 0.1 1"] * 150, row, *["a 0.1 0 1"] * 149]
    (tmp_path / "lights.lp").write_text("\n".join(rows))
    error = refused(spheres=[], lights=str(tmp_path / "lights.lp"))
    assert "lights.lp:152" in str(error)


def test_lights_of_the_wrong_number(refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "lights.lp").write_text("\n".join(["7", *["a 0 0.1 1"] * 7]))
    error = refused(spheres=[], lights=str(tmp_path / "lights.lp"))
    assert "7 lights for 300 frames" in str(error)


def test_markup_outside_the_object(refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "markup.json").write_text(
        '[{"frame": 3, "x": 1.0, "y": 2.0, "kind": "true"},\n {"frame": 900, "x": 40, "y": 40, "kind": "false"}]'
    )
    error = refused(markup=str(tmp_path / "markup.json"))
    assert "outside the region" in str(error) and "after the last frame" in str(error)


def test_truncated_video_gives_its_readable_part(simulated: Path, tmp_path: Path, frames: list[np.ndarray]) -> None:
    whole = write_video(tmp_path / "whole.avi", frames, codec="mjpeg", pixels="yuvj420p")
    (tmp_path / "cut.avi").write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    record = perform_all(make_context(simulated, tmp_path / "store", frames=str(tmp_path / "cut.avi")), "frames")[-1]
    assert 20 < record.counts["frames"] < 120
    assert any(str(int(record.counts["frames"]) - 1) in warning.message for warning in record.warnings), record.warnings


def test_catalogue_errors_all_at_once(tmp_path: Path) -> None:
    path = tmp_path / "catalogue.yaml"
    path.write_text(
        "schema: 1\nname: bad\nobjekts: []\nobjects:\n  - id: ../escape\n    captures:\n      - id: front\n"
        "        frames: a.mp4\n        sphere: []\n        parameters: {labels: {metod: paper}}\n"
        "      - id: front\n        frames: b.mp4\n        pixel_size: -1\n"
    )
    with pytest.raises(CatalogueError) as caught:
        load_catalogue(path)
    told = str(caught.value)
    for part in ("objekts", "../escape", "sphere", "metod", "pixel_size", "front"):
        assert part in told, part
    for line in (":3:", ":5:", ":9:", ":10:", ":11:", ":13:"):
        assert line in told, line
    assert "spheres" in told and "method" in told and "objects" in told


@pytest.mark.parametrize("name", ["../up", "/etc", "a/b", "A", "", "x" * 65, ".hidden"])
def test_ids_that_try_to_leave_their_folder(tmp_path: Path, name: str) -> None:
    path = tmp_path / "catalogue.yaml"
    path.write_text(f'schema: 1\nname: bad\nobjects:\n  - id: "{name}"\n    captures: [{{id: a, frames: a.mp4}}]\n')
    with pytest.raises(CatalogueError, match="id"):
        load_catalogue(path)


def test_unwritable_store(simulated: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(StoreError) as caught:
        perform_all(make_context(simulated, tmp_path / "file" / "store"))
    assert "file" in str(caught.value) and caught.value.remedy


def test_killed_in_the_middle_goes_on(simulated: Path, tmp_path: Path) -> None:
    """A process that dies without a word after its third stage leaves three stages done."""
    script = (
        "import os, sys\nfrom pathlib import Path\nfrom tests.tasks.make_context import make_context, perform_all\n"
        f"perform_all(make_context(Path({str(simulated)!r}), Path({str(tmp_path / 'store')!r})), 'lights')\n"
        "os.kill(os.getpid(), 9)\n"
    )
    ended = subprocess.run([sys.executable, "-c", script], cwd=Path(__file__).parents[3])
    assert ended.returncode == -9
    records = perform_all(make_context(simulated, tmp_path / "store"), "thresholds")
    assert [record.cached for record in records] == [True] * 3 + [False] * 2
