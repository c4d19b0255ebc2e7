"""Nonsense in every field of a catalogue: the error names the field and a remedy, in the catalogue's words."""

import copy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from glint.storage.catalogue.loading import CatalogueError
from glint.storage.catalogue.writing import yaml_text
from glint.tasks.engine.references import load_catalogue
from tests.storage.catalogue.complete import COMPLETE

CONTENT: dict[str, Any] = YAML(typ="safe").load(COMPLETE)
NONSENSE = ("", "x" * 5000, -1.5, 1e300, float("nan"), True, ["a"], {"q": 1})
FOREIGN = ("dictionary", "tuple", "instance of", "pattern", "fix the value")
"""Words that are no answer to somebody who writes a catalogue."""


def fields(content: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """The paths of all that a catalogue holds."""
    if path:
        yield path
    keys = content if isinstance(content, dict) else range(len(content)) if isinstance(content, list) else ()
    for key in keys:
        yield from fields(content[key], (*path, key))


@pytest.mark.parametrize("path", list(fields(CONTENT)), ids=lambda path: ".".join(map(str, path)))
def test_nonsense_is_named_with_its_field(path: tuple[str | int, ...], tmp_path: Path) -> None:
    # An entry of a matrix may be named by the matrix, which is wrong as a whole.
    names = [str(step) for step in path if isinstance(step, str)]
    for value in NONSENSE:
        content = copy.deepcopy(CONTENT)
        place: Any = content
        for step in path[:-1]:
            place = place[step]
        place[path[-1]] = value
        file = tmp_path / "catalogue.yaml"
        file.write_bytes(yaml_text(content))
        try:
            load_catalogue(file)
        except CatalogueError as error:
            for line in error.message.splitlines():
                place_of_error, fault = line.removeprefix(f"{file}:").split(": ", 1)
                assert place_of_error.isdecimal(), line
                assert any(name in fault for name in names[-2:]), line
                assert not any(word in fault for word in FOREIGN), line


def _pose(x: float, y: float, z: float) -> list[list[float]]:
    """A pose matrix with these numbers on the diagonal of its first three columns."""
    return [[x, 0, 0, 0], [0, y, 0, 0], [0, 0, z, 0], [0, 0, 0, 1]]


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ("pixel_size: 0,33", "pixel_size is '0,33': input should be a valid number: write a number such as 2.5, with"),
        ("region: [1, 2, 3, 4]", "write keys and values: x, y, width, height"),
        ("camera: {fx: 2900}", "unknown key 'fx' in objects[0].captures[0].camera: the only key is matrix"),
        (
            "parameters: {mask: {size: 3}}",
            "'size' in parameters.mask: no keys are known here: remove it",
        ),
        ("frames: [a.png, b.png]", "write one path; a folder, or shots/*.png, names several files"),
        ('mask: "C:\\Users\\me\\mask.png"', "write the text between single quotes, or a path with /"),
        ("camera: {matrix: [500, 0, 120, 0, 500, 72, 0, 0, 1]}", "at most 3 items are allowed, not 9: write three"),
        ("camera: {matrix: [[500, 0, 120], [0, 500, 72]]}", "camera.matrix[2] is missing: write three rows of three"),
        ("camera: {distortion_coefficients: [0.1]}", "lens distortion is not modelled: undistort the frames"),
        (f"pose: {{camera_to_world: {_pose(2, 2, 2)}}}", "their lengths are 2, 2, 2: give a rotation there"),
        (f"pose: {{camera_to_world: {_pose(1, -1, 1)}}}", "are mirrored: negate one of these columns"),
        (
            "pose: {camera_to_world: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [5, 6, 7, 1]]}",
            "the last row of camera_to_world must be 0, 0, 0, 1: transpose the matrix",
        ),
        (
            "pose: {camera_to_world: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]}",
            "camera_to_world[3] is missing: write four rows of four numbers, the last one [0, 0, 0, 1]",
        ),
    ],
)
def test_a_remedy_shows_what_to_write(entry: str, says: str, tmp_path: Path) -> None:
    file = tmp_path / "catalogue.yaml"
    frames = "" if entry.startswith("frames") else "\n    frames: a.mp4"
    file.write_text(f"schema: 1\nname: a\nobjects:\n- id: a\n  captures:\n  - id: a{frames}\n    {entry}\n")
    with pytest.raises(CatalogueError) as caught:
        load_catalogue(file)
    assert says in caught.value.message


def test_a_value_of_two_kinds_has_one_fault(tmp_path: Path) -> None:
    file = tmp_path / "catalogue.yaml"
    capture = "captures: [{id: a, frames: a.mp4}]"
    parameters = "parameters: {model: {base_plane: foud}}"
    file.write_text(f"schema: 1\nname: a\nobjects:\n- id: a\n  {capture}\n  {parameters}\n")
    with pytest.raises(CatalogueError) as caught:
        load_catalogue(file)
    assert caught.value.message == (
        f"{file}:6: parameters.model.base_plane is 'foud': this is neither `found` nor a number from -1e6 to 1e6:"
        " write `found`, or the plane's height y in the model's unit"
    )
