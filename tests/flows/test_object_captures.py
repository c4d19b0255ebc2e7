"""What is to be done about objects, without importing what does it."""

import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from glint.flows.object_captures import ObjectCaptures, unchanged_objects
from glint.flows.results import ObjectResult
from glint.storage.catalogue.loading import Catalogue, load, write
from glint.storage.errors import InputError
from glint.tasks.engine.references import chosen_captures
from glint.tasks.pipeline import NAMES
from glint.tasks.publish import publish
from glint.tasks.up_to_date import pending_stages
from tests.tasks.make_context import perform_all


@pytest.mark.parametrize(
    ("module", "absent"),
    [
        ("glint.flows.object_captures", {"prefect", "distributed", "numba", "scipy", "open3d", "maxflow"}),
        ("glint.flows.pipeline.catalogue", {"numba", "open3d", "maxflow", "bokeh"}),
    ],
)
def test_what_computes_is_not_imported(module: str, absent: set[str]) -> None:
    code = f"import sys, {module}; print(*sys.modules)"
    ended = subprocess.run(
        [sys.executable, "-c", code], cwd=Path(__file__).parents[2], capture_output=True, text=True, check=True
    )
    assert absent & set(ended.stdout.split()) == set()


def captures_of(catalogue: Path, store: Path) -> ObjectCaptures:
    return ObjectCaptures.of(load(catalogue), str(catalogue), "hemisphere", [], str(store), run="")


def refuse(result: ObjectResult) -> None:
    pytest.fail(f"{result} is reported as unchanged")


@pytest.mark.usefixtures("smooth_labels")
def test_unchanged_objects_are_found_and_the_others_counted_by_the_workers_they_need(
    simulated: Path, tmp_path: Path
) -> None:
    captures = captures_of(simulated, tmp_path / "store")
    assert pending_stages(captures.chosen[0]) == NAMES
    prepared = list[bool]()
    prepare = partial(prepared.append, True)
    assert unchanged_objects([captures], 4, refuse, prepare) == ({}, 4), "tiles of a new capture go to all workers"
    perform_all(captures.chosen[0])
    assert pending_stages(captures.chosen[0]) == ()
    assert unchanged_objects([captures], 4, refuse, prepare) == ({}, 1), "it is stored, but no version holds it"
    publish(captures.chosen, "run", str(simulated))
    reported = list[ObjectResult]()
    assert len(prepared) == 2
    unchanged, busy = unchanged_objects([captures], 4, reported.append, pytest.fail)
    assert busy == 0 and list(unchanged.values()) == reported and reported[0].captures[0].cached
    changed = load(simulated).model_copy(update={"parameters": {"depth": {"method": "least-squares"}}})
    write(changed, tmp_path / "changed.yaml")
    captures = captures_of(tmp_path / "changed.yaml", tmp_path / "store")
    assert pending_stages(captures.chosen[0]) == ("depth", "surface")
    assert unchanged_objects([captures, captures], 4, refuse, prepare) == ({}, 2), (
        "the last stages need one worker each"
    )


@pytest.fixture(scope="module")
def large() -> Catalogue:
    entries = [
        {"id": f"o{number}", "captures": [{"id": name, "frames": f"/data/{number}/{name}.mp4"} for name in ("a", "b")]}
        for number in range(10_000)
    ]
    return Catalogue.model_validate({"schema": 1, "name": "large", "objects": entries})


class Counted(list[Any]):
    """A list that counts how often it is gone through, and may not be searched."""

    passes = 0

    def __iter__(self) -> Iterator[Any]:
        self.passes += 1
        return super().__iter__()

    def __contains__(self, item: object) -> bool:
        raise AssertionError(f"{item} is looked for in a list")


def test_an_object_does_not_cost_more_in_a_large_catalogue(large: Catalogue) -> None:
    counted = Counted(large.objects)
    catalogue = large.model_copy(update={"objects": counted})
    for number in range(300):
        captures = ObjectCaptures.of(catalogue, "large.yaml", f"o{number}", ["b"], "/store", run="")
    assert counted.passes < 10
    assert captures.ids == [("o299", "b")] and len(captures.all) == 2 and captures.n_captures == 20_000
    with pytest.raises(InputError, match="no o10000") as raised:
        ObjectCaptures.of(catalogue, "large.yaml", "o10000", [], "/store", run="")
    assert "did you mean o1" in raised.value.remedy
    with pytest.raises(InputError, match="no o7/c"):
        ObjectCaptures.of(catalogue, "large.yaml", "o7", ["c"], "/store", run="")


def test_many_captures_are_chosen_by_name_without_a_search_for_each(large: Catalogue) -> None:
    names = Counted(f"{item.id}/b" for item in large.objects)
    assert chosen_captures(large.objects, names) == {item.id: ["b"] for item in large.objects}
    assert names.passes < 10
