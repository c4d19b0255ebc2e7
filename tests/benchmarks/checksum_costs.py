"""Measure what checksums cost a capture: the share of its processor time that is spent in them.

    python -m tests.benchmarks.checksum_costs [--frames 1000] [--scale 0.6] [--repeats 3]

A simulated capture is computed in this process, once to compile and then `--repeats` times, each in a new store, and
published. Every function that computes or compares a checksum is timed (processor time of its thread). Then what
`glint run` does where nothing changed is timed: all that is stored is read and compared. Prints one JSON object; the
bar is 3% of a capture.
"""

import argparse
import json
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from zarr.codecs import Crc32cCodec

from glint.storage import seals
from glint.storage.frames import cache, ingest
from glint.storage.frames.shard_store import ShardStore
from glint.storage.versions import snapshots
from glint.storage.versions.stages import checksums
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.publish import publish
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from glint.tasks.up_to_date import up_to_date_records
from tests.tasks.make_context import make_context, perform_all

TIMED = (
    (checksums, "checksum"),
    (snapshots, "_check_place"),
    (seals, "_seal_of"),
    (cache, "metadata_digests"),
    (ingest, "metadata_digests"),
    (ShardStore, "_check"),
    (ShardStore, "_note"),
    (Crc32cCodec, "_encode_sync"),
    (Crc32cCodec, "_decode_sync"),
    (CaptureContext, "stamps"),
    (CaptureContext, "check_unchanged"),
)
"""All that computes or compares checksums."""


def timed(spent: Counter[str], name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that adds its processor seconds to those spent."""

    def run(*arguments: Any, **options: Any) -> Any:
        started = time.thread_time()
        try:
            return function(*arguments, **options)
        finally:
            spent[name] += time.thread_time() - started  # type: ignore[assignment]

    return run


def main() -> None:
    """Print the costs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=1000)
    parser.add_argument("--scale", type=float, default=0.6)
    parser.add_argument("--repeats", type=int, default=3)
    chosen = parser.parse_args()
    spent, total, unchanged, checked = Counter[str](), 0.0, 0.0, 0.0
    for owner, name in TIMED:
        setattr(owner, name, timed(spent, name, getattr(owner, name)))
    with tempfile.TemporaryDirectory() as folder:
        options = CaptureOptions(frames=chosen.frames, scale=chosen.scale)
        catalogue = simulate("hemisphere", Path(folder), options).catalogue
        for number in range(chosen.repeats + 1):
            context = make_context(catalogue, Path(folder) / f"store-{number}")
            spent.clear()
            started = time.process_time()
            perform_all(context)
            publish([context], "run", str(catalogue))
            seconds, costs = time.process_time() - started, sum(spent.values())
            if number == 0:
                continue
            total, checked = total + seconds, checked + costs
            started = time.process_time()
            assert up_to_date_records([context]) is not None
            unchanged += time.process_time() - started
    outcome = {
        "capture, processor seconds": round(total / chosen.repeats, 3),
        "checksums, processor seconds": round(checked / chosen.repeats, 4),
        "share": round(checked / total, 4),
        "unchanged, processor seconds": round(unchanged / chosen.repeats, 3),
        "last, by function": {name: round(value, 4) for name, value in spent.most_common()},
    }
    print(json.dumps(outcome, indent=1))


if __name__ == "__main__":
    main()
