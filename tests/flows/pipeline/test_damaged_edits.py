"""Damaged edits are one capture's: the object's others are run and published, and the model says what it lacks."""

import json
from pathlib import Path

import numpy as np
import pytest
import typer.testing

from glint.flows.cli.main import app
from glint.flows.pipeline.context import activate
from glint.flows.pipeline.object import run_object
from glint.flows.results import ObjectResult
from glint.flows.runtime.dask_cluster import Cluster
from glint.storage.catalogue.loading import load, write
from glint.storage.catalogue.models import Pose
from glint.storage.edits.edits import Edits
from glint.storage.edits.models import Changes
from glint.storage.footage.source import open_footage
from glint.storage.locations.location import Location
from tests.flows.review.test_app import client
from tests.storage.edits.sample_edits import damage_a_chunk

DAMAGE = "file 'mask.png' of hemisphere/back/edits in edit 2 is damaged"
REMEDY = "`glint edits hemisphere/back --discard` to continue without its edits"


@pytest.fixture
def damaged(tiny: Path, tmp_path: Path) -> tuple[Path, Path]:
    """A catalogue of an object with two views, and a store in which the edits of the second are damaged."""
    loaded = load(tiny)
    (item,) = loaded.objects
    front = item.captures[0].model_copy(update={"pose": Pose(turntable=0)})
    views = front, front.model_copy(update={"id": "back", "pose": Pose(turntable=180)})
    catalogue, store = tmp_path / "two.yaml", tmp_path / "store"
    # Which labels a run makes is another matter.
    parameters = {"labels": {"method": "winner"}}
    objects = (item.model_copy(update={"captures": views}),)
    write(loaded.model_copy(update={"objects": objects, "parameters": parameters}), catalogue)
    with open_footage(front.frames) as footage:
        noise = np.random.default_rng(0).random((footage.height, footage.width)) < 0.5
    edits = Edits.open(Location.parse(store), "hemisphere")
    edits.save("front", Changes(pose=Pose(turntable=10)), "Ann", 0)
    edits.save("back", Changes(mask=noise), "Bob", 1)
    damage_a_chunk(store / "objects/hemisphere", 1_000)
    return catalogue, store


@pytest.mark.server
@pytest.mark.usefixtures("server")
def test_the_others_are_published_and_the_capture_is_named(damaged: tuple[Path, Path], cluster: Cluster) -> None:
    catalogue, store = damaged
    with activate(cluster.client):
        state = run_object(str(catalogue), "hemisphere", str(store), return_state=True)
    result = state.result(raise_on_failure=False)
    assert isinstance(result, ObjectResult) and result.version is not None
    front, back, model = result.captures
    assert not front.error and list(result.version.stages) == ["front"]
    assert back.error.startswith(DAMAGE) and back.remedy.endswith(REMEDY)
    assert (model.error, model.remedy) == (back.error, back.remedy), "its pose may be edited"


def test_the_page_shows_the_poses_of_the_others(damaged: tuple[Path, Path]) -> None:
    catalogue, store = damaged
    page = client(store, catalogue)
    front, back = page.get("/api/objects/hemisphere/poses").json()["views"]
    assert front["pose"] == {"turntable": 10} and not front["damage"]
    assert back["pose"] is None and back["damage"].startswith(DAMAGE) and back["damage"].endswith(REMEDY)
    assert page.get("/api/captures/hemisphere/front/edits").status_code == 200
    refused = page.get("/api/captures/hemisphere/back/edits").json()
    assert refused["error"].startswith(DAMAGE) and refused["remedy"].endswith(REMEDY)


def test_the_edits_of_the_others_are_listed(damaged: tuple[Path, Path]) -> None:
    _, store = damaged
    done = typer.testing.CliRunner().invoke(app, ["edits", "hemisphere", "--store", str(store), "--json"])
    assert done.exit_code == 1
    (listed,) = [json.loads(line) for line in done.stdout.splitlines() if '"edited"' in line]
    assert (listed["capture"], listed["field"]) == ("hemisphere/front", "pose")
    assert str(done.exception).startswith(DAMAGE) and str(done.exception).endswith(REMEDY)
