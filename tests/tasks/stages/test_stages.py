"""All stages on a small simulated capture: results, what is computed again and what is not, and the export."""

import json
import shutil
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from glint.storage.catalogue.loading import load
from glint.storage.export.export import export
from glint.storage.footage.source import open_footage
from glint.storage.inputs.lp_file import write_lights
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals
from glint.tasks.algorithms.labelling.results import Reconstruction
from glint.tasks.engine.stage import StageRecord, stage_keys
from glint.tasks.evaluation.captures import evaluate
from glint.tasks.pipeline import STAGES
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from glint.tasks.stages import labels
from tests.pictures import read_picture
from tests.tasks.make_context import make_context, perform_all

NAMES = tuple(stage.name for stage in STAGES)
EXPORTED = {
    "normals.npy", "normals.png", "normals.exr", "initial_normals.npy", "depth.npy", "depth.tiff", "mask.png",
    "observed.png", "provenance.png", "provenance.json", "confidence.npy", "lights.lp", "half_vectors.npy",
    "frames.csv", "surface.ply", "surface.glb", "relit_left.png", "relit_front.png", "relit_right.png",
    "report.json", "report.html", "coverage.png",
}  # fmt: skip


@pytest.fixture(scope="module")
def first_run(simulated: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[StageRecord]]:
    """A store, and the records of all stages that were performed in it."""
    store = tmp_path_factory.mktemp("first") / "store"
    return store, perform_all(make_context(simulated, store))


@pytest.fixture
def store(first_run: tuple[Path, list[StageRecord]], tmp_path: Path) -> Path:
    """A copy of that store: it keeps each stage's last results alone."""
    shutil.copytree(first_run[0], tmp_path / "first")
    return tmp_path / "first"


def test_stages_beat_the_baselines_and_are_not_computed_twice(
    simulated: Path, store: Path, first_run: tuple[Path, list[StageRecord]]
) -> None:
    work, first = make_context(simulated, store), first_run[1]
    assert [record.stage for record in first] == list(NAMES) and not any(record.cached for record in first)
    assert all(record.cached for record in perform_all(work))
    found = evaluate(work, NAMES)
    assert found is not None
    ours = found.method("glint")
    for other in ("winner takes all", "silhouette only", "paper"):
        assert ours.observed_region.squared < found.method(other).observed_region.squared
        assert ours.whole_mask.squared < found.method(other).whole_mask.squared
    # A fifth above what is reached.
    assert ours.observed_region.squared < 0.0019
    assert ours.whole_mask.squared < 0.005 and ours.whole_mask.missing == 0
    assert found.confident_right_share > 0.99
    assert work.load("labels").record["counts"]["confident share"] == pytest.approx(found.confident_share, abs=1e-4)
    assert found.depth is not None and found.depth.relative < 0.025


@pytest.mark.usefixtures("smooth_labels")
def test_sheets_are_readmitted_only_in_a_capture_that_stands_alone(
    simulated: Path, store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    alone, posed = make_context(simulated, store), make_context(simulated, store, pose={"turntable": 30.0})
    keys, others = stage_keys(alone, STAGES), stage_keys(posed, STAGES)
    assert keys["clusters"] == others["clusters"] and keys["labels"] != others["labels"]
    readmissions = []

    def reconstruct(*arguments: Any, **options: Any) -> Reconstruction:
        readmissions.append(arguments[2].readmission)
        return reconstruct_normals(*arguments, **options)

    monkeypatch.setattr(labels, "reconstruct_normals", reconstruct)
    perform_all(posed, "labels")
    assert readmissions == [False]
    assert labels.has_readmission(alone.capture.pose)


def test_lights_are_those_of_the_simulation(simulated: Path, store: Path) -> None:
    work = make_context(simulated, store)
    perform_all(work, "lights")
    truth = np.load(Path(str(work.capture.truth)) / "lights.npy")
    result = work.load("lights")
    accepted = result.read("reason") == 0
    assert np.median(angles(result.read("lights")[accepted], truth[accepted])) < 0.695
    assert accepted[truth[:, 2] > 0].mean() > 0.9
    assert not accepted[~np.isfinite(truth[:, 0])].any()


def test_a_changed_parameter_redoes_what_follows_from_it(simulated: Path, store: Path) -> None:
    assert all(record.cached for record in perform_all(make_context(simulated, store)))
    changed = perform_all(make_context(simulated, store, {"labels": {"method": "paper"}}))
    assert [record.stage for record in changed if not record.cached] == ["labels", "depth", "surface"]
    with_radius = stage_keys(make_context(simulated, store, {"clusters": {"radius": 2.5}}), STAGES)
    plain = stage_keys(make_context(simulated, store), STAGES)
    same = [name for name in NAMES if with_radius[name] == plain[name]]
    assert same == ["survey", "frames", "lights", "mask", "thresholds", "markup", "silhouette"]


def test_a_changed_mask_is_noticed(simulated: Path, tmp_path: Path) -> None:
    work = make_context(simulated, tmp_path / "store")
    before = stage_keys(work, STAGES)
    mask = read_picture(Path(str(work.capture.mask)), cv2.IMREAD_GRAYSCALE)
    mask[:20] = 0
    cv2.imwrite(str(tmp_path / "mask.png"), mask)
    after = stage_keys(make_context(simulated, tmp_path / "store", mask=str(tmp_path / "mask.png")), STAGES)
    assert before["mask"] != after["mask"] and before["labels"] != after["labels"]


@pytest.mark.parametrize("method", ["sheets", "paper", "winner"])
def test_every_method_labels_the_whole_mask(simulated: Path, store: Path, method: str) -> None:
    work = make_context(simulated, store, {"labels": {"method": method}})
    perform_all(work)
    mask, labels = work.load("mask").read("mask"), work.load("labels")
    normals = labels.read("normals")
    assert np.isfinite(normals[mask]).all() and np.isnan(normals[~mask]).all()
    np.testing.assert_allclose(np.linalg.norm(normals[mask], axis=-1), 1.0, atol=1e-4)
    assert ((labels.read("provenance") > 0) == mask).all()
    assert ((labels.read("confidence")[mask] >= 0) & (labels.read("confidence")[mask] <= 1)).all()


def test_export_writes_everything(simulated: Path, store: Path, tmp_path: Path) -> None:
    work = make_context(simulated, store)
    perform_all(work)
    work.repository.publish([work.capture.id], {"run": "test"})
    export(work.location, work.object_id, tmp_path / "out")
    folder = tmp_path / "out" / "front"
    assert {path.name for path in folder.iterdir()} >= EXPORTED
    region = work.capture.region
    assert region is not None
    shape = (region.height, region.width)
    assert np.load(folder / "normals.npy").shape == (*shape, 3)
    assert np.load(folder / "depth.npy").shape == np.load(folder / "confidence.npy").shape == shape
    assert read_picture(folder / "normals.png").dtype == np.uint16
    report = json.loads((folder / "report.json").read_text())
    assert report["depth"]["unit"] == "mm" and report["region"] == region.model_dump()
    rows = (folder / "frames.csv").read_text().splitlines()
    assert rows[0] == "frame,accepted,reason" and len(rows) == 301


@pytest.mark.usefixtures("smooth_labels")
def test_known_lights_stand_in_for_the_sphere(simulated: Path, store: Path, tmp_path: Path) -> None:
    with_sphere = make_context(simulated, store)
    perform_all(with_sphere)
    truth = np.load(Path(str(with_sphere.capture.truth)) / "lights.npy")
    dark = ~np.isfinite(truth[:, 0])
    write_lights(
        tmp_path / "lights.lp", np.where(dark[:, None], (0, 0, -1), truth), [f"{i}" for i in range(len(truth))]
    )
    with_file = make_context(simulated, tmp_path / "store", spheres=[], lights=str(tmp_path / "lights.lp"))
    perform_all(with_file)
    mask = with_file.load("mask").read("mask")
    apart = angles(with_file.load("labels").read("normals"), with_sphere.load("labels").read("normals"))[mask]
    assert np.median(apart) < 1.5
    assert with_file.load("depth").record["unit"] == "pixels"


def test_sphere_region_and_mask_are_found(tmp_path: Path) -> None:
    options = CaptureOptions(frames=400, scale=0.5)
    simulated = simulate("hemisphere", tmp_path / "captures", options).catalogue
    given = load(simulated).objects[0].captures[0]
    work = make_context(simulated, tmp_path / "store", spheres=[], region=None, mask=None, truth=None)
    perform_all(work, "mask")
    sphere = work.load("survey").record["spheres"][0]
    true = given.spheres[0]
    assert np.hypot(sphere["x"] - true.x, sphere["y"] - true.y) < 1.0
    assert sphere["radius"] == pytest.approx(true.radius, rel=0.06)
    assert given.region is not None
    whole = np.zeros(work.load("survey").record["frame_size"][::-1], bool)
    expected = whole.copy()
    true_mask = read_picture(Path(str(given.mask)), cv2.IMREAD_GRAYSCALE) > 0
    expected[given.region.rows, given.region.columns] = true_mask
    region = work.load("survey").record["region"]
    mask = work.load("mask").read("mask")
    whole[region["y"] : region["y"] + region["height"], region["x"] : region["x"] + region["width"]] = mask
    assert (whole & expected).sum() / (whole | expected).sum() > 0.8


def test_images_give_what_their_video_gives(simulated: Path, store: Path, tmp_path: Path) -> None:
    work = make_context(simulated, store)
    perform_all(work)
    with open_footage(work.capture.frames) as footage:
        for number, frame in enumerate(footage.frames()):
            cv2.imwrite(str(tmp_path / f"img_{number}.png"), frame)
    images = make_context(simulated, tmp_path / "store", frames=str(tmp_path / "img_*.png"))
    perform_all(images, "clusters")
    np.testing.assert_array_equal(images.load("clusters").read("normals"), work.load("clusters").read("normals"))


@pytest.mark.usefixtures("smooth_labels")
def test_marks_are_tracked_and_kept(simulated: Path, tmp_path: Path) -> None:
    folder = Path(str(load(simulated).objects[0].captures[0].mask)).parent
    work = make_context(simulated, tmp_path / "store", markup=str(folder / "markup.json"))
    perform_all(work, "labels")
    marks, truth = work.load("markup"), np.load(folder / "truth" / "normals.npy")
    rows, columns = marks.read("pixels").T
    assert len(rows) >= len(json.loads((folder / "markup.json").read_text()))
    assert np.median(angles(marks.read("half_vectors"), truth[rows, columns])) < 2.5
    provenance = work.load("labels").record["provenance"]
    assert (work.load("labels").read("provenance")[rows, columns] == provenance.index("marked")).all()


@pytest.mark.usefixtures("smooth_labels")
def test_a_perspective_camera_gives_depth_too(simulated: Path, tmp_path: Path) -> None:
    camera = {"matrix": [[900.0, 0.0, 80.0], [0.0, 900.0, 60.0], [0.0, 0.0, 1.0]]}
    work = make_context(simulated, tmp_path / "store", camera=camera, pixel_size=0.5)
    perform_all(work)
    assert work.load("depth").record["distance"] == pytest.approx(450.0)
    assert np.isfinite(work.load("depth").read("depth")[work.load("mask").read("mask")]).all()


def test_frames_that_were_evicted_are_made_again(simulated: Path, tmp_path: Path) -> None:
    work = make_context(simulated, tmp_path / "store")
    perform_all(work, "mask")
    shutil.rmtree(tmp_path / "store" / "frames")
    assert not perform_all(work, "clusters")[-1].cached
