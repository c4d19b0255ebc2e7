"""What it costs to force a saved stage onto the disk: its files several at once, one by one, and not at all.

    python -m tests.benchmarks.flushes [--folder FOLDER] [--repeat 5]

Eleven stages of four small arrays each are saved into a new store in FOLDER (default: the temporary folder), the three
ways in turns. Printed: milliseconds of a save, the median of all, and seconds of processor of a save.
"""

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

import numpy as np

from glint.storage import fsync
from glint.storage.locations.location import Location
from glint.storage.versions import transaction
from glint.storage.versions.repository import ObjectRepository

STAGES, ARRAYS, SHAPE = 11, 4, (60, 100)


def save_times(folder: Path | None) -> list[tuple[float, float]]:
    """Save all stages into a new store; return the wall and processor seconds of each."""
    random, times = np.random.default_rng(0), []
    with tempfile.TemporaryDirectory(dir=folder) as store:
        repository = ObjectRepository.open(Location.parse(store), "object")
        for stage in range(STAGES):
            arrays = {f"array-{number}": random.normal(size=SHAPE) for number in range(ARRAYS)}
            wall, processor = perf_counter(), process_time()
            repository.save("front", f"stage-{stage}", "key", arrays, {})
            times.append((perf_counter() - wall, process_time() - processor))
    return times


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--repeat", type=int, default=5)
    options = parser.parse_args()
    at_once, flush_tree = fsync.N_FLUSHES, transaction.flush_tree
    unflushed: Callable[..., None] = lambda *_: None  # noqa: E731
    ways = {f"{at_once} at once": (at_once, flush_tree), "one by one": (1, flush_tree), "not at all": (1, unflushed)}
    times: dict[str, list[tuple[float, float]]] = {way: [] for way in ways}
    save_times(options.folder)
    for _ in range(options.repeat):
        for way, (fsync.N_FLUSHES, transaction.flush_tree) in ways.items():
            times[way] += save_times(options.folder)
    for way, readings in times.items():
        wall, processor = (1000 * median(part) for part in zip(*readings, strict=True))
        print(f"a stage saved, flushed {way}: {wall:.0f} ms, {processor:.0f} ms of processor")


if __name__ == "__main__":
    main()
