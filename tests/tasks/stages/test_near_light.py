"""The light's distance from simulated captures, and what half vectors may err by."""

from pathlib import Path

import numpy as np
import pytest

from glint.storage.catalogue.loading import load
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from tests.tasks.make_context import make_context, perform_all

DISTANCE_WIDTHS = 3.0


@pytest.fixture(scope="module")
def near(tmp_path_factory: pytest.TempPathFactory) -> Path:
    options = CaptureOptions(
        frames=300, scale=0.4, rays=1, seed=2, sphere_radius=20, spheres=2, light_distance=DISTANCE_WIDTHS
    )
    return simulate("hemisphere", tmp_path_factory.mktemp("near"), options).catalogue


def measured(work: CaptureContext) -> tuple[dict[str, float], float]:
    """The record of the light, and the distance's ratio to the true one."""
    perform_all(work, "lights")
    record = work.load("lights").record["near_light"]
    true = DISTANCE_WIDTHS * work.load("survey").record["frame_size"][0]
    return record, 1.0 if record is None else record["distance"] / true


def test_two_spheres_and_the_background_measure_a_near_light(near: Path, tmp_path: Path) -> None:
    pair = make_context(near, tmp_path / "pair")
    record, ratio = measured(pair)
    assert record["source"] == "spheres" and abs(ratio - 1) < 0.1
    spheres = pair.capture.model_dump(mode="json")["spheres"]
    single = make_context(near, tmp_path / "single", spheres=spheres[:1])
    record, ratio = measured(single)
    assert record["source"] == "background" and abs(ratio - 1) < 0.4
    # A lamp as near as that may stand beside the camera; two spheres exclude it, else the object has to.
    camera = single.load("lights").record["camera"]
    assert pair.load("lights").record["camera"] is None
    assert camera["is_light_near"] and camera["least_focal"] <= record["distance"]
    uncertain = [np.median(work.load("lights").read("half_vector_sd")) for work in (pair, single)]
    assert 0 < uncertain[0] < uncertain[1]


def test_a_distance_that_nothing_shows_is_told(near: Path, tmp_path: Path) -> None:
    """A dozen pictures of one sphere."""
    few = few_pictures(near, tmp_path)
    records = perform_all(few, "lights")
    assert any("nothing shows how far away the light was" in warning.message for warning in records[-1].warnings)
    assert np.degrees(few.load("lights").read("half_vector_sd")).max() > 2.0


def few_pictures(near: Path, folder: Path) -> CaptureContext:
    """The context of every 25th frame as a set of pictures, with one sphere."""
    import cv2

    from glint.storage.footage.source import open_footage

    capture = load(near).objects[0].captures[0]
    pictures = folder / "pictures"
    pictures.mkdir()
    with open_footage(capture.frames) as footage:
        for number, frame in enumerate(footage.frames(step=25)):
            cv2.imwrite(str(pictures / f"{number:02d}.png"), frame)
    entry = capture.model_copy(update={"frames": str(pictures), "spheres": capture.spheres[:1]})
    return CaptureContext(str(folder / "few"), "object", entry, Parameters(), "test")


def test_lights_are_those_of_the_object(near: Path, tmp_path: Path) -> None:
    """The truth counts from the frame's middle, where the object lies between the spheres."""
    work = make_context(near, tmp_path / "store")
    perform_all(work, "lights")
    truth = np.load(Path(str(work.capture.truth)) / "lights.npy")
    assert np.nanmedian(angles(work.load("lights").read("lights"), truth)) < 1.2


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1])
def test_a_phone_without_its_matrix_is_told_by_the_object_beside_a_single_sphere(
    shared_data: Path, tmp_path: Path, number: int
) -> None:
    entry = load(shared_data / "captures" / "field-marked.yaml").objects[1].captures[0]
    entry = entry.model_copy(update={"spheres": entry.spheres[number : number + 1]})
    work = CaptureContext(str(tmp_path), "phone", entry, Parameters(), "test")
    warnings = perform_all(work, "labels")[-1].warnings
    assert any("only under a near camera are the object's normals" in warning.message for warning in warnings)
    assert (work.load("labels").read("confidence") >= 0.95).mean() < 0.01


@pytest.mark.slow
def test_a_phone_without_its_matrix_is_told_by_two_spheres(shared_data: Path, tmp_path: Path) -> None:
    catalogue = shared_data / "captures" / "field-marked.yaml"
    entry = load(catalogue).objects[1].captures[0]
    assert entry.camera is None and len(entry.spheres) == 2
    records = {}
    for name, camera in (("without", None), ("with", load(catalogue).objects[0].captures[0].camera)):
        work = CaptureContext(
            str(tmp_path / name), "phone", entry.model_copy(update={"camera": camera}), Parameters(), "test"
        )
        records[name] = perform_all(work, "lights")[-1], work.load("lights")
    assert any("only a near camera explains" in warning.message for warning in records["without"][0].warnings)
    assert not any(warning.cause == "camera" for warning in records["with"][0].warnings)
    assert np.degrees(records["without"][1].read("half_vector_sd")).min() > 3.0
    truth = np.load(Path(str(entry.truth)) / "lights.npy")
    assert np.nanmedian(angles(records["with"][1].read("lights"), truth)) < 1.5
