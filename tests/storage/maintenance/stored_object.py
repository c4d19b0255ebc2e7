"""An object with versions and cached frames to be maintained, and the parts of a report."""

import os
import time
from datetime import timedelta

import numpy as np

from glint.storage.locations.location import Location
from glint.storage.maintenance.maintain import Cleaning, Maintenance
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import StoredFile

NOW = timedelta(0)
STAGES = ("surface",)


def save(location: Location, data: bytes, key: str, object_id: str = "glass") -> None:
    """Save a stage with an array and a file."""
    repository = ObjectRepository.open(location, object_id)
    arrays = {"depth": np.arange(6.0).reshape(2, 3)}
    files = {"surface.ply": StoredFile(data, "model/ply")}
    repository.save("front", "surface", key, arrays, {"counts": {}, "warnings": []}, files)


def versions(location: Location, count: int) -> None:
    """Publish `count` versions, each with a file of its own."""
    for number in range(count):
        save(location, mesh(number), f"key-{number}")
        ObjectRepository.open(location, "glass").publish(["front"], {}, STAGES)


def mesh(number: int) -> bytes:
    """Return the file of a version: incompressible, and large enough for a chunk of its own."""
    return np.random.default_rng(number).bytes(5000)


def part(done: Maintenance, target: str) -> Cleaning:
    return next(cleaning for cleaning in done.cleanings if cleaning.target == target)


def frames(location: Location, digest: str, size: int, age: timedelta) -> None:
    """Write a stand-in for a cache of frames that was last used `age` ago."""
    assert location.local is not None
    folder = location.local / "frames" / digest / "object" / "c"
    folder.mkdir(parents=True)
    then = time.time() - age.total_seconds()
    for path, data in ((folder.parents[1] / "zarr.json", b"{}"), (folder / "0", b"x" * (size - 2))):
        path.write_bytes(data)
        os.utime(path, (then, then))
