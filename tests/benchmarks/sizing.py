"""What a capture costs beside its computing, and how that grows: the constants of docs/sizing.md.

    python -m tests.benchmarks.sizing [--captures 2000] [--per-object 20] [--frames 64] [--s3] [--idle SECONDS]

Tiny captures that share one video, labelled by their brightest clusters, are run as one catalogue, so that seconds,
memory and bytes are the flow's own. Every hundred captures: seconds so far, seconds of processor of this process, the
Dask workers and the Prefect server, their memory, bytes of the database. Then the store's bytes and files by kind, and
the seconds of a second run that finds everything unchanged. With --s3 the store is on an S3 gateway of its own (see
tests/s3_gateway.py), whose requests are counted. With --idle only the processor time of a cluster without work is
measured, in the process that would run the flow.
"""

import argparse
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import obstore
import psutil

from glint.flows.pipeline.run import run
from glint.flows.reporting.events import CaptureFailed, Event
from glint.flows.runtime.dask_cluster import DASHBOARD_SECONDS, Cluster
from glint.flows.runtime.prefect_server import start_server, stop_server
from glint.storage.catalogue.loading import Catalogue, load, write
from glint.storage.locations.location import Location
from tests.s3_gateway import Gateway
from tests.scene import draw_scene


def drawn(folder: Path, captures: int, per_object: int, frames: int) -> Path:
    """Make a catalogue of captures of the same video."""
    entry = load(draw_scene(folder, frames=frames).catalogue).objects[0]
    (capture,) = entry.captures
    objects = []
    for first in range(0, captures, per_object):
        numbers = range(first, min(first + per_object, captures))
        views = tuple(capture.model_copy(update={"id": f"view-{number:05}"}) for number in numbers)
        objects.append(entry.model_copy(update={"id": f"object-{first // per_object:04}", "captures": views}))
    content = {"schema": 1, "name": "sizing", "objects": objects, "parameters": {"labels": {"method": "winner"}}}
    write(Catalogue.model_validate(content), folder / "c.yaml")
    return folder / "c.yaml"


class Watch:
    """Counts captures as they end, and notes every `interval`-th."""

    def __init__(self, home: Path, interval: int = 100) -> None:
        self.home, self.interval, self.captures, self.failed = home, interval, 0, list[str]()
        self.begun = self.first = 0.0

    def __enter__(self) -> "Watch":
        self.begun = time.monotonic()
        return self

    def __exit__(self, *_: object) -> None:
        """Do nothing: nothing is open."""

    def emit(self, event: Event) -> None:
        self.first = self.first or time.monotonic()
        self.failed += [event.text] if isinstance(event, CaptureFailed) else []
        self.captures += event.kind in ("capture", "failed")
        if event.kind == "capture" and self.captures % self.interval == 0:
            self.note()

    def note(self) -> dict[str, Any]:
        """Print what is known now."""
        server = _server(self.home)
        # The server, too, is a child of the process that started it.
        workers = [child for child in psutil.Process().children(recursive=True) if child.pid != server.pid]
        databases = list(self.home.rglob("prefect.db*"))
        facts = {
            "captures": self.captures,
            "seconds": round(time.monotonic() - self.first, 1),
            "start_up": round(self.first - self.begun, 1),
            "flow_MB": round(psutil.Process().memory_info().rss / 1e6),
            "largest_worker_MB": round(max((worker.memory_info().rss for worker in workers), default=0) / 1e6),
            "server_MB": round(server.memory_info().rss / 1e6),
            "flow_cpu": _cpu([psutil.Process()]),
            "workers_cpu": _cpu(workers),
            "server_cpu": _cpu([server]),
            "database_MB": round(sum(path.stat().st_size for path in databases) / 1e6, 1),
        }
        print(json.dumps(facts), flush=True)
        return facts


def _server(home: Path) -> psutil.Process:
    (state,) = home.rglob("server.json")
    return psutil.Process(json.loads(state.read_text())["process"][0])


def _cpu(processes: Sequence[psutil.Process]) -> float:
    """Return the seconds of processor that they have used so far, which other work on the machine does not change."""
    times = [process.cpu_times() for process in processes if process.is_running()]
    return round(sum(used.user + used.system for used in times), 1)


def kinds(place: Location) -> dict[str, dict[str, float]]:
    """Return files and bytes of a store by kind."""
    by_kind: dict[str, list[int]] = defaultdict(list)
    for meta in (meta for part in obstore.list(place.obstore()) for meta in part):
        kind, _, rest = meta["path"].partition("/")
        inner = rest.split("/")
        by_kind[f"{kind}/{inner[2]}" if kind == "objects" and len(inner) > 3 else kind].append(meta["size"])
    return {kind: {"files": len(sizes), "MB": round(sum(sizes) / 1e6, 2)} for kind, sizes in sorted(by_kind.items())}


def requests(gateway: Gateway | None) -> dict[str, int]:
    """Return the requests that the gateway has served so far."""
    if gateway is None:
        return {}
    (socket,) = gateway.folder.glob("client.rgw*.asok")
    done = subprocess.run(["ceph", "--admin-daemon", str(socket), "perf", "dump"], capture_output=True, text=True)
    counters = next(
        facts for name, facts in json.loads(done.stdout).items() if name.startswith("rgw") and "req" in facts
    )
    return {
        name: int(counters[name])
        for name in ("req", "get", "put", "list_obj", "del_obj", "get_b", "put_b")
        if name in counters
    }


def idle(workers: int, seconds: float) -> None:
    """Print what a cluster without work costs this process, once Dask's dashboard is there."""
    with Cluster(None, workers) as cluster:
        assert cluster.client.scheduler_info()
        time.sleep(2 * DASHBOARD_SECONDS)
        before = _cpu([psutil.Process()])
        time.sleep(seconds)
        print(f"idle: {1000 * (_cpu([psutil.Process()]) - before) / seconds:.1f} ms of processor a second")


def measure(options: argparse.Namespace, folder: Path, gateway: Gateway | None) -> None:
    """Run twice, and print what it took."""
    catalogue = drawn(folder / "captures", options.captures, options.per_object, options.frames)
    store = "s3://store/sizing" if gateway else str(folder / "store")
    start_server().wait()
    for name in ("first", "second"):
        before = requests(gateway)
        with Watch(folder / "home", options.every) as watch:
            run(catalogue, store, watch, workers=options.workers)
            facts = watch.note()
        after = requests(gateway)
        print(
            json.dumps(
                {
                    "run": name,
                    **facts,
                    "failed": watch.failed[:3],
                    "requests": {key: after[key] - before[key] for key in after},
                }
            )
        )
    print(json.dumps({"store": kinds(Location.parse(store))}))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--captures", type=int, default=2000)
    parser.add_argument("--per-object", type=int, default=20)
    parser.add_argument("--frames", type=int, default=64)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--every", type=int, default=100)
    parser.add_argument("--s3", action="store_true")
    parser.add_argument("--idle", type=float, metavar="SECONDS")
    options = parser.parse_args()
    if options.idle:
        idle(options.workers, options.idle)
        return
    folder = Path(tempfile.mkdtemp(prefix="sizing-"))
    os.environ["GLINT_HOME"] = str(folder / "home")
    try:
        if options.s3:
            with Gateway(folder / "s3") as gateway:
                os.environ.update(gateway.environment)
                measure(options, folder, gateway)
        else:
            measure(options, folder, None)
    finally:
        stop_server()
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
