"""Whatever happens to a file of a store, edits are read as they were saved, or there is an error with a remedy."""

import random
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glint.storage.edits.edits import Edits
from glint.storage.edits.models import CaptureEdits, Changes
from glint.storage.errors import GlintError
from glint.storage.locations.location import Location
from tests.storage.edits.sample_edits import VALUES
from tests.storage.stores import local_store

TRIALS = 60
HEADER_BYTES = 39
"""Of a file of the index. Behind it the library trusts what it reads, and one bit may make it fill the memory."""


def served(location: Location) -> list[Any]:
    """What is read of every revision of both captures, and the history; errors in place of what cannot be read."""
    values: list[Any] = []
    try:
        edits = Edits.open(location, "duck", create=False)
        values.append([item.model_dump() for item in edits.history()])
    except GlintError as error:
        return [error]
    for number in range(1, 5):
        for capture in ("front", "back"):
            try:
                values.append(plain(edits.current(capture, number)))
            except GlintError as error:
                values.append(error)
    return values


def plain(edits: CaptureEdits) -> Any:
    mask = None if edits.mask is None else edits.mask.tobytes()
    return edits.model_dump(exclude={"mask"}), mask


def damage(path: Path, chance: random.Random) -> str:
    kind, data = chance.choice(("bit", "zeros", "cut", "removed")), bytearray(path.read_bytes())
    if kind == "removed" or not data:
        path.unlink()
        return "removed"
    place = chance.randrange(len(data))
    if kind == "bit":
        place %= HEADER_BYTES if path.parent.name == "snapshots" else len(data)
        data[place] ^= 1 << chance.randrange(8)
    elif kind == "zeros":
        data[place : place + 512] = bytes(len(data[place : place + 512]))
    else:
        del data[place:]
    path.write_bytes(data)
    return kind


@pytest.mark.long
def test_nothing_damaged_is_served(tmp_path: Path) -> None:
    edits = Edits.open(local_store(tmp_path / "whole"), "duck")
    for number in range(4):
        noise = np.random.default_rng(number).random((90, 110)) < 0.5
        changes = VALUES | {"mask": noise, "pixel_size": 0.25 + number, "note": f"note {number}"}
        edits.save("back" if number == 1 else "front", Changes.model_validate(changes), "Ann", number)
    original, chance, outcomes = served(local_store(tmp_path / "whole")), random.Random(0), Counter[str]()
    assert not any(isinstance(value, GlintError) for value in original)
    for trial in range(TRIALS):
        copy = tmp_path / f"{trial}"
        shutil.copytree(tmp_path / "whole", copy)
        files = sorted(path for path in (copy / "objects/duck/repo").rglob("*") if path.is_file())
        path = chance.choice(files)
        kind = damage(path, chance)
        place = f"{kind} of {path.parent.name}/{path.name}"
        values = served(local_store(copy))
        errors = [value for value in values if isinstance(value, GlintError)]
        if len(values) == len(original):
            for value, expected in zip(values, original, strict=True):
                assert isinstance(value, GlintError) or value == expected, f"{place} is served"
        assert all(error.remedy for error in errors), place
        outcomes[f"{path.parent.name}: {'error' if errors else 'whole'}"] += 1
        shutil.rmtree(copy)
    assert outcomes["chunks: error"] and outcomes["snapshots: error"] and outcomes["repo: error"], outcomes
