"""Frames of a camera that moved."""

from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from glint.storage.catalogue.loading import load
from glint.storage.footage.source import open_footage
from glint.storage.footage.writer import write_video
from glint.tasks.algorithms.errors import UnusableSphere
from glint.tasks.algorithms.frames.shake import shake_amplitude
from glint.tasks.algorithms.frames.stabilization import register, translate
from glint.tasks.algorithms.lighting.sphere_detection import find_spheres
from glint.tasks.engine.stage import no_progress
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from glint.tasks.stages.capture_geometry import OBJECT
from glint.tasks.stages.first_pass import SampleRecorder
from glint.tasks.stages.frames import open_frames
from glint.tasks.stages.stabilization import STEADY_PX, measure_shake, stabilized
from tests.tasks.algorithms.frames.test_stabilization import shadowed_frames
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
    as_recorded = make_context(shaken.catalogue, tmp_path / "as-recorded", {"survey": {"stabilize": False}})
    perform_all(as_recorded, "frames")
    assert np.array_equal(open_frames(as_recorded).read(OBJECT), levels["raw"])
    inner = np.s_[:, 8:-8, 8:-8]
    off = {name: np.median(np.abs(levels["still"] - levels[name])[inner]) for name in ("raw", "shaken")}
    assert off["shaken"] < 0.6 * off["raw"]


@pytest.fixture(scope="module")
def shaken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    options = CaptureOptions(frames=250, scale=0.4, rays=1, sphere_radius=25, shake=2.0, seed=3)
    return simulate("hemisphere", tmp_path_factory.mktemp("shaken"), options).catalogue


@pytest.mark.parametrize("given", [True, False])
def test_the_sphere_is_where_the_frames_are_moved_to(shaken: Path, tmp_path: Path, given: bool) -> None:
    sphere = load(shaken).objects[0].captures[0].spheres[0]
    work = make_context(shaken, tmp_path / "store", **({} if given else {"spheres": ()}))
    records = perform_all(work, "survey")
    assert work.load("survey").record["stabilization"]["applied"]
    (found,) = work.load("survey").record["spheres"]
    assert np.hypot(found["x"] - sphere.x, found["y"] - sphere.y) < 0.05 * sphere.radius
    assert not any("is seen at" in warning.message for warning in records[0].warnings)


def test_a_sphere_that_is_not_found_in_shaken_frames_is_found_in_those_moved_back(tmp_path: Path) -> None:
    options = CaptureOptions(frames=300, scale=0.4, rays=1, sphere_radius=22, shake=4.0)
    work = make_context(simulate("hemisphere", tmp_path / "shaken", options).catalogue, tmp_path / "store", spheres=())
    with open_footage(work.capture.frames) as footage:
        sample = SampleRecorder(footage, 300, no_progress).sample()
    with pytest.raises(UnusableSphere, match="no chrome sphere found"):
        find_spheres(sample.frames, sample.peak)
    perform_all(work, "survey")
    record = work.load("survey").record
    assert record["stabilization"]["applied"]
    assert abs(record["spheres"][0]["radius"] - 22.0) < 1.0


def covered_video(path: Path, shifts: np.ndarray, covered: Collection[int]) -> np.ndarray:
    """Write a video of a textured cloth that moves by shifts (T, 2); an arm lies over most of it in covered frames.

    Returns:
        The frame (H, W) float32 without shift and arm.
    """
    generator = np.random.default_rng(0)
    cloth = (90 + 250 * gaussian_filter(generator.normal(size=(160, 240)), 2)).clip(0, 255).astype(np.float32)

    def frames() -> Iterator[np.ndarray]:
        for number, shift in enumerate(shifts):
            frame = translate(cloth, shift)
            if number in covered:
                frame[:, :180] = 60.0
            yield frame.round().astype(np.uint8)

    write_video(path, frames(), 240, 160, 25, 4)
    return cloth


WALK = np.column_stack([np.linspace(-4.0, 4.0, 150), 3.0 * np.sin(np.linspace(0.0, 5.0, 150))])


def test_frames_are_moved_to_the_first_one_that_shows_its_place(tmp_path: Path) -> None:
    covered_video(tmp_path / "video.mp4", WALK, range(3))
    with open_footage(tmp_path / "video.mp4") as footage:
        shake = measure_shake(footage, to_first=True)
        other = measure_shake(footage, to_first=False)
    origin = np.subtract(shake.record["origin"], other.record["origin"])
    assert np.allclose(origin, WALK[3] - np.median(WALK, axis=0), atol=0.3)


@pytest.mark.parametrize("start", [0, 60, 64])
def test_a_frame_that_does_not_show_its_place_is_moved_as_those_before_it(tmp_path: Path, start: int) -> None:
    cloth = covered_video(tmp_path / "video.mp4", WALK, range(62, 67))
    with open_footage(tmp_path / "video.mp4") as footage:
        shake = measure_shake(footage, to_first=True)
        still = stabilized(footage, shake.record, shake.arrays)
        moved = {number: frame.astype(float) for number, frame in enumerate(still.frames(start), start)}
    inner, place = np.s_[12:-12, 190:-12], translate(cloth, WALK[0])
    assert len(moved) == 150 - start
    for number in (65, 66, 100):
        assert np.abs(moved[number] - place)[inner].mean() < 4.0, number
    assert np.abs(cloth - place)[inner].mean() > 10.0


def test_a_frame_is_moved_alike_whatever_frames_are_read(tmp_path: Path) -> None:
    covered_video(tmp_path / "video.mp4", WALK, range(41, 100))
    with open_footage(tmp_path / "video.mp4") as footage:
        shake = measure_shake(footage, to_first=True)
        assert shake.record["applied"]
        still = stabilized(footage, shake.record, shake.arrays)
        every, tenth = list(still.frames()), list(still.frames(step=10))
        later = list(still.frames(50, 10))
    for number in (40, 50, 60, 80, 110):
        assert np.array_equal(tenth[number // 10], every[number]), number
        assert number < 50 or np.array_equal(later[number // 10 - 5], every[number]), number


def test_a_shake_that_few_frames_show_is_reported(tmp_path: Path) -> None:
    covered_video(tmp_path / "video.mp4", WALK, [number for number in range(150) if number % 24 > 10])
    with open_footage(tmp_path / "video.mp4") as footage:
        shake = measure_shake(footage, to_first=True)
    assert not shake.record["applied"]
    assert [warning.cause for warning in shake.warnings] == ["camera"]


def test_shadows_that_drift_over_a_black_cloth_are_no_shake(tmp_path: Path) -> None:
    frames = np.repeat(shadowed_frames(np.zeros((24, 2)), 0.0), 5, axis=0)
    write_video(tmp_path / "video.mp4", iter(frames), 320, 240, 25, 4)
    with open_footage(tmp_path / "video.mp4") as footage:
        shake = measure_shake(footage, to_first=True)
    assert not shake.record["applied"] and not shake.warnings


@pytest.mark.slow
def test_tripods_of_the_shared_recordings_stand_still(shared_data: Path) -> None:
    """Photographs under moving lights, whose number does not matter here, and videos with drifting shadows."""
    patterns = ("psbox/LightProbe-2/Image_*.JPG", "uw_chrome/chrome/chrome.[0-9]*.png", "gold_ring/*.jpg")
    addresses = [str(shared_data / "real" / pattern) for pattern in patterns]
    for address in [*addresses, str(shared_data / "captures" / "duck" / "front" / "video.mp4")]:
        with open_footage(address) as footage:
            frames = np.stack(footage.spread(12))
        translations = register(frames)[1]
        known = translations[np.isfinite(translations[:, 0])]
        assert not len(known) or shake_amplitude(known) < STEADY_PX, address
