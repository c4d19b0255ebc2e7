"""Two commands at once on one store: no commit is lost, and the work is done once."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from glint.storage.catalogue.loading import Catalogue, load, write
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from glint.tasks.pipeline import STAGES

pytestmark = pytest.mark.server
GLINT = [sys.executable, "-c", "from glint.flows.cli.main import main; main()", "run"]
ROOT = Path(__file__).parents[3]


def start(folder: Path, catalogue: str, home: Path) -> "subprocess.Popen[str]":
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PREFECT", "GLINT"))}
    environment |= {"GLINT_HOME": str(home), "PYTHONPATH": str(ROOT)}
    words = [*GLINT, catalogue, "--store", "store", "--workers", "1", "--json"]
    return subprocess.Popen(
        words, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def outcome(process: "subprocess.Popen[str]") -> tuple[int, list[dict[str, Any]], str]:
    """Exit status, events and errors."""
    out, errors = process.communicate(timeout=200)
    return process.returncode, [json.loads(line) for line in out.splitlines()], errors


def computed(events: list[dict[str, Any]]) -> list[str]:
    """Stages that were not there already."""
    return [f"{e['capture']} {e['stage']}" for e in events if e["kind"] == "stage" and not e["cached"]]


@pytest.mark.slow
def test_on_one_store_and_on_one_object(tmp_path: Path, simulated: Path, glint_home: Path) -> None:
    entry = load(simulated).objects[0]
    for name, ids in (("first", ("shared", "one")), ("second", ("shared", "two"))):
        objects = [entry.model_copy(update={"id": each}) for each in ids]
        made = Catalogue.model_validate({"schema": 1, "name": name, "objects": objects})
        write(made, tmp_path / f"{name}.yaml")
    runs = [start(tmp_path, f"{name}.yaml", glint_home) for name in ("first", "second")]
    outcomes = [outcome(each) for each in runs]
    assert {status for status, _, _ in outcomes} <= {0, 1}, [errors for _, _, errors in outcomes]
    assert min(status for status, _, _ in outcomes) == 0
    for status, events, _ in outcomes:
        failed = [row for row in events[-1]["captures"] if row["error"]]
        assert [row["capture"] for row in failed] == ["shared/front"] * status
        assert all("is being worked on by process" in row["error"] for row in failed)
    stages = [stage for _, events, _ in outcomes for stage in computed(events)]
    assert len(stages) == len(set(stages)) == 3 * len(STAGES), "each stage is computed by one of them, once"
    for each in ("shared", "one", "two"):
        repository = ObjectRepository.open(Location.parse(tmp_path / "store"), each, create=False)
        assert repository.version_names() == ["v1"] and set(repository.version().stages) == {"front"}
        assert set(repository.contents("v1")["front"]) == {stage.name for stage in STAGES}
    again = outcome(start(tmp_path, "second.yaml", glint_home))
    assert again[0] == 0 and {row["result"] for row in again[1][-1]["captures"]} == {"up to date"}
