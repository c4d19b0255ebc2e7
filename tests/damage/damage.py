"""Damage a store in every way a disk does, and see that nothing damaged is ever served.

    python -m tests.damage.damage [--trials 1200] [--seed 0]

Each trial does one damage to one or two random files of a small store (a flipped bit, a sector of zeros or of noise, a
cut, a removal, two files that change places), reads everything by every way there is (the reading interface, status,
history, diff, export, the newest results, the frames), and repairs the damage. What is read must equal the original, or
be an error that names what is damaged and the remedy. Prints one JSON object: trials and errors by kind of file and of
damage, and what was silent or told badly; exit status 0 if nothing was.
"""

import argparse
import hashlib
import json
import random
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import glint
from glint.flows.cli.tables import history_rows, status_rows
from glint.storage.catalogue.loading import Region
from glint.storage.errors import GlintError, StoreError
from glint.storage.export.export import export
from glint.storage.footage.source import open_footage
from glint.storage.frames.cache import FrameCache
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import WHOLE_OBJECT, StoredFile
from glint.tasks.version_diff import compare
from tests.glint.sample_store import make_store
from tests.storage.footage.videos import write_video

OBJECTS = ("vase", "wine-glass")
FACTS = ("mask", "normals", "depth", "confidence", "provenance", "lights", "half_vectors", "mesh", "report", "camera")
"""What the reading interface gives of a capture."""
DAMAGES = ("bit", "zeros", "noise", "cut", "removed", "swapped")
SECTOR = 512
"""Bytes of a sector of a disk."""
CROPS = {"object": Region(x=3, y=5, width=70, height=66), "sphere-0": Region(x=80, y=60, width=20, height=21)}
VALUE = re.compile(r"(array|file) '[\w.-]+' of (vase|wine-glass)/[\w-]+/[\w-]+( in v\d)? is damaged")
RECORD = re.compile(r"(vase|wine-glass)/[\w-]+(/[\w-]+)?( in v\d)? is damaged")
INDEX = re.compile(r"(index|root|record of .*) of (object )?(vase|wine-glass)")
FRAMES = re.compile(
    r"the (frames( of [\w-]+)?|attributes of the frames) at .*frames/[ab] |there are no frames at .*frames/[ab]:"
)
"""Errors that name what is damaged, as closely as is known."""


def build(folder: Path) -> Path:
    """Make a store of two objects that look alike, with two versions, and the frames of two videos."""
    store = make_store(folder / "store")
    original = ObjectRepository.open(Location.parse(store), "wine-glass")
    _copy(original, ObjectRepository.open(Location.parse(store), "vase"))
    generator = np.random.default_rng(0)
    for name in "ab":
        frames = generator.integers(0, 255, (150, 81, 100), np.uint8)
        video = write_video(folder / f"{name}.mkv", list(frames), "ffv1", "gray")
        FrameCache.ingest(open_footage(video), Location.parse(store), name, CROPS)
    return store


def _copy(original: ObjectRepository, copy: ObjectRepository) -> None:
    """Save what another object has, with other values, so that nothing of one is right in the other."""
    for version in original.history():
        for capture in version.stages:
            for stage, result in original.load_capture(capture, version.name).items():
                arrays = {name: result.read(name) for name in result.arrays}
                changed = {name: values[::-1].copy() if values.ndim == 2 else values for name, values in arrays.items()}
                files = {
                    name: StoredFile(result.read_file(name), info.media_type) for name, info in result.files.items()
                }
                copy.save(capture, stage, result.key, changed, result.record, files)
        copy.publish(list(version.stages), version.metadata)


Values = dict[tuple[str, ...], str | Exception]
"""Digests of what was read, by what it is, or the error in its place."""

Served = Iterator[tuple[tuple[str, ...], str | Exception]]

WAYS = ("work", "rows", "diff", "export")
"""Ways to read an object beside the reading interface."""


def served(store: Path, ways: Collection[str], names: Collection[str], scratch: Path) -> Values:
    """Return what a store serves of these objects, and of `a` and `b`, the frames.

    ways: of WAYS; scratch: where exports go.
    """
    location, values = Location.parse(store), Values()
    for name in names:
        parts = [partial(_frames, location, name)] if name in "ab" else [partial(_object, store, name)]
        if name not in "ab":
            choice: dict[str, Callable[[Location, str], Served]] = {
                "work": _work,
                "rows": _rows,
                "diff": _differences,
                "export": partial(_exported, scratch),
            }
            parts += [partial(choice[way], location, name) for way in ways]
        for part in parts:
            values |= _guarded((name,), part)
    return values


def _guarded(name: tuple[str, ...], parts: Callable[[], Served]) -> Served:
    """Yield the parts; an error in between ends them, and takes their place."""
    try:
        yield from parts()
    except Exception as error:
        yield name, error


def _object(store: Path, object_id: str) -> Served:
    stored = glint.open(store)[object_id]
    yield (object_id, "versions"), _digest(list(stored))
    for name in list(stored):
        yield from _guarded((object_id, name), partial(_version, stored, name))


def _version(stored: Any, name: str) -> Served:
    version, place = stored[name], (stored.id, name)
    yield (*place, "facts"), _digest([dict(version.metadata), str(version.time), version.message, list(version)])
    for fact in ("model", "model_record"):
        yield _value((*place, fact), partial(getattr, version, fact))
    for capture in list(version):
        for fact in FACTS:
            yield _value((*place, capture, fact), partial(getattr, version[capture], fact))


def _work(location: Location, object_id: str) -> Served:
    repository = ObjectRepository.open(location, object_id, create=False)
    for capture in (*repository.captures(), WHOLE_OBJECT):
        for stage, result in repository.load_capture(capture).items():
            place = (object_id, "work", capture, stage)
            yield (*place, "record"), _digest([result.key, result.record])
            for name in result.arrays:
                yield _value((*place, name), partial(result.read, name))
            for name in result.files:
                yield _value((*place, name), partial(result.read_file, name))


def _rows(location: Location, object_id: str) -> Served:
    yield _value((object_id, "history"), partial(history_rows, location.uri, object_id))
    rows, unreadable = status_rows(location.uri)
    errors = [StoreError(row["error"], row["remedy"]) for row in unreadable if row["object"] == object_id]
    yield (object_id, "status"), errors[0] if errors else _digest([row for row in rows if row["object"] == object_id])


def _differences(location: Location, object_id: str) -> Served:
    difference = compare(ObjectRepository.open(location, object_id, create=False), "front", "v1", "v2")
    yield (object_id, "diff"), _digest([difference.figures, difference.angles, difference.depths, difference.changes])


def _exported(scratch: Path, location: Location, object_id: str) -> Served:
    out = scratch / object_id
    export(location, object_id, out)
    files = [path for path in sorted(out.rglob("*")) if path.is_file()]
    yield (object_id, "export"), _digest([[path.relative_to(out).as_posix(), path.read_bytes()] for path in files])


def _frames(location: Location, name: str) -> Served:
    cache = FrameCache.open(location, name)
    yield (name, "facts"), _digest([cache.frames, cache.total, cache.bits, str(cache.crops), cache.warnings])
    for crop in cache.crops:
        yield _value((name, crop), partial(cache.read, crop))
        yield _value((name, crop, "tile"), partial(cache.read, crop, slice(64, 128), slice(0, 20), slice(0, 20)))


def _value(name: tuple[str, ...], read: Callable[[], Any]) -> tuple[tuple[str, ...], str | Exception]:
    try:
        return name, _digest(read())
    except Exception as error:
        return name, error


def _digest(value: Any) -> str:
    digest = hashlib.sha256()

    def add(part: Any) -> None:
        if isinstance(part, np.ndarray):
            digest.update(f"{part.dtype}{part.shape}".encode() + np.ascontiguousarray(part).tobytes())
        elif isinstance(part, bytes):
            digest.update(part)
        elif isinstance(part, list | tuple):
            digest.update(f"{len(part)}".encode())
            for item in part:
                add(item)
        elif isinstance(part, dict):
            add(sorted(part.items()))
        elif hasattr(part, "__dataclass_fields__"):
            add([getattr(part, name) for name in part.__dataclass_fields__])
        else:
            digest.update(repr(part).encode())

    add(value)
    return digest.hexdigest()


@dataclass
class Damage:
    """One damage, undone at the end of the block. kind: of DAMAGES; files: relative to the store."""

    store: Path
    kind: str
    files: list[Path]
    generator: random.Random
    _whole: dict[Path, bytes] = field(default_factory=dict)

    def __enter__(self) -> "Damage":
        """Do the damage."""
        self._whole = {path: path.read_bytes() for path in self.files}
        first, data = self.files[0], bytearray(self._whole[self.files[0]])
        place = self.generator.randrange(len(data))
        start = place - place % SECTOR
        match self.kind:
            case "bit":
                data[place] ^= 1 << self.generator.randrange(8)
            case "zeros":
                data[start : start + SECTOR] = bytes(len(data[start : start + SECTOR]))
            case "noise":
                data[start : start + SECTOR] = self.generator.randbytes(len(data[start : start + SECTOR]))
            case "cut":
                del data[place:]
        if self.kind == "removed":
            first.unlink()
        elif self.kind == "swapped":
            second = self.files[1]
            first.write_bytes(self._whole[second])
            second.write_bytes(self._whole[first])
        else:
            first.write_bytes(data)
        return self

    def __exit__(self, *unused: object) -> None:
        """Undo it."""
        for path, data in self._whole.items():
            path.write_bytes(data)

    def __str__(self) -> str:
        """Name damage and files."""
        return f"{self.kind} {' and '.join(path.relative_to(self.store).as_posix() for path in self.files)}"


def damages(store: Path, trials: int, seed: int) -> Iterator[Damage]:
    """Yield random damages to the files of a store; every kind of file is as likely as any other."""
    generator = random.Random(seed)
    kinds: dict[str, list[Path]] = {}
    for path in sorted(store.rglob("*")):
        if path.is_file() and path.stat().st_size:
            kinds.setdefault(kind_of(path.relative_to(store)), []).append(path)
    for _ in range(trials):
        kind, damage = generator.choice(sorted(kinds)), generator.choice(DAMAGES)
        files = kinds[kind]
        if damage == "swapped":
            # Two files of the same size are the harder case.
            first = generator.choice(files)
            alike = [path for path in files if path != first and path.stat().st_size == first.stat().st_size]
            others = alike if alike and generator.random() < 0.5 else [path for path in files if path != first]
            others = others or [path for paths in kinds.values() for path in paths if path != first]
            yield Damage(store, damage, [first, generator.choice(others)], generator)
        else:
            yield Damage(store, damage, [generator.choice(files)], generator)


def kind_of(path: Path) -> str:
    """Return the kind of a file: of an object's repository the folder in it, of frames shards or metadata."""
    if path.parts[0] == "objects":
        return path.parts[3] if len(path.parts) > 4 else path.name
    return "frames' metadata" if path.name == "zarr.json" else "frames' shards"


def problems(before: Values, after: Values) -> list[str]:
    """Return what is wrong about what a damaged store serves: values that changed silently, errors that say little.

    A result that is gone from `work` is no silence: the next run computes it again.
    """
    errors = {name: value for name, value in after.items() if isinstance(value, Exception)}
    wrong = [
        f"silent: {'/'.join(name)}"
        for name in before.keys() | after.keys()
        if after.get(name) != before.get(name)
        and not (name[1:2] == ("work",) and name not in after)
        and not any(name[: len(place)] == place for place in errors)
    ]
    for name, error in errors.items():
        text = str(error)
        if not isinstance(error, GlintError):
            wrong.append(f"trace: {'/'.join(name)}: {type(error).__name__}: {text[:200]}")
        elif not any(pattern.search(text) for pattern in (VALUE, RECORD, INDEX, FRAMES)):
            wrong.append(f"vague: {'/'.join(name)}: {text[:300]}")
    return wrong


def run(store: Path, trials: int, seed: int, scratch: Path) -> dict[str, Any]:
    """Do so many trials; return how many gave errors, by kinds of file and of damage, and what was wrong.

    Each reads the damaged objects by the reading interface and by another way, or the damaged frames.
    """
    everything = (*OBJECTS, "a", "b")
    whole = served(store, WAYS, everything, scratch)
    assert [value for value in whole.values() if isinstance(value, Exception)] == []
    outcomes, wrong = Counter[str](), list[str]()
    for number, damage in enumerate(damages(store, trials, seed)):
        names = sorted({path.relative_to(store).parts[1] for path in damage.files})
        way = WAYS[number % len(WAYS)]
        with damage:
            after = served(store, [way], names, scratch)
        before = {name: whole[name] for name in whole if name[0] in names and _way_of(name) in ("", way)}
        wrong += [f"{damage}: {problem}" for problem in problems(before, after)[:3]]
        is_noticed = any(isinstance(value, Exception) for value in after.values())
        kind = kind_of(damage.files[0].relative_to(store))
        outcomes[f"{kind}, {damage.kind}: {'error' if is_noticed else 'equal'}"] += 1
    after = served(store, WAYS, everything, scratch)
    changed = [
        f"{name}: {after.get(name)}" for name in whole.keys() | after.keys() if after.get(name) != whole.get(name)
    ]
    assert changed == [], f"the damages were not undone: {changed[:3]}"
    return {"trials": trials, "seed": seed, "outcomes": dict(sorted(outcomes.items())), "wrong": wrong}


def _way_of(name: tuple[str, ...]) -> str:
    """Return the way by which a value was read, empty for the reading interface and frames."""
    return {"history": "rows", "status": "rows"}.get(name[1], name[1] if name[1] in WAYS else "")


def main() -> None:
    """Run the trials of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=1200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        store = build(Path(folder))
        outcome = run(store, options.trials, options.seed, Path(folder) / "exports")
    print(json.dumps(outcome, indent=1))
    sys.exit(1 if outcome["wrong"] else 0)


if __name__ == "__main__":
    main()
