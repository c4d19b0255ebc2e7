"""Measure what stages on Prefect's timeline cost, in processor time of the flow's process and of the server.

    python -m tests.benchmarks.stage_runs [--captures 20] [--repeats 3]

Captures of ten stages that only wait are reported to a server of their own: not announced at all, announced
at their ends, and announced at start and end, as stages are that take longer than a second. The bar: 3% of what a
capture computes, 3.6 processor seconds at 0.6 of the paper's size and 1,000 frames, of which three stages take longer.
"""

import argparse
import os
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import psutil

STAGES = tuple(f"stage-{number}" for number in range(10))
STAGE_SECONDS = 0.15
FLUSH_SECONDS = 5.0
"""Within which the server has recorded the last events."""
CAPTURE_MS, LONG_STAGES = 3600, 3


def flow_of(captures: int) -> Any:
    """Return a flow that reports captures to a sink, three at once."""
    from prefect import flow, task

    from glint.flows.pipeline.object import submit
    from glint.flows.pipeline.prefect_sink import PrefectSink
    from glint.flows.reporting.events import StageEnded, StageStarted

    @task(name="capture", task_run_name="{name}", persist_result=False)
    def capture(sink: PrefectSink, name: str) -> None:
        with sink.attach(name):
            for stage in STAGES:
                sink.emit(StageStarted(name, stage))
                time.sleep(STAGE_SECONDS)
                sink.emit(StageEnded(name, stage, STAGE_SECONDS))

    @flow(name="object", persist_result=False)
    def process() -> None:
        with PrefectSink() as sink, ThreadPoolExecutor(3) as pool:
            futures = [submit(pool, capture, sink, f"object/capture-{number}") for number in range(captures)]
            for future in futures:
                future.result()

    return process


def main() -> None:
    """Print processor milliseconds per stage."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--captures", type=int, default=20)
    parser.add_argument("--repeats", type=int, default=3)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as home:
        os.environ.pop("PREFECT_API_URL", None)
        os.environ["GLINT_HOME"] = home
        from glint.flows.runtime.prefect_server import ensure_server, stop_server

        server = ensure_server()
        assert server.process is not None
        try:
            with server.connected():
                measure(psutil.Process(server.process[0]), chosen.captures, chosen.repeats)
        finally:
            stop_server()


def measure(server: psutil.Process, captures: int, repeats: int) -> None:
    """Run each kind in turn, after a run that warms both processes up, and print the means."""
    from glint.flows.pipeline import prefect_sink
    from glint.flows.pipeline.stage_runs import StageRun

    announce, process = StageRun._announce, flow_of(captures)
    process()
    costs: dict[str, list[float]] = {"not announced": [], "at the end": [], "at start and end": []}
    for _ in range(repeats):
        for kind, milliseconds in costs.items():
            prefect_sink.RUNNING_SECONDS = STAGE_SECONDS / 3 if kind == "at start and end" else 1.0
            silent = kind == "not announced"
            StageRun._announce = (lambda *arguments: None) if silent else announce  # type: ignore[method-assign]
            before = time.process_time() + sum(server.cpu_times()[:2])
            process()
            time.sleep(FLUSH_SECONDS)
            seconds = time.process_time() + sum(server.cpu_times()[:2]) - before
            milliseconds.append(1000 * seconds / captures / len(STAGES))
    none, end, live = (sum(milliseconds) / repeats for milliseconds in costs.values())
    total = (len(STAGES) - LONG_STAGES) * (end - none) + LONG_STAGES * (live - none)
    print(f"per stage: {end - none:.1f} ms announced at its end, {live - none:.1f} ms at start and end")
    print(f"per capture: {total:.0f} ms, {total / CAPTURE_MS:.1%} of {CAPTURE_MS} ms")


if __name__ == "__main__":
    main()
