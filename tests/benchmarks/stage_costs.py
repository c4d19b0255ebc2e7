"""What entry stage of one capture costs an S3 store: requests, bytes, seconds; the table of docs/sizing.md.

    python -m tests.benchmarks.stage_costs [CATALOGUE]

The catalogue's first capture (default: a simulated one with 2,000 frames) is worked on stage by stage, without Prefect
and Dask, in a store on an S3 gateway of its own, whose counters are read between the stages.
"""

import argparse
import os
import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

import obstore
import psutil

from glint.storage.catalogue.loading import load
from glint.storage.locations.location import Location
from glint.tasks.engine.references import CaptureReference
from glint.tasks.engine.stage import perform, stage_keys
from glint.tasks.pipeline import STAGES
from glint.tasks.publish import publish
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from glint.tasks.warm_up import warm_up
from tests.benchmarks.sizing import requests
from tests.s3_gateway import Gateway


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("catalogue", type=Path, nargs="?")
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="costs-"))
    catalogue = options.catalogue or simulate("hemisphere", folder, CaptureOptions(frames=2000)).catalogue
    entry = load(catalogue).objects[0]
    warm_up()
    with Gateway(folder / "s3") as gateway:
        os.environ.update(gateway.environment)
        store = Location.parse("s3://store/costs")
        work = CaptureReference(str(catalogue), entry.id, entry.captures[0].id, store.uri, "costs").context()
        served, process = requests(gateway), psutil.Process()
        print("| stage | GET | PUT | other | MB read | MB written | seconds of processor |")
        print("|---|---:|---:|---:|---:|---:|---:|")

        def row(name: str, used: float) -> None:
            nonlocal served
            now = requests(gateway)
            new = {key: now[key] - served[key] for key in now}
            served = now
            other = new["req"] - new["get"] - new["put"]
            megabytes = f"{new['get_b'] / 1e6:.1f} | {new['put_b'] / 1e6:.1f}"
            print(f"| {name} | {new['get']} | {new['put']} | {other} | {megabytes} | {used:.1f} |", flush=True)

        started = process.cpu_times()
        keys = stage_keys(work, STAGES)
        work.repository.captures()
        row("open", _since(process, started))
        for stage in STAGES:
            started = process.cpu_times()
            perform(work, stage, keys[stage.name])
            row(stage.name, _since(process, started))
        started = process.cpu_times()
        publish([work], "costs", str(catalogue))
        row("version", _since(process, started))
        sizes = [meta["size"] for part in obstore.list(store.obstore()) for meta in part]
        print(f"\n{len(sizes)} objects, {sum(sizes) / 1e6:.1f} MB; at {time.strftime('%H:%M')}")
    shutil.rmtree(folder)


def _since(process: psutil.Process, started: Any) -> float:
    now = process.cpu_times()
    return now.user + now.system - started.user - started.system


if __name__ == "__main__":
    main()
