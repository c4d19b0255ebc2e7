"""What TLS between the processes of a local Dask cluster costs a capture, as a ratio.

    python -m tests.benchmarks.transport [--repeat 5] [--frames 1500] [--scale 0.8]

Two clusters of two workers are up, one with TLS and one without; the same simulated capture is run on them in turn,
each time into an empty store. Processor seconds of client, scheduler and workers are compared, as they depend less on
what else the machine does than seconds of the clock, which are printed beside them. The bar: 1.03, with the checksums.
"""

import argparse
import os
import tempfile
from pathlib import Path
from statistics import median
from time import perf_counter
from unittest.mock import patch

import psutil

from glint.flows.pipeline.run import PRELOADED
from glint.flows.runtime.dask_cluster import Cluster
from glint.flows.runtime.prefect_server import ensure_server

MODES = ("tls", "tcp")


def processor_seconds(workers: list[int]) -> float:
    """Processor seconds so far of this process, which is client and scheduler, and of workers, by their ids."""
    times = [psutil.Process().cpu_times(), *(psutil.Process(pid).cpu_times() for pid in workers)]
    return sum(item.user + item.system for item in times)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--frames", type=int, default=1500)
    parser.add_argument("--scale", type=float, default=0.8)
    chosen = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as folder,
        ensure_server(Path(folder) / "home").connected(),
        Cluster(workers=2, modules=PRELOADED) as tls,
    ):
        assert tls.address.startswith("tls://")
        with (
            patch("glint.flows.runtime.dask_cluster.Security.temporary", return_value=None),
            Cluster(workers=2, modules=PRELOADED) as tcp,
        ):
            assert tcp.address.startswith("tcp://")
            measure(Path(folder), dict(zip(MODES, (tls, tcp), strict=True)), chosen)
    from glint.flows.runtime.prefect_server import stop_server

    stop_server(Path(folder) / "home")


def measure(folder: Path, clusters: dict[str, Cluster], chosen: argparse.Namespace) -> None:
    """Run the capture on the clusters in turn, and print the medians and their ratio."""

    from glint.flows.pipeline.catalogue import run_whole_catalogue
    from glint.flows.pipeline.context import activate
    from glint.tasks.simulation.simulate import CaptureOptions, simulate

    options = CaptureOptions(frames=chosen.frames, scale=chosen.scale)
    catalogue = simulate("hemisphere", folder / "captures", options).catalogue
    workers = {mode: list(clusters[mode].client.run(os.getpid).values()) for mode in MODES}
    processor: dict[str, list[float]] = {mode: [] for mode in MODES}
    clock: dict[str, list[float]] = {mode: [] for mode in MODES}
    for turn in range(chosen.repeat + 1):
        for mode in MODES if turn % 2 else reversed(MODES):
            before, begin = processor_seconds(workers[mode]), perf_counter()
            with activate(clusters[mode].client):
                result = run_whole_catalogue(str(catalogue), str(folder / f"store-{turn}-{mode}"))
            assert not result.failed, result.failed
            if turn:  # the first one warms up
                processor[mode].append(processor_seconds(workers[mode]) - before)
                clock[mode].append(perf_counter() - begin)
    for mode in MODES:
        print(f"{mode}: {median(processor[mode]):.2f} s of processors, {median(clock[mode]):.2f} s of the clock")
    pairs = [tls / tcp for tls, tcp in zip(processor["tls"], processor["tcp"], strict=True)]
    print(f"processor seconds with TLS over those without: {median(pairs):.3f} ({min(pairs):.3f} to {max(pairs):.3f})")


if __name__ == "__main__":
    main()
