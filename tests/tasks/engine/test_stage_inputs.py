"""A stage may read what its declaration names, and nothing else; what it names is what its key covers."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glint.storage.versions.stage_results import StageResult
from glint.tasks.engine.stage import StageOutput, perform, stage_keys
from glint.tasks.engine.stage_inputs import StageInputs, UndeclaredRead
from glint.tasks.pipeline import BY_NAME, NAMES, STAGES
from tests.tasks.make_context import make_context, perform_all


@pytest.mark.parametrize("read", ["load", "field", "file", "digest", "parameters_of"])
def test_reading_what_is_not_declared_fails(simulated: Path, tmp_path: Path, read: str) -> None:
    inputs = StageInputs(make_context(simulated, tmp_path / "store"), BY_NAME["thresholds"])
    name = {"load": "labels", "field": "camera", "parameters_of": "clusters"}.get(read, "markup")
    with pytest.raises(UndeclaredRead, match=f"thresholds reads the .* '{name}'"):
        getattr(inputs, read)(name)


@pytest.mark.usefixtures("smooth_labels")
def test_every_declared_result_is_read(tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A result that is declared and never read would compute the stage again in vain."""
    reads: dict[str, set[str]] = {stage.name: set() for stage in STAGES}
    load = StageInputs.load

    def recorded(inputs: StageInputs, stage: str) -> StageResult:
        reads[inputs._stage.name].add(stage)
        return load(inputs, stage)

    monkeypatch.setattr(StageInputs, "load", recorded)
    folder = Path(str(make_context(tiny, tmp_path).capture.mask)).parent
    perform_all(make_context(tiny, tmp_path / "marked", markup=str(folder / "markup.json")))
    perform_all(make_context(tiny, tmp_path / "estimated", mask=None), "mask")
    assert reads == {stage.name: set(stage.reads) for stage in STAGES}


def test_a_stage_that_loads_what_it_did_not_declare_ends_the_capture(simulated: Path, tmp_path: Path) -> None:
    def greedy(inputs: StageInputs, progress: object) -> StageOutput:
        inputs.load("frames")
        return StageOutput(arrays={"mask": np.ones((4, 4), bool), "doubt": np.zeros((4, 4), np.float32)})

    context = make_context(simulated, tmp_path / "store")
    perform_all(context, "frames")
    key = stage_keys(context, STAGES)["mask"]
    stage = replace(BY_NAME["mask"], run=greedy, reads=("survey",))
    with pytest.raises(UndeclaredRead, match="'frames'"):
        perform(context, stage, key)
    assert perform(context, replace(stage, reads=("survey", "frames")), key).stage == "mask"


def test_stages_read_only_those_before_them() -> None:
    for number, stage in enumerate(STAGES):
        assert set(stage.reads) <= set(NAMES[:number]), stage.name


def test_markup_and_silhouette_do_not_wait_for_clusters() -> None:
    for name in ("markup", "silhouette", "thresholds"):
        assert "clusters" not in BY_NAME[name].reads and NAMES.index(name) < NAMES.index("clusters")
