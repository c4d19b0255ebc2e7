"""A run with edits gives what a catalogue of these values gives; without them, and after undo, nothing changes."""

import json
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glint.storage.catalogue.loading import load
from glint.storage.edits.edits import Edits
from glint.storage.edits.models import Changes, mask_png
from glint.storage.errors import DamagedError, InputError
from glint.storage.locations.location import Location
from glint.tasks.engine.capture_context import CaptureContext, with_edits
from glint.tasks.engine.parameters import Parameters
from glint.tasks.engine.references import CaptureReference
from glint.tasks.engine.stage import StageRecord, perform, stage_keys
from glint.tasks.pipeline import NAMES, STAGES
from glint.tasks.publish import publish
from glint.tasks.up_to_date import up_to_date_records

LAST = "labels"
pytestmark = pytest.mark.long


def context_of(catalogue: Path, store: Path) -> CaptureContext:
    loaded = load(catalogue, Parameters)
    return CaptureContext.of(loaded, "hemisphere", "front", Location.parse(store).uri, "test")


def perform_until(context: CaptureContext, last: str = LAST) -> list[StageRecord]:
    keys = stage_keys(context, STAGES)
    return [perform(context, stage, keys[stage.name]) for stage in STAGES[: NAMES.index(last) + 1]]


def arrays_of(context: CaptureContext, last: str = LAST) -> dict[str, np.ndarray]:
    stages = NAMES[: NAMES.index(last) + 1]
    return {
        f"{stage}/{name}": context.load(stage).read(name) for stage in stages for name in context.load(stage).arrays
    }


@pytest.fixture(scope="module")
def values(tiny: Path, tmp_path_factory: pytest.TempPathFactory) -> Changes:
    """A sphere moved by two pixels, a mask with a corner less, and one mark."""
    context = context_of(tiny, tmp_path_factory.mktemp("values") / "store")
    perform_until(context, "mask")
    region, small = context.load("survey").record["region"], context.load("mask").read("mask")
    width, height = context.load("survey").record["frame_size"]
    mask = np.zeros((height, width), bool)
    mask[region["y"] : region["y"] + region["height"], region["x"] : region["x"] + region["width"]] = small
    rows = np.flatnonzero(mask.any(axis=1))
    mask[: rows[0] + 6] = False
    (sphere, *_) = context.load("survey").record["spheres"]
    drawn = {"x": sphere["x"] + 2.0, "y": sphere["y"], "radius": sphere["radius"]}
    row, column = np.argwhere(mask)[len(np.argwhere(mask)) // 2].tolist()
    marks = [{"frame": 3, "x": float(column), "y": float(row), "kind": "true"}]
    return Changes.model_validate({"spheres": [drawn], "mask": mask, "marks": marks})


@pytest.mark.usefixtures("smooth_labels")
def test_edits_give_what_a_catalogue_of_these_values_gives(tiny: Path, tmp_path: Path, values: Changes) -> None:
    """And the keys are the same: the mask and the marks count by their content, wherever they lie."""
    assert values.mask is not None and values.marks is not None and values.spheres is not None
    edits = Edits.open(Location.parse(tmp_path / "edited"), "hemisphere")
    edits.save("front", values, "Ann", 0)
    (edited,) = with_edits([context_of(tiny, tmp_path / "edited")])
    assert edited.edits is not None and set(edited.edits.changes) == {"spheres", "mask", "marks"}

    (tmp_path / "mask.png").write_bytes(mask_png(values.mask))
    marks = [mark.model_dump() for mark in values.marks]
    plain = context_of(tiny, tmp_path / "plain")
    (tmp_path / "markup.json").write_bytes(Path(edited.capture.markup or "").read_bytes())
    assert json.loads((tmp_path / "markup.json").read_text()) == marks
    update = {
        "spheres": values.spheres,
        "mask": str(tmp_path / "mask.png"),
        "markup": str(tmp_path / "markup.json"),
    }
    plain = replace(plain, capture=plain.capture.model_copy(update=update))
    assert stage_keys(edited, STAGES) == stage_keys(plain, STAGES)
    perform_until(edited)
    perform_until(plain)
    expected, given = arrays_of(plain), arrays_of(edited)
    assert expected.keys() == given.keys()
    for name, array in expected.items():
        np.testing.assert_array_equal(given[name], array, err_msg=name)
    assert edited.load("survey").record["given_spheres"][0]["x"] == values.spheres[0].x
    sent = pickle.loads(pickle.dumps(edited))
    assert sent.capture == edited.capture and sent.edits == edited.edits


def test_only_edited_captures_and_fields_change(tiny: Path, tmp_path: Path, values: Changes) -> None:
    context = context_of(tiny, tmp_path / "store")
    before = stage_keys(context, STAGES)
    assert with_edits([context]) == (context,)
    edits = Edits.open(Location.parse(tmp_path / "store"), "hemisphere")
    edits.save("back", values, "Ann", 0)
    assert with_edits([context]) == (context,), "the edits are another capture's"
    edits.save("front", Changes(verdict="good", note="a judgement is not an input"), "Ann", 1)
    (judged,) = with_edits([context])
    assert judged.edits is None and stage_keys(judged, STAGES) == before
    edits.save("front", Changes(marks=values.marks), "Ann", 2)
    (marked,) = with_edits([context])
    changed = {name for name, key in stage_keys(marked, STAGES).items() if key != before[name]}
    assert changed == {"markup", "silhouette", "labels", "depth", "surface"}
    assert marked.capture.model_copy(update={"markup": context.capture.markup}) == context.capture
    edits.save("front", Changes(marks=()), "Ann", 3)
    (unmarked,) = with_edits([context])
    assert unmarked.capture.markup is None, "no marks, also none of the catalogue's"
    edits.undo(4, "Ann")
    edits.undo(3, "Ann")
    (undone,) = with_edits([context])
    assert stage_keys(undone, STAGES) == before


def test_an_undone_edit_gives_the_old_results_back_uncomputed(
    tiny: Path, tmp_path: Path, values: Changes, monkeypatch: pytest.MonkeyPatch
) -> None:
    last = "thresholds"
    names = NAMES[: NAMES.index(last) + 1]
    monkeypatch.setattr("glint.tasks.up_to_date.STAGES", STAGES[: len(names)])
    monkeypatch.setattr("glint.tasks.publish.NAMES", names)

    def run() -> tuple[list[bool], str]:
        (context,) = with_edits([context_of(tiny, tmp_path / "store")])
        cached = [record.cached for record in perform_until(context, last)]
        version = publish([context], "run", "catalogue.yaml")
        assert up_to_date_records([context]) is not None
        return cached, version.name

    assert run() == ([False] * len(names), "v1")
    first = arrays_of(context_of(tiny, tmp_path / "store"), last)
    edits = Edits.open(Location.parse(tmp_path / "store"), "hemisphere")
    edits.save("front", Changes(mask=values.mask), "Ann", 0)
    cached, name = run()
    assert (cached[0], name) == (False, "v2")
    repository = context_of(tiny, tmp_path / "store").repository
    recorded = repository.version("v2").metadata["captures"]["front"]
    assert recorded["edits"]["revision"] == 1
    assert recorded["edits"]["changes"]["mask"]["author"] == "Ann"
    assert "edits" not in repository.version("v1").metadata["captures"]["front"]
    edits.undo(1, "Bob")
    assert run() == ([True] * len(names), "v3")
    again = arrays_of(context_of(tiny, tmp_path / "store"), last)
    assert again.keys() == first.keys()
    for array, expected in first.items():
        np.testing.assert_array_equal(again[array], expected, err_msg=array)
    assert repository.version("v3").stages == repository.version("v1").stages


def test_a_reference_has_the_edits(tiny: Path, tmp_path: Path) -> None:
    store = Location.parse(tmp_path / "store")
    Edits.open(store, "hemisphere").save("front", Changes(pixel_size=0.125), "Ann", 0)
    context = CaptureReference(str(tiny), "hemisphere", "front", store.uri, "check").context()
    assert context.capture.pixel_size == 0.125


def test_the_cache_of_edited_inputs_is_never_trusted(tiny: Path, tmp_path: Path, values: Changes) -> None:
    Edits.open(Location.parse(tmp_path / "store"), "hemisphere").save("front", values, "Ann", 0)
    context = context_of(tiny, tmp_path / "store")
    (edited,) = with_edits([context])
    assert edited.capture.mask is not None
    path = Path(edited.capture.mask)
    whole, digest = path.read_bytes(), edited.digest("mask")
    for damage in (lambda: path.write_bytes(whole[:-9]), path.unlink):
        damage()
        (again,) = with_edits([context])
        assert path.read_bytes() == whole and again.digest("mask") == digest


def test_damaged_edits_stop_their_capture_alone(tiny: Path, tmp_path: Path) -> None:
    noise = np.random.default_rng(0).random((112, 192)) < 0.5  # too large to lie in the index
    Edits.open(Location.parse(tmp_path / "store"), "hemisphere").save("front", Changes(mask=noise), "Ann", 0)
    chunks = tmp_path / "store" / "objects" / "hemisphere" / "repo" / "chunks"
    for chunk in chunks.iterdir():
        chunk.write_bytes(bytes(len(chunk.read_bytes())))
    front = context_of(tiny, tmp_path / "store")
    back = replace(front, capture=front.capture.model_copy(update={"id": "back"}))
    damaged, whole = with_edits([front, back])
    assert whole == back and stage_keys(whole, STAGES)
    with pytest.raises(DamagedError, match="of hemisphere/front/edits in edit 1 is damaged"):
        stage_keys(damaged, STAGES)
    with pytest.raises(DamagedError, match="of hemisphere/front/edits in edit 1 is damaged"):
        CaptureReference(str(tiny), "hemisphere", "front", front.store, "run").context()


def test_spheres_drawn_where_lights_are_known_stop_their_capture_alone(
    tiny: Path, tmp_path: Path, values: Changes
) -> None:
    Edits.open(Location.parse(tmp_path / "store"), "hemisphere").save("front", values, "Ann", 0)
    context = context_of(tiny, tmp_path / "store")
    (tmp_path / "a.lp").write_text("1\nframe 0 0 1\n")
    update = {"spheres": (), "lights": str(tmp_path / "a.lp")}
    lit = replace(context, capture=context.capture.model_copy(update=update))
    other = replace(context, capture=context.capture.model_copy(update={"id": "back"}))
    edited, unedited = with_edits([lit, other])
    assert unedited == other
    with pytest.raises(InputError, match=r"a person drew spheres, .* known lights: take the edit .* back"):
        perform_until(edited, "survey")
