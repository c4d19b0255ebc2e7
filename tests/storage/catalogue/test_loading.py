"""Catalogues: what is wrong is told all at once, with line, nearest known key and remedy; what is right survives."""

import errno
import os
import pickle
from pathlib import Path
from typing import Annotated, Any

import pytest
from pydantic import BaseModel, ConfigDict, Field

from glint.storage.catalogue import loading
from glint.storage.catalogue.diagnostics import Diagnostic
from glint.storage.catalogue.loading import Catalogue, CatalogueError, load, parameters_for, write
from glint.storage.catalogue.models import RESERVED_IDS, Capture, Object
from glint.storage.errors import InputError
from tests.storage.catalogue.complete import COMPLETE

HEAD = "schema: 1\nname: test\nobjects:\n"
ONE = "  - id: glass\n    captures:\n      - id: front\n        frames: front.mp4\n"


class _Lights(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    seed: Annotated[float, Field(ge=0, le=1)] = 0.5


class _Depth(BaseModel):
    model_config = ConfigDict(extra="forbid")
    rounds: int = 3


class _Parameters(BaseModel):
    """Two stages, independent of those that the program has."""

    model_config = ConfigDict(extra="forbid")
    lights: _Lights = _Lights()
    depth: _Depth = _Depth()


def _read(folder: Path, text: str | bytes, model: type[BaseModel] | None = None) -> Catalogue:
    path = folder / "catalogue.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return load(path, model)


def _diagnostics(folder: Path, text: str | bytes, model: type[BaseModel] | None = None) -> list[Diagnostic]:
    with pytest.raises(CatalogueError) as caught:
        _read(folder, text, model)
    assert caught.value.diagnostics
    assert all(diagnostic.file == str(folder / "catalogue.yaml") for diagnostic in caught.value.diagnostics)
    assert all(diagnostic.remedy for diagnostic in caught.value.diagnostics)
    return list(caught.value.diagnostics)


def _only(folder: Path, text: str | bytes, model: type[BaseModel] | None = None) -> Diagnostic:
    (diagnostic,) = _diagnostics(folder, text, model)
    return diagnostic


def _keys_left_out(model: BaseModel) -> set[str]:
    """Return the keys, CLASS.key, that nothing in a catalogue gives."""
    given, known = set[str](), set[str]()

    def visit(value: Any) -> None:
        if isinstance(value, BaseModel):
            kind = type(value)
            known.update(f"{kind.__name__}.{name}" for name in kind.model_fields)
            given.update(f"{kind.__name__}.{name}" for name in value.model_fields_set)
            for name in kind.model_fields:
                visit(getattr(value, name))
        elif isinstance(value, tuple):
            for entry in value:
                visit(entry)

    visit(model)
    return known - given


def test_a_changed_copy_is_asked_for_its_own_objects_and_captures() -> None:
    glass = Object(id="glass", captures=(Capture(id="front", frames="/inbox/a.mp4"),))
    whole = Catalogue.model_validate({"schema": 1, "name": "x", "objects": (glass,)})
    assert (whole.n_captures, whole.find("vase"), glass.capture("front").frames) == (1, None, "/inbox/a.mp4")
    captures = tuple(Capture(id=name, frames="/allowed/a.mp4") for name in ("front", "back"))
    other = glass.model_copy(update={"id": "vase", "captures": captures})
    assert [other.capture(name).frames for name in ("front", "back")] == ["/allowed/a.mp4"] * 2
    changed = whole.model_copy(update={"objects": (other,)})
    assert (changed.n_captures, changed.object("vase"), changed.find("glass")) == (2, other, None)
    assert (whole.object("glass"), glass.capture("front").frames) == (glass, "/inbox/a.mp4")


def test_everything_a_catalogue_can_say(tmp_path: Path) -> None:
    catalogue = _read(tmp_path, COMPLETE, _Parameters)
    assert _keys_left_out(catalogue) == set()
    front, back = catalogue.object("wine-glass").captures
    assert front.frames == str(tmp_path / "front.mp4")
    assert front.mask == str(tmp_path.parent / "masks" / "front.png")
    assert front.markup == "s3://bucket/markup.json"
    assert front.spheres[0].x == 344.0
    assert front.spheres[0].diameter_mm == 25.0
    assert front.region is not None
    assert (front.region.rows, front.region.columns) == (slice(16, 237), slice(16, 267))
    assert front.camera is not None
    assert front.camera.matrix[0] == (900, 0, 320)
    assert front.pose is not None
    assert front.pose.turntable == 30
    assert back.frames == "/absolute/img_*.png"
    assert back.pose is not None
    assert back.pose.camera_to_world is not None
    assert back.pose.camera_to_world[2] == (0, 0, 1, 5)
    assert catalogue.object("wine-glass").truth_model == str(tmp_path / "truth" / "model.ply")
    with pytest.raises(KeyError):
        catalogue.object("bowl")


def test_all_errors_at_once_in_the_order_of_their_lines(tmp_path: Path) -> None:
    text = """schema: 2
name: test
colour: red
objects:
  - id: Glass
    captures:
      - id: front
        frame: front.mp4
        region: {x: -1, y: 0, width: 2.5, height: "9"}
      - id: front
        frames: 7
        spheres: [{x: 1, y: .nan, radius: 0}]
        lights: a.lp
"""
    diagnostics = _diagnostics(tmp_path, text)
    lines = [diagnostic.line for diagnostic in diagnostics]
    assert lines == sorted(lines)
    places = {(diagnostic.line, diagnostic.message.split(" ")[0]) for diagnostic in diagnostics}
    assert places >= {
        (1, "schema"),
        (3, "unknown"),
        (5, "objects[0].id"),
        (7, "objects[0].captures[0].frames"),
        (8, "unknown"),
        (9, "objects[0].captures[0].region.x"),
        (9, "objects[0].captures[0].region.width"),
        (9, "objects[0].captures[0].region.height"),
        (10, "capture"),
        (11, "objects[0].captures[1].frames"),
        (12, "objects[0].captures[1].spheres[0].y"),
        (12, "objects[0].captures[1].spheres[0].radius"),
        (13, "a"),
    }
    assert len(places) == len(diagnostics) == 13


@pytest.mark.parametrize(
    ("line", "near"),
    [
        ("        sphere: []\n", "spheres"),
        ("        pixelsize: 1.0\n", "pixel_size"),
        ("        region: {x: 0, y: 0, widht: 5, height: 5, width: 5}\n", "width"),
        ("        pose: {turn_table: 30.0, turntable: 3.0}\n", "turntable"),
        ("        spheres: [{x: 1.0, y: 1.0, radius: 2.0, diameter: 3.0}]\n", "diameter_mm"),
    ],
)
def test_unknown_keys_name_the_nearest_known_one(tmp_path: Path, line: str, near: str) -> None:
    diagnostic = _only(tmp_path, HEAD + ONE + line)
    assert diagnostic.line == 8
    assert diagnostic.message.startswith("unknown key")
    assert diagnostic.remedy == f"did you mean {near!r}?"


def test_unknown_keys_without_a_neighbour_list_the_known_ones(tmp_path: Path) -> None:
    diagnostic = _only(tmp_path, "zzzzqq: 1\n" + HEAD + ONE)
    assert diagnostic.line == 1
    assert diagnostic.remedy == "known keys are schema, name, objects, parameters"


@pytest.mark.parametrize(
    "value",
    ["12", "true", "null", "[a.mp4]", "{path: a.mp4}", '""', '"a\\0b"'],
)
def test_frames_of_a_wrong_type(tmp_path: Path, value: str) -> None:
    diagnostic = _only(tmp_path, HEAD + ONE.replace("front.mp4", value))
    assert diagnostic.line == 7
    assert "objects[0].captures[0].frames" in diagnostic.message


@pytest.mark.parametrize(
    "line",
    [
        'pixel_size: "0.2"',
        "pixel_size: 0",
        "pixel_size: .nan",
        "pixel_size: .inf",
        "pixel_size: 1e999",
        "pixel_size: true",
        "region: 5",
        "region: {x: 0, y: 0, width: 0, height: 1}",
        "region: {x: 1.0, y: 0, width: 3, height: 1}",
        "spheres: {x: 1.0, y: 1.0, radius: 1.0}",
        "camera: {matrix: [[1, 0, 0], [0, 1, 0]]}",
        "camera: {matrix: [[1, 0, 0], [0, -1, 0], [0, 0, 1]]}",
        "camera: {matrix: [[1, 0, 0], [0, 1, 0], [0, 0, 2]]}",
        "camera: {matrix: [[1, 0, .nan], [0, 1, 0], [0, 0, 1]]}",
        "pose: {}",
        "pose: {turntable: 1.0, camera_to_world: [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}",
        "parameters: 3",
    ],
)
def test_wrong_values_name_their_line(tmp_path: Path, line: str) -> None:
    assert {diagnostic.line for diagnostic in _diagnostics(tmp_path, HEAD + ONE + f"        {line}\n")} == {8}


@pytest.mark.parametrize(
    "name", ["../x", "..", ".hidden", "a/b", "/etc", "A", "é", '"a\\n"', '""', "a" * 65, "'a b'", "a\\b", '"a\\0"']
)
@pytest.mark.parametrize("place", ["id: glass", "id: front"])
def test_ids_cannot_leave_their_folder(tmp_path: Path, name: str, place: str) -> None:
    diagnostic = _only(tmp_path, HEAD + ONE.replace(place, f"id: {name}"))
    assert diagnostic.line == (4 if place == "id: glass" else 6)
    assert "is not a valid id" in diagnostic.message


def test_duplicate_ids_name_both_lines(tmp_path: Path) -> None:
    diagnostic = _only(tmp_path, HEAD + ONE + ONE)
    assert (diagnostic.line, diagnostic.message) == (8, "object id 'glass' is taken by line 4")
    capture = "      - id: front\n        frames: other.mp4\n"
    diagnostic = _only(tmp_path, HEAD + ONE + capture)
    assert (diagnostic.line, diagnostic.message) == (8, "capture id 'front' is taken by line 6")


@pytest.mark.parametrize(("reserved", "owner"), RESERVED_IDS.items())
def test_no_capture_has_a_reserved_id(tmp_path: Path, reserved: str, owner: str) -> None:
    diagnostic = _only(tmp_path, HEAD + ONE.replace("id: front", f"id: {reserved}"))
    assert (diagnostic.line, diagnostic.message) == (6, f"the id '{reserved}' is that of {owner}")


def test_the_same_capture_id_in_two_objects_is_fine(tmp_path: Path) -> None:
    assert len(_read(tmp_path, HEAD + ONE + ONE.replace("glass", "bowl")).objects) == 2


def test_spheres_and_lights_exclude_each_other(tmp_path: Path) -> None:
    text = HEAD + ONE + "        lights: a.lp\n        spheres: [{x: 1.0, y: 1.0, radius: 2.0}]\n"
    diagnostic = _only(tmp_path, text)
    assert (diagnostic.line, diagnostic.remedy) == (8, "remove one of the two")


def test_the_same_sphere_listed_twice_is_told(tmp_path: Path) -> None:
    spheres = (
        "        spheres: [{x: 182.4, y: 79.4, radius: 30}, {x: 90, y: 70, radius: 9}, {x: 184, y: 79, radius: 24}]\n"
    )
    diagnostic = _only(tmp_path, HEAD + ONE + spheres)
    assert diagnostic.message == "objects[0].captures[0].spheres: spheres 1 and 3 are the same circle (184.0, 79.0)"
    assert (diagnostic.line, diagnostic.remedy) == (8, "remove one")


def test_more_spheres_than_anyone_places_are_refused_before_they_are_compared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("glint.storage.catalogue.models.math.hypot", None)
    spheres = ", ".join(["{x: 182.4, y: 79.4, radius: 30}"] * 101)
    assert "at most 100 items" in _only(tmp_path, f"{HEAD}{ONE}        spheres: [{spheres}]\n").message


@pytest.mark.parametrize("text", ["", "\n# nothing\n", "[]", "- 1", "hello", "3"])
def test_no_catalogue(tmp_path: Path, text: str) -> None:
    assert "not a catalogue" in _only(tmp_path, text).message


@pytest.mark.parametrize("objects", ["", "  []\n", "  {}\n", "  - 3\n", "  - id: a\n", "  - {id: a, captures: []}\n"])
def test_no_objects(tmp_path: Path, objects: str) -> None:
    assert _diagnostics(tmp_path, HEAD + objects)


@pytest.mark.parametrize("schema", ["2", "0", '"1"', "1.0", "true", "null"])
def test_wrong_schema(tmp_path: Path, schema: str) -> None:
    diagnostic = _only(tmp_path, HEAD.replace("1", schema) + ONE)
    assert diagnostic.line == 1
    assert "schema" in diagnostic.message


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("schema: 1\nname: [a\n", 3),
        ("schema: 1\n  name: x\n", 2),
        ("schema: 1\nschema: 1\nname: x\nobjects: []\n", 2),
        ("schema: 1\n\tname: x\n", 2),
        ("schema: 1\nname: !!python/object:os.system x\nobjects: 1\n", 2),
        ("schema: 1\n---\nname: x\n", 2),
        ("schema: 1\n? [a, b]\n: 3\n", 2),
        ("schema: 1\nname: a\0b\n", 1),
    ],
)
def test_what_is_no_plain_yaml_names_its_line(tmp_path: Path, text: str, line: int) -> None:
    assert line in {diagnostic.line for diagnostic in _diagnostics(tmp_path, text)}


@pytest.mark.parametrize("text", ["objects:\n\t- id: a\n", "objects:\n  - id: a\n\t  captures: []\n"])
def test_a_tab_is_named(tmp_path: Path, text: str) -> None:
    diagnostic = _only(tmp_path, "schema: 1\nname: test\n" + text)
    assert "a tab indents the line" in diagnostic.message and diagnostic.remedy == "indent with spaces"


@pytest.mark.parametrize("text", [HEAD + "  []\n", HEAD + "  - id: a\n    captures: []\n"])
def test_an_empty_list_is_named(tmp_path: Path, text: str) -> None:
    diagnostic = _only(tmp_path, text)
    assert diagnostic.message.endswith(" is empty") and diagnostic.remedy == "list at least one"


def test_a_bomb_of_aliases_is_refused(tmp_path: Path) -> None:
    text = "schema: 1\na: &a [x, x, x, x, x, x, x, x, x]\n"
    for before, after in zip("abcdefghijklmnop", "bcdefghijklmnopq", strict=True):
        text += f"{after}: &{after} [{', '.join([f'*{before}'] * 9)}]\n"
    diagnostic = _only(tmp_path, text)
    assert diagnostic.line == 3
    assert "aliases" in diagnostic.message


def test_a_bomb_of_levels_is_refused(tmp_path: Path) -> None:
    assert "deep" in _only(tmp_path, "schema: " + "[" * 20_000).message


def test_text_that_is_not_utf_8_names_its_line(tmp_path: Path) -> None:
    diagnostic = _only(tmp_path, b"schema: 1\nname: caf\xe9\n")
    assert (diagnostic.line, diagnostic.remedy) == (2, "save the file as UTF-8")
    assert _diagnostics(tmp_path, (HEAD + ONE).encode("utf-16"))


def test_a_byte_order_mark_and_line_ends_of_windows_do_not_matter(tmp_path: Path) -> None:
    catalogue = _read(tmp_path, b"\xef\xbb\xbf" + (HEAD + ONE).replace("\n", "\r\n").encode())
    assert catalogue.object("glass").capture("front").frames == str(tmp_path / "front.mp4")


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.yaml cannot be read"):
        load(tmp_path / "none.yaml")
    with pytest.raises(InputError, match="is not a file"):
        load(tmp_path)


def test_captures_are_counted_by_their_key_not_by_their_paths(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loading, "MAX_CAPTURES", 1)
    text = "schema: 1\nname: x\nobjects: [{id: a, captures: [%s]}]\n"
    entry = '{id: %s, "frames": frames/frames_*.png}'
    assert len(_read(tmp_path, text % entry % "f").objects) == 1
    assert "about 2 captures" in _only(tmp_path, text % f"{entry % 'f'}, {entry % 'g'}").message


def test_a_file_too_large_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "large.yaml"
    with path.open("wb") as file:
        file.truncate(64_000_001)
    with pytest.raises(InputError, match="64,000,001 bytes"):
        load(path)


def test_parameters_are_checked_on_all_levels(tmp_path: Path) -> None:
    text = """schema: 1
name: test
parameters: {lihgts: {seed: 0.5}}
objects:
  - id: glass
    parameters: {lights: {sed: 0.5}}
    captures:
      - id: front
        frames: front.mp4
        parameters:
          lights: {seed: 7}
          depth:
            rounds: few
"""
    diagnostics = _diagnostics(tmp_path, text, _Parameters)
    assert [(diagnostic.line, diagnostic.remedy) for diagnostic in diagnostics[:2]] == [
        (3, "did you mean 'lights'?"),
        (6, "did you mean 'seed'?"),
    ]
    assert [diagnostic.line for diagnostic in diagnostics] == [3, 6, 11, 13]
    assert _read(tmp_path, text).parameters == {"lihgts": {"seed": 0.5}}


def test_parameters_of_the_inner_level_win(tmp_path: Path) -> None:
    text = """schema: 1
name: test
parameters: {lights: {seed: 0.1}, depth: {rounds: 1}}
objects:
  - id: glass
    parameters: {depth: {rounds: 2}}
    captures:
      - {id: front, frames: a.mp4, parameters: {lights: {seed: 0.3}}}
      - {id: back, frames: b.mp4}
"""
    catalogue = _read(tmp_path, text, _Parameters)
    assert parameters_for(catalogue, "glass", "front") == {"lights": {"seed": 0.3}, "depth": {"rounds": 2}}
    assert parameters_for(catalogue, "glass", "back") == {"lights": {"seed": 0.1}, "depth": {"rounds": 2}}
    assert catalogue.parameters == {"lights": {"seed": 0.1}, "depth": {"rounds": 1}}


def test_written_and_read_again_it_is_the_same(tmp_path: Path) -> None:
    text = HEAD + ONE + (
        "        mask: az://container/mask.png\n"
        "        truth: /elsewhere/truth\n"
        "        region: {x: 1, y: 2, width: 3, height: 4}\n"
        "        spheres: [{x: 0.1, y: 1e-7, radius: 1e5}]\n"
        "        camera: {matrix: [[900.5, 0, 320], [0, 900, 240], [0, 0, 1]]}\n"
        '        parameters: {lights: {note: "yes", version: "1.0", seed: 0.25, off: null}}\n'
    )  # fmt: skip
    catalogue = _read(tmp_path, text)
    write(catalogue, tmp_path / "again.yaml")
    assert load(tmp_path / "again.yaml") == catalogue
    written = (tmp_path / "again.yaml").read_text()
    assert "frames: front.mp4" in written
    assert "truth: /elsewhere/truth" in written
    assert sorted(path.name for path in tmp_path.iterdir()) == ["again.yaml", "catalogue.yaml"]


@pytest.mark.parametrize(
    "name", ["true", "1", "null", "1.0", "é ü 世界", "a: b", "# x", "a\nb", "  x ", "0x1F", ".5e3"]
)
def test_names_that_look_like_something_else_survive(tmp_path: Path, name: str) -> None:
    catalogue = _read(tmp_path, HEAD + ONE).model_copy(update={"name": name})
    write(catalogue, tmp_path / "again.yaml")
    assert load(tmp_path / "again.yaml").name == name


def test_a_written_catalogue_moves_with_its_folder(tmp_path: Path) -> None:
    old, new = tmp_path / "old", tmp_path / "new"
    old.mkdir()
    write(_read(old, HEAD + ONE), old / "catalogue.yaml")
    old.rename(new)
    capture = load(new / "catalogue.yaml").object("glass").capture("front")
    assert capture.frames == str(new / "front.mp4")


def test_a_write_that_fails_leaves_the_old_catalogue(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    catalogue = _read(tmp_path, HEAD + ONE)
    before = (tmp_path / "catalogue.yaml").read_bytes()

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write(catalogue.model_copy(update={"name": "other"}), tmp_path / "catalogue.yaml")
    assert (tmp_path / "catalogue.yaml").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["catalogue.yaml"]


def test_the_error_survives_the_journey_between_processes(tmp_path: Path) -> None:
    with pytest.raises(CatalogueError) as caught:
        _read(tmp_path, "a: 1\n")
    again = pickle.loads(pickle.dumps(caught.value))
    assert again.diagnostics == caught.value.diagnostics
    assert str(again) == str(caught.value)


def test_a_parameter_that_is_no_number_has_a_remedy_and_unknown_stages_name_their_place(tmp_path: Path) -> None:
    text = HEAD + ONE + "        parameters: {lights: {seed: high}, lihgts: {seed: 0.5}}\n"
    diagnostics = _diagnostics(tmp_path, text, _Parameters)
    assert [(diagnostic.message.split(":")[0], diagnostic.remedy) for diagnostic in diagnostics] == [
        ("parameters.lights.seed is 'high'", "write a number"),
        ("unknown key 'lihgts' in parameters", "did you mean 'lights'?"),
    ]
