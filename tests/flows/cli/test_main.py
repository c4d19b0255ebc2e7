"""The `glint` command in a process of its own: exit status, output, files, and continuing after a kill."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer.testing

from glint.flows.cli.main import app
from glint.flows.runtime.server_process import is_alive, read_state, server_folder
from glint.storage.catalogue.loading import load, write
from glint.storage.maintenance.disk_space import DISK_SPACE_REMEDY
from tests.polling import PATIENCE

pytestmark = pytest.mark.server
GLINT = [sys.executable, "-m", "glint"]
ROOT = Path(__file__).parents[3]


def environment(home: Path) -> dict[str, str]:
    """That of a command with Glint's own server of the tests."""
    others = {name: value for name, value in os.environ.items() if not name.startswith(("PREFECT", "GLINT"))}
    return others | {"GLINT_HOME": str(home), "PYTHONPATH": str(ROOT)}


def glint(*words: str, folder: Path, home: Path, check: int | None = 0) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder."""
    command = [*GLINT, *words]
    done = subprocess.run(command, cwd=folder, env=environment(home), capture_output=True, text=True, timeout=600)
    assert check is None or done.returncode == check, f"{words}: {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done


@pytest.fixture(scope="module")
def home(glint_home: Path) -> Path:
    """The home of all tests of flows: its server, which the first run starts, is that of the later tests."""
    return glint_home


@pytest.fixture(scope="module")
def started(home: Path) -> str:
    """What the first run has to start."""
    state = read_state(server_folder(home))
    is_up = state is not None and is_alive(*state.process)
    return "worker processes" if is_up else "the dashboard's server and worker processes"


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory, tiny: Path, home: Path) -> Path:
    """A folder with a catalogue of one good and one bad capture."""
    folder = tmp_path_factory.mktemp("place")
    good = load(tiny).objects[0]
    bad = good.captures[0].model_copy(update={"id": "bad", "frames": str(folder / "missing.mp4")})
    both = good.model_copy(update={"captures": (*good.captures, bad)})
    write(load(tiny).model_copy(update={"objects": (both,)}), folder / "catalogue.yaml")
    return folder


@pytest.fixture(scope="module")
def killed(place: Path, home: Path, started: str) -> list[dict[str, Any]]:
    """The events of the first run of the catalogue, which is killed once the lights are stored."""
    words = [*GLINT, "run", "catalogue.yaml", "--json"]
    process = subprocess.Popen(
        words, cwd=place, env=environment(home), stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    events: list[dict[str, Any]] = []
    assert process.stdout is not None
    for line in process.stdout:
        events.append(json.loads(line))
        if events[-1]["kind"] == "stage" and events[-1]["stage"] == "lights":
            os.killpg(process.pid, signal.SIGKILL)
            break
    process.wait(PATIENCE)
    process.stdout.close()
    time.sleep(0.5)
    return events


@pytest.fixture(scope="module")
def ran(killed: list[dict[str, Any]], place: Path, home: Path) -> subprocess.CompletedProcess[str]:
    """The second run, which goes on where the first one was killed."""
    return glint("run", "catalogue.yaml", folder=place, home=home, check=1)


def _beside_disk_space(events: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the events without the warning that any run gives on a disk that is nearly full."""
    return [event for event in events if DISK_SPACE_REMEDY not in event.get("text", "")]


def test_a_run_says_what_it_waits_for(killed: list[dict[str, Any]], started: str) -> None:
    address = r"http://127.0.0.1:\d+"
    reading, starting, dashboard = [
        event["text"] for event in _beside_disk_space(killed) if event["kind"] == "message"
    ][:3]
    assert reading == "reading catalogue.yaml and what glint-store holds of it"
    assert starting == f"starting {started}"
    assert re.fullmatch(rf"dashboard {address}/glint/#\S+, workers \d+, Dask's dashboard {address}/status", dashboard)


def test_a_killed_run_continues_where_it_stopped(ran: subprocess.CompletedProcess[str]) -> None:
    assert "missing.mp4" in ran.stdout and "->" in ran.stdout and "v1" in ran.stdout
    assert "next: glint export hemisphere --out hemisphere-export" in ran.stdout, "not the folder of its videos"
    for stage in ("survey", "frames", "lights"):
        assert f"hemisphere/front  {stage}  up to date" in ran.stderr
    assert "hemisphere/front  surface  done in" in ran.stderr


def test_from_video_to_files(ran: subprocess.CompletedProcess[str], place: Path, home: Path) -> None:
    again = glint("run", "catalogue.yaml", "--only", "hemisphere/front", "--json", folder=place, home=home)
    events = _beside_disk_space([json.loads(line) for line in again.stdout.splitlines()])
    assert [event["kind"] for event in events] == ["message", "capture", "summary"], "what is unchanged starts nothing"
    summary = events[-1]
    assert [row["result"] for row in summary["captures"]] == ["up to date"]
    assert re.fullmatch(r"http://127.0.0.1:\d+/glint/#\S+", summary["page"])
    glint("export", "hemisphere", "--out", "out", folder=place, home=home)
    assert np.isfinite(np.load(place / "out" / "front" / "depth.npy")).any()
    assert "v1" in glint("history", "hemisphere", folder=place, home=home).stdout
    assert "hemisphere" in glint("status", folder=place, home=home).stdout


@pytest.mark.slow
def test_rollback_brings_an_old_version_back(place: Path, home: Path) -> None:
    catalogue = load(place / "catalogue.yaml")
    changed = catalogue.model_copy(update={"parameters": {"depth": {"method": "least-squares"}}})
    write(changed, place / "changed.yaml")
    words = ("--store", "rolled")
    for name in ("catalogue.yaml", "changed.yaml"):
        glint("run", name, "--only", "hemisphere/front", *words, folder=place, home=home)
    glint("rollback", "hemisphere", "v1", *words, folder=place, home=home)
    history = glint("history", "hemisphere", "--json", *words, folder=place, home=home).stdout
    versions = [json.loads(line) for line in history.splitlines()]
    assert [version["version"] for version in versions] == ["v1", "v2", "v3"]


@pytest.mark.slow
def test_damage_is_named_and_repaired(place: Path, home: Path) -> None:
    words = ("--store", "hurt")
    glint("run", "catalogue.yaml", "--only", "hemisphere/front", *words, folder=place, home=home)
    assert "no damage found" in glint("verify", "--cache", *words, folder=place, home=home).stdout
    chunks = place / "hurt" / "objects" / "hemisphere" / "repo" / "chunks"
    chunk = max(chunks.iterdir(), key=lambda path: path.stat().st_size)
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(data)
    verified = glint("verify", *words, folder=place, home=home, check=1).stdout
    assert re.search(r"(array|file) '\S+' of hemisphere/front/\w+ in v1 is damaged", verified)
    assert "-> `glint verify hemisphere --repair`" in verified
    repaired = glint("verify", "hemisphere", "--repair", *words, folder=place, home=home, check=1)
    assert "computed again what was damaged" in repaired.stdout or "missing.mp4" in repaired.stdout
    lines = glint("verify", "--json", *words, folder=place, home=home, check=1).stdout.splitlines()
    damages = [json.loads(line) for line in lines]
    assert {damage["version"] for damage in damages if damage["kind"] == "damage"} == {"v1"}
    assert damages[-1]["kind"] == "verification" and damages[-1]["versions"] == 2
    again = glint("run", "catalogue.yaml", "--only", "hemisphere/front", *words, folder=place, home=home)
    assert "up to date" in again.stdout
    glint("export", "hemisphere", "--out", "whole", *words, folder=place, home=home)
    glint("maintain", "--keep", "1", "--older-than", "0", *words, folder=place, home=home)
    assert "no damage found" in glint("verify", *words, folder=place, home=home).stdout


@pytest.mark.slow
def test_an_object_of_another_catalogue_is_refused_unless_adopted(place: Path, home: Path) -> None:
    words = ("--only", "hemisphere/front", "--store", "shared")
    glint("run", "catalogue.yaml", *words, folder=place, home=home)
    capture = load(place / "catalogue.yaml").objects[0].captures[0]
    other = place / f"other{Path(capture.frames).suffix}"
    other.write_bytes(Path(capture.frames).read_bytes() + b"\0")
    item = load(place / "catalogue.yaml").objects[0]
    entry = item.model_copy(update={"captures": (capture.model_copy(update={"frames": str(other)}),)})
    write(load(place / "catalogue.yaml").model_copy(update={"objects": (entry,)}), place / "second.yaml")
    refused = glint("run", "second.yaml", *words, folder=place, home=home, check=1).stdout
    assert "was published from the catalogue" in refused and "--adopt" in refused
    glint("run", "second.yaml", "--adopt", *words, folder=place, home=home)
    shown = glint("history", "hemisphere", "--json", "--store", "shared", folder=place, home=home).stdout
    catalogues = [Path(json.loads(line)["catalogue"]).name for line in shown.splitlines()]
    assert catalogues == ["catalogue.yaml", "second.yaml"]


def test_check_draws_pictures_and_reports_unusable_captures(place: Path, home: Path) -> None:
    done = glint("check", "catalogue.yaml", "--store", "other", folder=place, home=home, check=1)
    assert "missing.mp4" in done.stderr and "hemisphere/front" in done.stdout
    pictures = {path.name for path in (place / "glint-check" / "hemisphere" / "front").iterdir()}
    assert {"coverage.png", "overview.png"} < pictures and any(name.startswith("keyframe_") for name in pictures)


def test_evaluate_writes_table_json_and_pictures(
    ran: subprocess.CompletedProcess[str], place: Path, home: Path
) -> None:
    words = ("catalogue.yaml", "--only", "hemisphere/front", "--store", "glint-store")
    done = glint("evaluate", *words, folder=place, home=home)
    assert "winner takes all" in done.stdout
    facts = json.loads((place / "glint-evaluation" / "evaluation.json").read_text())
    errors = {method["method"]: method["whole"]["squared"] for method in facts[0]["methods"]}
    assert errors["glint"] < min(value for name, value in errors.items() if name != "glint")
    assert (place / "glint-evaluation" / "evaluation.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("run", "nothing.yaml"), "nothing.yaml"),
        (("run", "catalogue.yaml", "--only", "hemisfere"), "did you mean hemisphere?"),
        (("export", "missing", "--out", "x"), "missing"),
        (("simulate", "teapot", "--out", "x"), "teapot"),
        (("history", "../up"), "../up"),
        (("run",), "CATALOGUE"),
    ],
)
def test_wrong_usage_exits_with_two_and_a_remedy(place: Path, home: Path, words: tuple[str, ...], message: str) -> None:
    done = glint(*words, folder=place, home=home, check=2)
    assert message in done.stderr and "Traceback" not in done.stderr


def test_help_names_every_command() -> None:
    shown = typer.testing.CliRunner().invoke(app, ["--help"]).output
    for command in app.registered_commands:
        assert command.callback is not None and command.callback.__name__ in shown
