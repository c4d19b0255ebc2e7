"""Requests and bytes by which stages read the cache of frames of one capture, counted in a local store.

    python -m tests.benchmarks.frame_reads CATALOGUE STORE

The catalogue's first capture must be up to date in the store.
"""

import argparse
from collections import Counter
from pathlib import Path
from typing import Any

import zarr.storage._local

from glint.storage.catalogue.loading import load
from glint.tasks.engine.references import CaptureReference
from glint.tasks.engine.stage import no_progress
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.pipeline import BY_NAME
from glint.tasks.stages.frames import open_frames
from glint.tasks.stages.levels import levels


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("catalogue", type=Path)
    parser.add_argument("store", type=Path)
    options = parser.parse_args()
    entry = load(options.catalogue).objects[0]
    work = CaptureReference(str(options.catalogue), entry.id, entry.captures[0].id, str(options.store), "r").context()
    local_store: Any = zarr.storage._local
    read, get = Counter[str](), local_store._get

    def counted(path: Path, *arguments: Any) -> Any:
        value = get(path, *arguments)
        if "/c/" in str(path):
            read.update(requests=1, bytes=len(value))
        return value

    local_store._get = counted
    for name in ("levels of frames", "lights", "clusters"):
        read.clear()
        if name in BY_NAME:
            BY_NAME[name].run(StageInputs(work, BY_NAME[name]), no_progress)
        else:
            levels(open_frames(work))
        print(f"{name}: {read['requests']} requests, {read['bytes'] / 1e6:.0f} MB", flush=True)


if __name__ == "__main__":
    main()
