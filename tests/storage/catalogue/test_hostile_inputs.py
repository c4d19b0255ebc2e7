"""Each input of the table is refused by its sentence, at once, and shows neither secrets nor escape sequences."""

from pathlib import Path
from typing import Any

import pytest

from glint.storage.catalogue.loading import load
from glint.storage.errors import GlintError
from glint.storage.footage.source import open_footage
from glint.storage.inputs.digests import content_digest
from glint.storage.inputs.masks_and_truth import read_lights, read_markup, read_mask, read_truth
from glint.storage.locations.location import Location
from glint.tasks.engine.parameters import Parameters
from tests.storage.catalogue.hostile_inputs import ROWS, Content, Hostile

SIZE, FRAMES = (20, 30), 2
FILES = {
    "catalogue": "catalogue.yaml",
    "lights": "l.lp",
    "markup": "m.json",
    "mask": "mask.png",
    "frames": "f.mp4",
    "truth": "truth",
}


def read(key: str, content: Content, folder: Path) -> Any:
    """Make an input in a folder and read it as a run does."""
    if key == "address":
        return Location.parse(str(content))
    path = folder / FILES[key]
    if callable(content):
        content(path)
    else:
        path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8", "surrogatepass"))
    if key == "catalogue":
        return load(path, Parameters)
    if key == "truth":
        return read_truth(path, SIZE)
    content_digest(path, Location.parse(folder / "store"), key=key)
    if key == "lights":
        return read_lights(path, count=FRAMES)
    if key == "markup":
        return read_markup(path, SIZE, 50)
    if key == "mask":
        return read_mask(path, SIZE)
    with open_footage(path) as footage:
        return sum(1 for _ in footage.frames())


@pytest.mark.parametrize("row", ROWS, ids=[f"{row.key}: {row.name}" for row in ROWS])
def test_it_is_refused_by_its_sentence(row: Hostile, tmp_path: Path) -> None:
    with pytest.raises(GlintError) as caught:
        read(row.key, row.content, tmp_path)
    message = str(caught.value)
    assert row.sentence in message.replace(str(tmp_path), "DIR")
    assert caught.value.remedy and len(message) < 20_000
    assert all(line.isprintable() for line in message.split("\n"))
    assert "hunter2" not in message and "root:x" not in message


def test_the_table_is_long_and_its_rows_differ() -> None:
    assert len(ROWS) >= 150 and len({(row.key, row.name) for row in ROWS}) == len(ROWS)
