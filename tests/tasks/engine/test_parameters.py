"""Names of parameters: the present ones, and those that catalogues may still use."""

from pathlib import Path

import pytest

from glint.storage.catalogue.loading import CatalogueError, load
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import FORMER_NAMES, Parameters

CATALOGUE = """schema: 1
name: glass
parameters: {clusters: {share: 0.5, apart: 2.0}, depth: {confident: false}}
objects:
  - id: jug
    captures:
      - id: front
        frames: front.mp4
        parameters: {thresholds: {threshold: 0.6}}
      - id: back
        frames: back.mp4
        parameters: {clusters: {share: 0.7}}
"""


@pytest.mark.parametrize(("former", "present"), FORMER_NAMES.items(), ids=lambda name: ".".join(name))
def test_a_former_name_means_the_present_one(former: tuple[str, str], present: tuple[str, str]) -> None:
    stage, name = present
    value = getattr(getattr(Parameters(), stage), name)
    changed = (not value) if isinstance(value, bool) else (value or 0.0) * 0.9 + 0.2
    by_former = Parameters.model_validate({former[0]: {former[1]: changed}})
    assert by_former == Parameters.model_validate({stage: {name: changed}}) != Parameters()


def test_the_nearest_level_counts_whatever_name_it_uses(tmp_path: Path) -> None:
    (tmp_path / "catalogue.yaml").write_text(CATALOGUE, encoding="utf-8")
    catalogue = load(tmp_path / "catalogue.yaml", Parameters)
    contexts = {name: CaptureContext.of(catalogue, "jug", name, str(tmp_path / "store")) for name in ("front", "back")}
    assert [contexts[name].parameters.thresholds.threshold for name in ("front", "back")] == [0.6, 0.7]
    for context in contexts.values():
        assert context.parameters.clusters.separation == 2.0 and not context.parameters.depth.use_confidence


@pytest.mark.parametrize(("entry", "line"), [("{clusters: {share: 3}}", 3), ("{clusters: {shar: 0.5}}", 3)])
def test_a_wrong_former_parameter_is_located(tmp_path: Path, entry: str, line: int) -> None:
    text = CATALOGUE.replace("{clusters: {share: 0.5, apart: 2.0}, depth: {confident: false}}", entry)
    (tmp_path / "catalogue.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(CatalogueError) as refusal:
        load(tmp_path / "catalogue.yaml", Parameters)
    assert f":{line}: " in str(refusal.value)


@pytest.mark.parametrize("levels", ["{edge_level: 0.75}", "{full_level: 0.2}", "{edge_level: 0.9, full_level: 0.8}"])
def test_a_highlight_whose_weight_does_not_rise_is_refused(tmp_path: Path, levels: str) -> None:
    text = CATALOGUE.replace("{clusters: {share: 0.5, apart: 2.0}, depth: {confident: false}}", f"{{lights: {levels}}}")
    (tmp_path / "catalogue.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(CatalogueError, match=r":3: .*edge_level 0\.\d+ must be below full_level 0\.\d+"):
        load(tmp_path / "catalogue.yaml", Parameters)
