"""What a run costs beside its stages: until its first line, with nothing to do, with little to do, and cold.

    python -m tests.benchmarks.startup [--captures 20] [--repeat 3]

Tiny simulated captures, each an object of its own, a local store, a server in a home of its own. Seconds are also given
as ratios to the import of four libraries by an empty process (prefect, distributed, zarr, icechunk), since they depend
on the machine and on its load. The bars: the first line within 1 s; an unchanged catalogue within 1.5 times the
imports; a changed parameter of the last stages of one capture in 5 s more than these stages; until the first stage runs
12 s while the server starts. The bars in seconds are for a machine whose imports take 1.8 s. On a busy machine the
processor's seconds of all processes of a run, as ratios to those of the imports, are what can be compared.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from glint.storage.catalogue.loading import Catalogue, load, write
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from tests.benchmarks.ratios import line

IMPORTS = [sys.executable, "-c", "import prefect, distributed, zarr, icechunk"]
RUN = [sys.executable, "-m", "glint", "run"]
UNCHANGED_BAR = 1.5
CHANGED_BAR_S, COLD_BAR_S, FIRST_LINE_BAR_S = 5.0, 12.0, 1.0
QUIET_IMPORTS_S = 1.8
"""Seconds of the imports on the quiet machine for which the bars in seconds were set."""


@dataclass(frozen=True, slots=True)
class Timing:
    """Seconds of a process: as a whole, of processor, until its first line, until its first stage, of all stages."""

    wall: float
    processor: float
    first_line: float = 0.0
    first_stage: float = 0.0
    stages: float = 0.0


def timed(words: list[str], home: Path) -> Timing:
    """Run a command, whose lines are events, if any.

    Raises:
        SystemExit: it failed.
    """
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PREFECT", "GLINT"))}
    environment |= {"GLINT_HOME": str(home)}
    before, started = _children_seconds(), time.monotonic()
    first_line = first_stage = stages = 0.0
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        for line in process.stdout:
            passed, event = time.monotonic() - started, json.loads(line)
            first_line = first_line or passed
            if event.get("stage"):
                first_stage = first_stage or passed
            if event["kind"] == "stage" and not event["cached"]:
                stages += event["seconds"]
    if process.returncode != 0:
        raise SystemExit(f"{' '.join(words)} failed")
    return Timing(time.monotonic() - started, _children_seconds() - before, first_line, first_stage, stages)


def write_catalogue(shape: Path, captures: int, number: int, path: Path) -> None:
    """Write a catalogue of captures of one video; the labelling of the first of them changes with the number."""
    entry = load(shape).objects[0]
    objects = [entry.model_copy(update={"id": f"object-{index:03}"}) for index in range(captures)]
    parameters = {"labels": {"strength": 10.0 + number}}
    first = objects[0].captures[0].model_copy(update={"parameters": parameters})
    objects[0] = objects[0].model_copy(update={"captures": (first, *objects[0].captures[1:])})
    write(Catalogue.model_validate({"schema": 1, "name": "startup", "objects": objects}), path)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--captures", type=int, default=20)
    parser.add_argument("--repeat", type=int, default=3)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["GLINT_HOME"] = name
        from glint.flows.runtime.prefect_server import stop_server

        try:
            measure(folder, arguments.captures, arguments.repeat)
        finally:
            stop_server(folder)


def measure(folder: Path, captures: int, repeat: int) -> None:
    """Print what each kind of run takes, as medians of runs that take turns with the imports."""
    options = CaptureOptions(frames=100, scale=0.2, sphere_radius=22.0)
    shape, catalogue = simulate("hemisphere", folder / "shape", options).catalogue, folder / "catalogue.yaml"
    run = [*RUN, str(catalogue), "--store", str(folder / "store"), "--json"]
    write_catalogue(shape, captures, 0, catalogue)
    imports, idle, little = [timed(IMPORTS, folder)], list[Timing](), list[Timing]()
    cold = timed(run, folder)
    for number in range(repeat):
        imports.append(timed(IMPORTS, folder))
        idle.append(timed(run, folder))
        write_catalogue(shape, captures, number + 1, catalogue)
        little.append(timed(run, folder))
    unit = median(timing.wall for timing in imports)
    processor = median(timing.processor for timing in imports)
    stages = median(timing.stages for timing in little)
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors, {captures} captures")
    print(f"imports of the four libraries: {unit:.1f} s, of processor {processor:.1f} s", flush=True)
    for name, seconds, bar in (
        ("first line of an unchanged run", median(timing.first_line for timing in idle), FIRST_LINE_BAR_S),
        ("unchanged catalogue", _wall(idle), UNCHANGED_BAR * QUIET_IMPORTS_S),
        ("changed last stages of one capture, beyond them", _wall(little) - stages, CHANGED_BAR_S),
        ("cold until the first stage", cold.first_stage, COLD_BAR_S),
    ):
        print(line(f"{name} / imports", seconds / unit, bar / QUIET_IMPORTS_S))
    for name, of_processor in (("unchanged catalogue", _processor(idle)), ("changed last stages", _processor(little))):
        print(f"{name}: {of_processor / processor:.2f} of the imports' seconds of processor", flush=True)


def _processor(timings: list[Timing]) -> float:
    return median(timing.processor for timing in timings)


def _wall(timings: list[Timing]) -> float:
    return median(timing.wall for timing in timings)


def _children_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


if __name__ == "__main__":
    main()
