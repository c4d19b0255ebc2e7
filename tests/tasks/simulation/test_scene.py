"""All stages on a scene drawn from formulas, against its exact truth; one chrome sphere, two, and a misplaced one."""

from pathlib import Path

import numpy as np
import pytest

from glint.storage.catalogue.loading import load
from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of
from glint.tasks.evaluation.captures import evaluate
from glint.tasks.pipeline import STAGES
from tests.scene import BALLS, REGION, Scene, draw_scene
from tests.tasks.make_context import make_context, perform_all

NAMES = tuple(stage.name for stage in STAGES)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return draw_scene(tmp_path_factory.mktemp("scene"), balls=2)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("store")


def test_lights_agree_with_the_formula_and_the_spheres_with_each_other(scene: Scene, store: Path) -> None:
    work = make_context(scene.catalogue, store)
    perform_all(work, "lights")
    found = work.load("lights")
    error = angles(found.read("lights"), scene.lights)
    assert (found.read("reason") == 0).all()
    assert np.median(error) < 0.58 and np.max(error) < 2.15
    assert np.abs(np.mean(found.read("lights") - scene.lights, axis=0)).max() < 2.3e-4, "no bias"
    assert 0.22 < found.record["disagreement_degrees"]["median"] < 0.34
    assert found.record["near_light"] is None, "the light is far away"


def test_two_spheres_are_better_than_either(scene: Scene, store: Path, tmp_path: Path) -> None:
    given = load(scene.catalogue).objects[0].captures[0].model_dump(mode="json")["spheres"]
    errors: list[float] = []
    for spheres in (given, given[:1], given[1:]):
        work = make_context(scene.catalogue, tmp_path / str(len(errors)), spheres=spheres)
        perform_all(work, "lights")
        errors.append(float(np.nanmean(angles(work.load("lights").read("lights"), scene.lights))))
        assert (work.load("lights").record["disagreement_degrees"] is None) == (len(spheres) == 1)
    assert errors[0] < 0.82 * min(errors[1:])


def test_a_misplaced_sphere_is_measured_and_told(scene: Scene, tmp_path: Path) -> None:
    given = load(scene.catalogue).objects[0].captures[0].model_dump(mode="json")["spheres"]
    given[1]["x"] += 1.0
    work = make_context(scene.catalogue, tmp_path / "store", spheres=given)
    survey, *_ = perform_all(work, "lights")
    assert ["correct `spheres`" in warning.message for warning in survey.warnings] == [True]
    assert [sphere["x"] for sphere in work.load("survey").record["spheres"]] == pytest.approx(
        [sphere.x for sphere in BALLS], abs=0.1
    )
    assert work.load("lights").record["disagreement_degrees"]["median"] < 0.45


def test_clusters_hold_the_true_and_the_false_directions(scene: Scene, store: Path) -> None:
    work = make_context(scene.catalogue, store)
    perform_all(work, "clusters")
    normals = work.load("clusters").read("normals")
    for field in (scene.normals, scene.false):
        observable = scene.mask & (np.nan_to_num(field[..., 2]) > np.cos(np.radians(40.0)))
        degrees = angles(np.nan_to_num(normals), np.nan_to_num(field)[None])
        nearest = np.where(np.isfinite(normals[..., 0]), degrees, 180.0).min(axis=0)[observable]
        assert observable.sum() > 300
        assert (nearest < 2.5).mean() > 0.991
    assert (work.load("clusters").read("observations")[~scene.mask] == 0).all()


def test_the_surface_is_that_of_the_formula(scene: Scene, store: Path) -> None:
    work = make_context(scene.catalogue, store)
    perform_all(work)
    found = evaluate(work, NAMES)
    assert found is not None
    ours, silhouette = found.method("glint"), found.method("silhouette only")
    assert found.method("winner takes all").observed_region.squared > 0.22, "false highlights mislead the baseline"
    assert (
        ours.observed_region.squared < 0.023 * silhouette.observed_region.squared
        and ours.whole_mask.squared < 0.21 * silhouette.whole_mask.squared
    )
    assert ours.observed_region.squared < 1.5e-4 and ours.whole_mask.squared < 0.0017
    labels = work.load("labels")
    names = labels.record["provenance"]
    observed = labels.read("provenance") == names.index("observed")
    assert observed.sum() > 900
    assert (angles(labels.read("normals"), scene.normals)[observed] < 5.0).mean() > 0.995
    depth = work.load("depth").read("depth")
    inner = scene.mask & (scene.depth > 8.0)
    error = (depth - scene.depth)[inner]
    assert np.std(error) < 0.0114 * np.ptp(scene.depth[inner])


def test_two_spheres_are_detected(scene: Scene, tmp_path: Path) -> None:
    work = make_context(scene.catalogue, tmp_path / "store", spheres=[])
    perform_all(work, "lights")
    found = sorted(work.load("survey").record["spheres"], key=lambda each: each["y"])
    assert len(found) == 2
    for each, true in zip(found, BALLS, strict=True):
        assert np.hypot(each["x"] - true.x, each["y"] - true.y) < 0.105 and abs(each["radius"] / true.radius - 1) < 0.01
    assert np.median(angles(work.load("lights").read("lights"), scene.lights)) < 0.67


@pytest.mark.usefixtures("smooth_labels")
def test_annotations_overrule_highlights(scene: Scene, store: Path, tmp_path: Path) -> None:
    """A highlight of the far side that is annotated as true takes precedence over the labelling."""
    field = np.nan_to_num(scene.false)
    half_vectors = half_vectors_of(scene.lights)
    row, column = 22, 38
    frame = int((half_vectors @ field[row, column]).argmax())
    lit = np.argwhere((field @ half_vectors[frame]) > np.cos(np.radians(2.0)))
    y, x = lit.mean(axis=0)
    results = {}
    for kind in ("true", "false"):
        path = tmp_path / f"{kind}.json"
        path.write_text(f'[{{"frame": {frame}, "x": {x + REGION.x:.1f}, "y": {y + REGION.y:.1f}, "kind": "{kind}"}}]')
        work = make_context(scene.catalogue, tmp_path / kind, markup=str(path))
        perform_all(work, "labels")
        pixels = work.load("markup").read("pixels")
        assert len(pixels) and (np.hypot(*(pixels - (y, x)).T) < 1.5).any()
        place = tuple(pixels[np.hypot(*(pixels - (y, x)).T).argmin()])
        results[kind] = work.load("labels").read("normals")[place]
        target = field[place] if kind == "true" else scene.normals[place]
        assert angles(results[kind], target) < {"true": 2.5, "false": 0.4}[kind]
    assert angles(results["true"], results["false"]) > 28.0


@pytest.mark.usefixtures("smooth_labels")
def test_few_frames_give_a_whole_surface(tmp_path: Path) -> None:
    """With three dozen frames little is observed; the surface is whole, and other pixels do not count as observed."""
    few = draw_scene(tmp_path / "few", frames=36)
    work = make_context(few.catalogue, tmp_path / "store")
    records = {record.stage: record for record in perform_all(work)}
    assert any("photographs show highlights on" in warning.message for warning in records["clusters"].warnings)
    labels, seen = work.load("labels"), work.load("clusters").read("observations") > 0
    observed = labels.read("provenance") == labels.record["provenance"].index("observed")
    assert not (observed & ~seen).any()
    assert np.isfinite(labels.read("normals")[few.mask]).all() and np.isfinite(work.load("depth").read("depth")).any()
