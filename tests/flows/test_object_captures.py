"""What is to be done about objects, without importing what does it."""

import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from glint.flows.object_captures import ObjectCaptures, unchanged_objects
from glint.flows.results import ObjectResult
from glint.storage.catalogue.loading import load, write
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
    return ObjectCaptures.of(load(catalogue), str(catalogue), "hemisphere", [], str(store), "", False)


def test_unchanged_objects_are_found_and_the_others_counted_by_the_workers_they_need(
    simulated: Path, tmp_path: Path
) -> None:
    captures = captures_of(simulated, tmp_path / "store")
    assert pending_stages(captures.chosen[0]) == NAMES
    prepared = list[bool]()
    prepare = partial(prepared.append, True)
    assert unchanged_objects([captures], 4, pytest.fail, prepare) == ({}, 4), "tiles of a new capture go to all workers"
    perform_all(captures.chosen[0])
    assert pending_stages(captures.chosen[0]) == ()
    assert unchanged_objects([captures], 4, pytest.fail, prepare) == ({}, 1), "it is stored, but no version holds it"
    publish(captures.chosen, "run", str(simulated))
    reported = list[ObjectResult]()
    assert len(prepared) == 2
    unchanged, busy = unchanged_objects([captures], 4, reported.append, pytest.fail)
    assert busy == 0 and list(unchanged.values()) == reported and reported[0].captures[0].cached
    changed = load(simulated).model_copy(update={"parameters": {"depth": {"method": "least-squares"}}})
    write(changed, tmp_path / "changed.yaml")
    captures = captures_of(tmp_path / "changed.yaml", tmp_path / "store")
    assert pending_stages(captures.chosen[0]) == ("depth", "surface")
    assert unchanged_objects([captures, captures], 4, pytest.fail, prepare) == ({}, 2), (
        "the last stages need one worker each"
    )
