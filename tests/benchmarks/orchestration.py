"""What orchestration costs: `glint run` against the same stages without Prefect and Dask, and two workers against one.

    python -m tests.benchmarks.orchestration [--captures 20] [--frames 1000] [--scale 0.6]

The captures are simulated (four shapes, whose regions are shifted so that no frames are shared); scale: their size
against the paper's.
The stages alone are performed by a pool of two processes, a capture each at a time, with the same commits to a store of
their own. Both start with warm libraries: of a run the seconds count from its first stage to its last event, and its
start-up is printed beside them. The bars: 1.1 times the pool's seconds; two workers 1.7 times as fast as one.
"""

import argparse
import json
import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from glint.storage.catalogue.loading import Catalogue, Region, load, write
from glint.tasks.engine.references import CaptureReference
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from glint.tasks.warm_up import warm_up
from tests.benchmarks.ratios import line
from tests.tasks.make_context import perform_all

RUN = [sys.executable, "-c", "from glint.flows.cli.main import main; main()", "run"]
POOL_BAR, WORKERS_BAR = 1.1, 1.7
"""Of a run against the pool, and of two workers against one."""
SHAPES = ("hemisphere", "fish", "bird", "cylinder")


def simulated(folder: Path, captures: int, frames: int, scale: float) -> Path:
    """Make a catalogue of captures, each with a region of its own, so that no frames are shared."""
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
    """Perform all stages of a capture in this process."""
    perform_all(reference.context())


def by_pool(catalogue: Path, store: Path, processes: int) -> float:
    """Seconds of all captures in a pool of warm processes."""
    objects = load(catalogue).objects
    references = [CaptureReference(str(catalogue), item.id, "front", str(store), "pool") for item in objects]
    with multiprocessing.get_context("spawn").Pool(processes, warm_up) as pool:
        pool.map(abs, range(64), chunksize=1)
        started = time.monotonic()
        pool.map(stages_alone, references, chunksize=1)
        return time.monotonic() - started


def by_run(catalogue: Path, store: Path, workers: int) -> tuple[float, float]:
    """Seconds of a run from its first stage to its end, and before that."""
    words = [*RUN, str(catalogue), "--store", str(store), "--workers", str(workers), "--json"]
    begun, first = time.time(), None
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            event = json.loads(line)
            if event["kind"] == "stage" and first is None:
                first = event["time"] - event["seconds"]
    if process.returncode != 0 or first is None:
        raise SystemExit("the run failed")
    return time.time() - first, first - begun


def main() -> None:
    """Print seconds and ratios."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--captures", type=int, default=20)
    parser.add_argument("--frames", type=int, default=1000)
    parser.add_argument("--scale", type=float, default=0.6)
    chosen = parser.parse_args()
    os.environ |= {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        catalogue = simulated(folder, chosen.captures, chosen.frames, chosen.scale)
        alone = by_pool(catalogue, folder / "pool", 2)
        print(
            f"{chosen.captures} captures of {chosen.frames:,} frames: stages alone, two processes {alone:.1f} s",
            flush=True,
        )
        two, before = by_run(catalogue, folder / "two", 2)
        print(f"glint run, two workers {two:.1f} s, after {before:.1f} s")
        print(line("run with two workers / stages in two processes", two / alone, POOL_BAR), flush=True)
        single, _ = by_run(catalogue, folder / "one", 1)
        print(f"glint run, one worker {single:.1f} s")
        print(line("two workers / one", single / two, WORKERS_BAR, least=True), flush=True)


if __name__ == "__main__":
    main()
