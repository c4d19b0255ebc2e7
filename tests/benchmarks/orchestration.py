"""Measure what orchestration costs: `glint run` against the same stages without Prefect and Dask, two workers against
one, and stages on Prefect's timeline against none.

    python -m tests.benchmarks.orchestration [--captures 20] [--frames 1000] [--scale 0.6] [--timeline-only]

The captures are simulated (four shapes, whose regions are shifted so that no frames are shared); scale: their size
against the paper's.
The stages alone are performed by a pool of two processes, a capture each at a time, with the same commits to a store of
their own. Both start with warm libraries: of a run the seconds count from its first stage to its last event, and its
start-up is reported beside them. The bars: 1.25 times the pool's seconds; two workers 1.5 times as fast as one; the
processor time that stage runs cost the flow's process and the server, at most 3% of a capture's.
"""

import argparse
import json
import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import psutil

from glint.flows.runtime.prefect_server import ensure_server, stop_server
from glint.storage.catalogue.loading import Catalogue, Region, load, write
from glint.tasks.engine.references import CaptureReference
from glint.tasks.engine.stage import perform, stage_keys
from glint.tasks.pipeline import STAGES, warm_up
from glint.tasks.simulation.simulate import CaptureOptions, simulate

CODE = """
import atexit, json, time
from glint.flows.cli.main import main
from glint.flows.runtime.prefect_server import Server
atexit.register(lambda: print(json.dumps({"kind": "cpu", "seconds": time.process_time()}), flush=True))
"""
WITHOUT_STAGE_RUNS = """
connected = Server.connected
def without_stage_runs(self):
    from glint.flows.pipeline.stage_runs import StageRun
    StageRun._announce = lambda *arguments: None
    return connected(self)
Server.connected = without_stage_runs
"""
FLUSH_SECONDS = 4.0
"""Within which the server has recorded the last events."""
SHAPES = ("hemisphere", "fish", "bird", "cylinder")


def simulated(folder: Path, captures: int, frames: int, scale: float) -> Path:
    """A catalogue of captures, each with a region of its own, so that no frames are shared."""
    for shape in SHAPES:
        simulate(shape, folder / "shapes", CaptureOptions(frames=frames, scale=scale))
    shapes, entries = load(folder / "shapes" / "catalogue.yaml").objects, []
    for number in range(captures):
        entry = shapes[number % len(shapes)]
        (capture,) = entry.captures
        assert capture.region is not None
        shift = number // len(shapes)
        region = Region(**capture.region.model_dump() | {"x": capture.region.x - shift})
        moved = capture.model_copy(update={"region": region})
        entries.append(entry.model_copy(update={"id": f"object-{number:03}", "captures": (moved,)}))
    write(Catalogue.model_validate({"schema": 1, "name": "orchestration", "objects": entries}), folder / "c.yaml")
    return folder / "c.yaml"


def stages_alone(reference: CaptureReference) -> None:
    """All stages of a capture in this process."""
    work = reference.workspace()
    keys = stage_keys(work, STAGES)
    for stage in STAGES:
        perform(work, stage, keys[stage.name])


def by_pool(catalogue: Path, store: Path, processes: int) -> float:
    """Seconds of all captures in a pool of warm processes."""
    objects = load(catalogue).objects
    references = [CaptureReference(str(catalogue), each.id, "front", str(store), "pool") for each in objects]
    with multiprocessing.get_context("spawn").Pool(processes, warm_up) as pool:
        pool.map(abs, range(64), chunksize=1)
        started = time.monotonic()
        pool.map(stages_alone, references, chunksize=1)
        return time.monotonic() - started


@dataclass(frozen=True)
class Costs:
    """Seconds of a run from its first stage to its end, and before; processor seconds of its parts, and its stages."""

    seconds: float
    start_up: float
    flow_cpu: float
    server_cpu: float
    stage_seconds: float
    stages: int


def own_server() -> psutil.Process:
    """Return the process of the embedded server, and start it if need be; runs find it by themselves."""
    for name in ("PREFECT_API_URL", "PREFECT_HOME"):
        os.environ.pop(name, None)
    process = ensure_server().process
    assert process is not None
    os.environ.pop("PREFECT_API_URL")
    return psutil.Process(process[0])


def by_run(catalogue: Path, store: Path, workers: int, stage_runs: bool = True) -> Costs:
    """Measure a run, with or without stages on Prefect's timeline."""
    code = CODE + ("" if stage_runs else WITHOUT_STAGE_RUNS) + "main()"
    server = own_server()
    before, stages, flow_cpu = sum(server.cpu_times()[:2]), list[float](), 0.0
    words = [
        sys.executable,
        "-c",
        code,
        "run",
        str(catalogue),
        "--store",
        str(store),
        "--workers",
        str(workers),
        "--json",
    ]
    begun, first = time.time(), None
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            event = json.loads(line)
            if event["kind"] == "cpu":
                flow_cpu = event["seconds"]
            if event["kind"] == "stage":
                stages.append(event["seconds"])
                first = first or event["time"] - event["seconds"]
    if process.returncode != 0 or first is None:
        raise SystemExit("the run failed")
    seconds = time.time() - first
    time.sleep(FLUSH_SECONDS)
    server_cpu = sum(server.cpu_times()[:2]) - before
    return Costs(seconds, first - begun, flow_cpu, server_cpu, sum(stages), len(stages))


def timeline_costs(catalogue: Path, folder: Path, repeats: int) -> None:
    """Print what stage runs cost, from runs with and without them in turn."""
    runs: dict[bool, list[Costs]] = {True: [], False: []}
    for number in range(repeats):
        for stage_runs in (True, False):
            runs[stage_runs].append(by_run(catalogue, folder / f"timeline-{number}-{stage_runs}", 2, stage_runs))

    def per_stage(name: str) -> float:
        means = [sum(getattr(run, name) / run.stages for run in runs[key]) / repeats for key in (True, False)]
        return means[0] - means[1]

    flow, server = 1000 * per_stage("flow_cpu"), 1000 * per_stage("server_cpu")
    stage_ms = 1000 * sum(run.stage_seconds / run.stages for run in runs[False]) / repeats
    with_runs, without = (sum(run.seconds for run in runs[key]) / repeats for key in (True, False))
    print(
        f"stage runs: {flow:.1f} ms in the flow's process, {server:.1f} ms in the server for each stage of"
        f" {stage_ms:.0f} ms ({(flow + server) / stage_ms:.1%});"
        f" runs of {with_runs:.1f} s with, {without:.1f} s without",
        flush=True,
    )


def main() -> None:
    """Print seconds and ratios."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--captures", type=int, default=20)
    parser.add_argument("--frames", type=int, default=1000)
    parser.add_argument("--scale", type=float, default=0.6)
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--timeline-only", action="store_true")
    chosen = parser.parse_args()
    os.environ |= {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        os.environ["GLINT_HOME"] = str(folder / "home")
        stack.callback(stop_server)
        catalogue = simulated(folder, chosen.captures, chosen.frames, chosen.scale)
        timeline_costs(catalogue, folder, chosen.repeats)
        if chosen.timeline_only:
            return
        alone = by_pool(catalogue, folder / "pool", 2)
        print(
            f"{chosen.captures} captures of {chosen.frames:,} frames: stages alone, two processes {alone:.1f} s",
            flush=True,
        )
        two = by_run(catalogue, folder / "two", 2)
        print(
            f"glint run, two workers {two.seconds:.1f} s ({two.seconds / alone:.2f} times),"
            f" after {two.start_up:.1f} s of start-up",
            flush=True,
        )
        one = by_run(catalogue, folder / "one", 1)
        print(
            f"glint run, one worker {one.seconds:.1f} s: two are {one.seconds / two.seconds:.2f} times as fast",
            flush=True,
        )


if __name__ == "__main__":
    main()
