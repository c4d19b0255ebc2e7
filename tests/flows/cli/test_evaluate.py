"""Degraded and perturbed captures, evaluated from the command line."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from glint.flows.cli import evaluate as cli_evaluate
from glint.flows.cli import simulate as cli_simulate
from glint.flows.cli.main import app
from glint.flows.cli.simulate import simulate_degraded
from glint.flows.reporting.events import Event
from glint.flows.runtime import dask_cluster
from glint.flows.runtime.dask_cluster import Cluster
from glint.storage.catalogue.loading import load
from glint.tasks.robustness import matrix
from glint.tasks.simulation import simulate as tasks_simulate
from glint.tasks.simulation.simulate import DEGRADED, CaptureOptions

ROOT = Path(__file__).parents[3]
SMALL = {"frames": 250, "scale": 0.25, "rays": 1, "sphere_radius": 20.0}
TINY = {"frames": 150, "scale": 0.15, "rays": 1, "sphere_radius": 22.0}
"""Too small to be searched for symmetry, which takes most of the seconds of a small capture."""
FEW = {"no-defect": SMALL, "perspective": SMALL | DEGRADED["perspective"]}


def test_every_defect_can_be_simulated() -> None:
    no_defect = CaptureOptions()
    assert DEGRADED["no-defect"] == {}
    assert all(CaptureOptions(**options) != no_defect for name, options in DEGRADED.items() if name != "no-defect")


def test_each_shape_is_simulated_once_for_each_defect(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    few = {name: options | {"frames": 5} for name, options in FEW.items()}
    monkeypatch.setattr(cli_simulate, "DEGRADED_SHAPES", ("hemisphere", "cylinder"))
    monkeypatch.setattr(tasks_simulate, "DEGRADED", few)
    events: list[Event] = []
    display = SimpleNamespace(emit=events.append)
    catalogue = load(simulate_degraded(tmp_path, True, display))
    assert [item.id for item in catalogue.objects] == [
        "hemisphere-no-defect",
        "hemisphere-perspective",
        "cylinder-no-defect",
        "cylinder-perspective",
    ]
    assert [item.captures[0].camera is not None for item in catalogue.objects] == [False, True, False, True]
    assert events
    events.clear()
    video = Path(str(catalogue.objects[0].captures[0].frames))
    written = video.stat().st_mtime_ns
    simulate_degraded(tmp_path, True, display)
    assert not events and video.stat().st_mtime_ns == written


@pytest.fixture
def home(tmp_path: Path) -> Iterator[Path]:
    from glint.flows.runtime.prefect_server import stop_server

    yield tmp_path / "home"
    stop_server(tmp_path / "home")


@pytest.mark.server
@pytest.mark.slow
def test_degraded_captures_are_evaluated_from_the_command_line(tmp_path: Path, home: Path) -> None:
    """The command as it is, on one shape and one defect."""
    few = {"perspective": FEW["perspective"]}
    code = (
        "import sys, glint.flows.cli.main as m, glint.tasks.evaluation.ablation as a;"
        "import glint.tasks.simulation.simulate as s; d = sys.modules['glint.flows.cli.simulate'];"
        f"d.DEGRADED_SHAPES = ('hemisphere',); s.DEGRADED = {few!r}; "
        "a.ABLATIONS = {name: a.ABLATIONS[name] for name in ('default', 'one candidate')}; m.main()"
    )
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PREFECT", "GLINT"))}
    environment |= {"GLINT_HOME": str(home), "PYTHONPATH": str(ROOT)}
    words = ["evaluate", "--degraded", "--quick", "--ablation", "--out", "out"]
    done = subprocess.run(
        [sys.executable, "-c", code, *words], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=200
    )
    assert done.returncode == 0, done.stdout + done.stderr
    facts = {capture["name"]: capture for capture in json.loads((tmp_path / "out" / "evaluation.json").read_text())}
    assert set(facts) == {"hemisphere-perspective/front"}
    methods = facts["hemisphere-perspective/front"]["methods"]
    errors = {method["method"]: method["whole"]["squared"] for method in methods}
    assert errors["glint"] < 0.02 < errors["winner takes all"]
    table = (tmp_path / "out" / "evaluation.md").read_text()
    assert "| one candidate | " in table and "hemisphere-perspective/front" in table
    assert {"evaluation.png", "reliability.png"} <= {path.name for path in (tmp_path / "out").iterdir()}


@pytest.mark.server
def test_inputs_are_perturbed_from_the_command_line(
    tmp_path: Path, cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The command, on one small shape, a share of the perturbations, and the workers of the other tests."""
    monkeypatch.setattr(dask_cluster, "Cluster", lambda **_: nullcontext(cluster))
    monkeypatch.setattr(cli_evaluate, "PERTURBED_QUICK_OPTIONS", TINY)
    monkeypatch.setattr(matrix, "QUICK", ("as-it-is", "sphere-found", "light-at-10-widths"))
    out = tmp_path / "out"
    words = ["evaluate", "--perturbed", "--quick", "--out", str(out), "--only", "hemisphere/light-*"]
    done = CliRunner().invoke(app, words, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    measured = json.loads((out / "perturbed.json").read_text())
    assert list(measured) == ["as-it-is", "light-at-10-widths"]
    assert measured["light-at-10-widths"]["hemisphere"]["error_deg"] < 30.0
    assert "| light at 10 widths | " in done.output
    assert (out / "perturbed.md").read_text().startswith("| perturbation | hemisphere |")
    entries = load(out / "perturbed" / "catalogue.yaml").object("hemisphere").captures
    assert [entry.id for entry in entries] == list(measured)
