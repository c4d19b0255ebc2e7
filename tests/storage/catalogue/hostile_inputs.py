"""Hostile and broken inputs, each with the sentence by which it is refused, in one table.

A content is bytes, text, or a function that makes the input at a path. Lines of catalogues count from 1.
"""

import gzip
import io
import os
import struct
import wave
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

Content = bytes | str | Callable[[Path], object]

HEAD = "schema: 1\nname: x\nobjects:\n- id: a\n  captures:\n"
"""Five lines, to which a capture's follow."""
ONE = HEAD + "  - {id: front, frames: f.mp4"
"""A catalogue of one capture, whose line 6 goes on."""
MARK = '{"frame": 0, "x": 1.0, "y": 1.0, "kind": "true"'
SECRET = "root:x:0:0:root:/root:/bin/bash\nsecret: hunter2\n"
"""Content of a file that nobody may see."""


@dataclass(frozen=True)
class Hostile:
    """An input: the key of the catalogue that names it, what it is, its content, and how it is refused."""

    key: str
    name: str
    content: Content
    sentence: str


def png(width: int = 30, height: int = 20, value: int = 255) -> bytes:
    """A grey PNG of one value."""
    return cv2.imencode(".png", np.full((height, width), value, np.uint8))[1].tobytes()


def png_of_size(width: int, height: int, data_bytes: int = 100_000) -> bytes:
    """A small PNG whose head states so many pixels, with the beginning of the data that would fill them."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    data = chunk(b"IDAT", zlib.compress(bytes(data_bytes), 9))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + data + chunk(b"IEND", b"")


def image(kind: str, **options: object) -> bytes:
    """A picture of random colours in a format of Pillow."""
    stream = io.BytesIO()
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (20, 30, 3), np.uint8)).save(stream, kind, **options)
    return stream.getvalue()


def float_tiff() -> bytes:
    """A TIFF of floats."""
    stream = io.BytesIO()
    Image.fromarray(np.ones((20, 30), np.float32)).save(stream, "TIFF")
    return stream.getvalue()


def array(values: np.ndarray, **options: bool) -> bytes:
    """A .npy file."""
    stream = io.BytesIO()
    np.save(stream, values, **options)
    return stream.getvalue()


def array_head(text: str) -> bytes:
    """A .npy file whose head is this text."""
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode()


def archive() -> bytes:
    """A ZIP file."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as file:
        file.writestr("a", "b")
    return stream.getvalue()


def mp4(*, cut: bool) -> bytes:
    """The boxes of an MP4 without its index; `cut`: the first box is truncated."""
    head = struct.pack(">I", 24) + b"ftypisom" + struct.pack(">I", 512) + b"isommp41"
    return head[:10] if cut else head + struct.pack(">I", 1 << 30) + b"mdat" + bytes(2000)


def write_sound(path: Path) -> None:
    """A second of silence."""
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(8000)
        file.writeframes(bytes(16000))


def playlist(path: Path) -> None:
    """A playlist that names another file."""
    path.write_text("#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nfile:///etc/passwd\n#EXT-X-ENDLIST\n")


def sparse(size: int) -> Callable[[Path], object]:
    """A file of so many bytes that takes no room."""

    def make(path: Path) -> None:
        path.write_bytes(b"x")
        os.truncate(path, size)

    return make


def link(target: str) -> Callable[[Path], object]:
    """A link."""
    return lambda path: path.symlink_to(target)


def folder_with_link(name: str, target: str) -> Callable[[Path], object]:
    """A folder of one link."""

    def make(path: Path) -> None:
        path.mkdir()
        (path / name).symlink_to(target)

    return make


def folder(*files: tuple[str, bytes]) -> Callable[[Path], object]:
    """A folder of files."""

    def make(path: Path) -> None:
        path.mkdir()
        for name, data in files:
            (path / name).write_bytes(data)

    return make


def socket(path: Path) -> None:
    """A socket."""
    os.mknod(path, 0o140600)


ROWS = (
    Hostile(
        "catalogue",
        "empty",
        b"",
        "DIR/catalogue.yaml:1: this is not a catalogue: begin with `schema: 1`, `name` and `objects`",
    ),
    Hostile(
        "catalogue",
        "blank lines",
        "\n\n",
        "DIR/catalogue.yaml:1: this is not a catalogue: begin with `schema: 1`, `name` and `objects`",
    ),
    Hostile(
        "catalogue", "binary", bytes(range(256)), "DIR/catalogue.yaml:2: this is not UTF-8 text: save the file as UTF-8"
    ),
    Hostile(
        "catalogue",
        "UTF-16",
        "schema: 1".encode("utf-16"),
        "DIR/catalogue.yaml:1: this is not UTF-8 text: save the file as UTF-8",
    ),
    Hostile(
        "catalogue",
        "NUL inside",
        "schema: 1\nname: a\0b\n",
        "DIR/catalogue.yaml:1: this is not a catalogue (unacceptable character #x0000",
    ),
    Hostile(
        "catalogue",
        "latin-1",
        "schema: 1\nname: Gläser\n".encode("latin-1"),
        "DIR/catalogue.yaml:2: this is not UTF-8 text: save the file as UTF-8",
    ),
    Hostile(
        "catalogue",
        "password file",
        "root:x:0:0:root:/root:/bin/bash\n",
        "DIR/catalogue.yaml:1: this is not a catalogue: begin with `schema: 1`, `name` and `objects`",
    ),
    Hostile(
        "catalogue",
        "secrets in YAML",
        "password: hunter2\ntoken: abc\n",
        "DIR/catalogue.yaml:1: this is not a catalogue: begin with `schema: 1`, `name` and `objects`",
    ),
    Hostile(
        "catalogue",
        "JSON list",
        "[1, 2]",
        "DIR/catalogue.yaml:1: this is not a catalogue: begin with `schema: 1`, `name` and `objects`",
    ),
    Hostile(
        "catalogue",
        "number",
        "42",
        "DIR/catalogue.yaml:1: this is not a catalogue: begin with `schema: 1`, `name` and `objects`",
    ),
    Hostile(
        "catalogue",
        "HTML",
        "<!DOCTYPE html><html><body>Not found</body></html>",
        "DIR/catalogue.yaml:1: this is not a catalogue: begin with `schema: 1`, `name` and `objects`",
    ),
    Hostile(
        "catalogue",
        "Git LFS pointer",
        "version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 3\n",
        "DIR/catalogue.yaml:1: this is not a catalogue: begin with `schema: 1`, `name` and `objects`",
    ),
    Hostile("catalogue", "ZIP", archive(), "DIR/catalogue.yaml:1: this is not UTF-8 text: save the file as UTF-8"),
    Hostile(
        "catalogue",
        "gzip",
        gzip.compress(b"schema: 1"),
        "DIR/catalogue.yaml:1: this is not UTF-8 text: save the file as UTF-8",
    ),
    Hostile("catalogue", "PNG", png(), "DIR/catalogue.yaml:1: this is not UTF-8 text: save the file as UTF-8"),
    Hostile(
        "catalogue",
        "private key",
        "-----BEGIN PRIVATE KEY-----\nMIIEvQ==\n-----END PRIVATE KEY-----\n",
        "DIR/catalogue.yaml:1: this is not a catalogue: begin with `schema: 1`, `name` and `objects`",
    ),
    Hostile("catalogue", "folder", folder(), "the catalogue DIR/catalogue.yaml is not a file: name the YAML file"),
    Hostile("catalogue", "pipe", os.mkfifo, "the catalogue DIR/catalogue.yaml is not a file: name the YAML file"),
    Hostile("catalogue", "socket", socket, "the catalogue DIR/catalogue.yaml is not a file: name the YAML file"),
    Hostile(
        "catalogue", "device", link("/dev/zero"), "the catalogue DIR/catalogue.yaml is not a file: name the YAML file"
    ),
    Hostile(
        "catalogue",
        "environment of a process",
        link("/proc/self/environ"),
        "DIR/catalogue.yaml belongs to the system and is not an input: give the path of a file on a disk",
    ),
    Hostile(
        "catalogue",
        "kernel's file",
        link("/sys/kernel/uevent_seqnum"),
        "DIR/catalogue.yaml belongs to the system and is not an input: give the path of a file on a disk",
    ),
    Hostile(
        "catalogue",
        "missing",
        lambda path: None,
        "the catalogue DIR/catalogue.yaml cannot be read (No such file or directory): check the path",
    ),
    Hostile(
        "catalogue",
        "link to itself",
        lambda path: path.symlink_to(path),
        "the catalogue DIR/catalogue.yaml cannot be read (Too many levels of symbolic links): check the path",
    ),
    Hostile(
        "catalogue",
        "100 GB",
        sparse(100 << 30),
        "DIR/catalogue.yaml has 107,374,182,400 bytes: a catalogue has at most 64,000,000; split it",
    ),
    Hostile(
        "catalogue",
        "65 MB of spaces",
        sparse(65_000_000),
        "DIR/catalogue.yaml has 65,000,000 bytes: a catalogue has at most 64,000,000; split it",
    ),
    Hostile(
        "catalogue",
        "tabs",
        "schema: 1\n\tname: x\n",
        "DIR/catalogue.yaml:2: this is not a catalogue (a tab indents the line)",
    ),
    Hostile(
        "catalogue",
        "merge conflict",
        "schema: 1\n<<<<<<< HEAD\nname: x\n=======\n",
        "DIR/catalogue.yaml:3: this is not YAML: could not find expected ':'",
    ),
    Hostile(
        "catalogue",
        "open quote",
        'schema: 1\nname: "x\n',
        "DIR/catalogue.yaml:3: this is not YAML: found unexpected end of stream",
    ),
    Hostile(
        "catalogue",
        "open bracket",
        HEAD + "  - {id: front, frames: f.mp4\n",
        "DIR/catalogue.yaml:7: this is not YAML: did not find expected ',' or '}'",
    ),
    Hostile(
        "catalogue",
        "anchors",
        "schema: 1\nname: &n x\nobjects: *n\n",
        "DIR/catalogue.yaml:3: aliases (*name) are not supported: write the value itself",
    ),
    Hostile(
        "catalogue",
        "billion laughs",
        "schema: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n",
        "DIR/catalogue.yaml:2: aliases (*name) are not supported: write the value itself",
    ),
    Hostile(
        "catalogue",
        "code to run",
        "schema: !!python/object/apply:os.system [reboot]\n",
        "DIR/catalogue.yaml:1: name is missing: add it",
    ),
    Hostile(
        "catalogue",
        "two documents",
        ONE + "}\n---\nschema: 1\n",
        "DIR/catalogue.yaml:7: a second document begins: keep one document per file",
    ),
    Hostile(
        "catalogue",
        "nested 100,000 deep",
        "schema: " + "[" * 100_000,
        "DIR/catalogue.yaml:1: this is nested more than 32 levels deep: a catalogue needs fewer",
    ),
    Hostile(
        "catalogue",
        "key twice",
        "schema: 1\nschema: 1\nname: x\nobjects: []\n",
        "DIR/catalogue.yaml:2: 'schema' is given twice: keep one of them",
    ),
    Hostile(
        "catalogue",
        "list as key",
        "schema: 1\n? [a]\n: b\n",
        "DIR/catalogue.yaml:2: a key must be a plain word: fix the line",
    ),
    Hostile(
        "catalogue",
        "a million objects",
        "schema: 1\nname: x\nobjects:\n" + "- {id: a, captures: [{id: f, frames: v}]}\n" * 1_000_000,
        "DIR/catalogue.yaml:1: this lists about 1,000,000 captures: at most 100,000 are read",
    ),
    Hostile(
        "catalogue",
        "ten million values",
        "schema: 1\nname: x\nobjects: [" + "1," * 10_000_000 + "]",
        "DIR/catalogue.yaml:1: this has more than 10,000,002 values: at most 2,000,000 are read",
    ),
    Hostile(
        "catalogue",
        "other schema",
        "schema: 2\nname: x\nobjects: []\n",
        "DIR/catalogue.yaml:1: schema 2 is not known: write `schema: 1`",
    ),
    Hostile(
        "catalogue",
        "schema as text",
        'schema: "1"\nname: x\nobjects: []\n',
        "DIR/catalogue.yaml:1: schema is '1': input should be a valid integer",
    ),
    Hostile(
        "catalogue",
        "no objects",
        "schema: 1\nname: x\nobjects: []\n",
        "DIR/catalogue.yaml:3: objects is empty: list at least one",
    ),
    Hostile(
        "catalogue",
        "objects as text",
        "schema: 1\nname: x\nobjects: all\n",
        "DIR/catalogue.yaml:3: objects is 'all': this is no list: write a list: [..]",
    ),
    Hostile("catalogue", "no name", "schema: 1\nobjects: []\n", "DIR/catalogue.yaml:1: name is missing: add it"),
    Hostile(
        "catalogue",
        "name of 300 letters",
        f"schema: 1\nname: {'x' * 300}\nobjects: []\n",
        "DIR/catalogue.yaml:2: name is 'xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx...",
    ),
    Hostile(
        "catalogue",
        "id that leaves the store",
        "schema: 1\nname: x\nobjects:\n- {id: ../../etc, captures: [{id: f, frames: v}]}\n",
        "DIR/catalogue.yaml:4: objects[0].id '../../etc' is not a valid id",
    ),
    Hostile(
        "catalogue",
        "id with an escape sequence",
        'schema: 1\nname: x\nobjects:\n- {id: "a\\e[2J", captures: [{id: f, frames: v}]}\n',
        "DIR/catalogue.yaml:4: objects[0].id 'a\\x1b[2J' is not a valid id",
    ),
    Hostile(
        "catalogue",
        "id of 65 letters",
        f"schema: 1\nname: x\nobjects:\n- {{id: {'a' * 65}, captures: [{{id: f, frames: v}}]}}\n",
        "DIR/catalogue.yaml:4",
    ),
    Hostile(
        "catalogue",
        "capture called model",
        HEAD + "  - {id: model, frames: f.mp4}\n",
        "DIR/catalogue.yaml:6: the id 'model' is that of the object's merged model: choose another id",
    ),
    Hostile(
        "catalogue",
        "same capture twice",
        HEAD + "  - {id: f, frames: a}\n  - {id: f, frames: b}\n",
        "DIR/catalogue.yaml:7: capture id 'f' is taken by line 6: choose another id",
    ),
    Hostile(
        "catalogue",
        "same object twice",
        "schema: 1\nname: x\nobjects:\n- {id: a, captures: [{id: f, frames: v}]}\n- {id: a}\n",
        "DIR/catalogue.yaml:5: object id 'a' is taken by line 4: choose another id",
    ),
    Hostile(
        "catalogue",
        "object without captures",
        "schema: 1\nname: x\nobjects:\n- {id: a, captures: []}\n",
        "DIR/catalogue.yaml:4: objects[0].captures is empty",
    ),
    Hostile(
        "catalogue",
        "no frames",
        HEAD + "  - {id: front}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].frames is missing: add it",
    ),
    Hostile(
        "catalogue",
        "frames as number",
        HEAD + "  - {id: front, frames: 7}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].frames is 7: input should be a valid string",
    ),
    Hostile(
        "catalogue",
        "empty frames",
        HEAD + '  - {id: front, frames: ""}\n',
        "DIR/catalogue.yaml:6: objects[0].captures[0].frames is '': string should have at least 1 character",
    ),
    Hostile(
        "catalogue",
        "NUL in an address",
        HEAD + '  - {id: front, frames: "a\\0b"}\n',
        "no path holds a null character",
    ),
    Hostile(
        "catalogue",
        "address of 5,000 letters",
        HEAD + f"  - {{id: front, frames: {'a' * 5000}}}\n",
        "string should have at most 4096 characters",
    ),
    Hostile(
        "catalogue",
        "unknown key",
        ONE + ", light: l.lp}\n",
        "DIR/catalogue.yaml:6: unknown key 'light' in objects[0].captures[0]: did you mean 'lights'?",
    ),
    Hostile(
        "catalogue",
        "key with colours",
        ONE + ', "\\e[31mred": 1}\n',
        "DIR/catalogue.yaml:6: unknown key '\\x1b[31mred' in objects[0].captures[0]",
    ),
    Hostile(
        "catalogue",
        "key written backwards",
        ONE + ', "\\u202Egnp": 1}\n',
        "DIR/catalogue.yaml:6: unknown key '\\u202egnp' in objects[0].captures[0]",
    ),
    Hostile(
        "catalogue",
        "spheres and lights",
        ONE + ", spheres: [{x: 1, y: 1, radius: 2}], lights: l.lp}\n",
        "DIR/catalogue.yaml:6: a capture has either spheres or lights, not both: remove one of the two",
    ),
    Hostile(
        "catalogue",
        "sphere of 1e308 pixels",
        ONE + ", spheres: [{x: 1, y: 1, radius: 1e308}]}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].spheres[0].radius is 1e+308",
    ),
    Hostile(
        "catalogue",
        "sphere of radius 0",
        ONE + ", spheres: [{x: 1, y: 1, radius: 0}]}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].spheres[0].radius is 0",
    ),
    Hostile(
        "catalogue",
        "sphere of radius -5",
        ONE + ", spheres: [{x: 1, y: 1, radius: -5}]}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].spheres[0].radius is -5",
    ),
    Hostile(
        "catalogue",
        "sphere of a radius below a molecule",
        ONE + ", spheres: [{x: 1, y: 1, radius: 1e-300}]}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].spheres[0].radius is 1e-300",
    ),
    Hostile(
        "catalogue",
        "sphere without a number",
        ONE + ", spheres: [{x: .nan, y: 1, radius: 1}]}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].spheres[0].x is nan: input should be a finite number",
    ),
    Hostile(
        "catalogue",
        "sphere at infinity",
        ONE + ", spheres: [{x: .inf, y: 1, radius: 1}]}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].spheres[0].x is inf: input should be a finite number",
    ),
    Hostile(
        "catalogue",
        "sphere a light year away",
        ONE + ", spheres: [{x: 9.5e15, y: 1, radius: 1}]}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].spheres[0].x is 9500000000000000.0",
    ),
    Hostile(
        "catalogue",
        "sphere in words",
        ONE + ", spheres: [{x: left, y: 1, radius: 1}]}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].spheres[0].x is 'left': input should be a valid number",
    ),
    Hostile(
        "catalogue",
        "number of 400 digits",
        ONE + f", spheres: [{{x: {'9' * 400}, y: 1, radius: 1}}]}}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].spheres[0].x is inf: input should be a finite number",
    ),
    Hostile(
        "catalogue",
        "region of 1e18 pixels",
        ONE + ", region: {x: 0, y: 0, width: 1000000000000000000, height: 1}}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].region.width is 1e+18: input should be a valid integer",
    ),
    Hostile(
        "catalogue",
        "region left of the frame",
        ONE + ", region: {x: -1, y: 0, width: 5, height: 5}}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].region.x is -1",
    ),
    Hostile(
        "catalogue",
        "region without area",
        ONE + ", region: {x: 0, y: 0, width: 0, height: 5}}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].region.width is 0",
    ),
    Hostile(
        "catalogue",
        "region of half pixels",
        ONE + ", region: {x: 0.5, y: 0, width: 5, height: 5}}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].region.x is 0.5: input should be a valid integer",
    ),
    Hostile(
        "catalogue",
        "pixel size of a kilometre and more",
        ONE + ", pixel_size: 1e300}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].pixel_size is 1e+300",
    ),
    Hostile(
        "catalogue",
        "pixel size 0",
        ONE + ", pixel_size: 0}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].pixel_size is 0",
    ),
    Hostile(
        "catalogue",
        "pixel size yes",
        ONE + ", pixel_size: yes}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].pixel_size is 'yes': input should be a valid number",
    ),
    Hostile(
        "catalogue",
        "camera without focal length",
        ONE + ", camera: {matrix: [[0, 0, 1], [0, 0, 1], [0, 0, 1]]}}\n",
        "DIR/catalogue.yaml:6",
    ),
    Hostile(
        "catalogue",
        "camera of 1e300",
        ONE + ", camera: {matrix: [[1e300, 0, 1], [0, 1e300, 1], [0, 0, 1]]}}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].camera.matrix[0][0] is 1e+300",
    ),
    Hostile(
        "catalogue",
        "camera of four numbers",
        ONE + ", camera: {matrix: [[1, 2], [3, 4]]}}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].camera.matrix[0][2] is missing: write three rows",
    ),
    Hostile(
        "catalogue",
        "camera without numbers",
        ONE + ", camera: {matrix: [[.nan, 0, 1], [0, 1, 1], [0, 0, 1]]}}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].camera.matrix[0][0] is nan",
    ),
    Hostile(
        "catalogue",
        "turntable of 1e30 degrees",
        ONE + ", pose: {turntable: 1e30}}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].pose.turntable is 1e+30",
    ),
    Hostile(
        "catalogue",
        "pose in two ways",
        ONE + ", pose: {turntable: 1, camera_to_world: [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].pose is {'turntable'",
    ),
    Hostile(
        "catalogue",
        "empty pose",
        ONE + ", pose: {}}\n",
        "objects[0].captures[0].pose is {}: a pose is either turntable or camera_to_world: give exactly one of the two",
    ),
    Hostile(
        "catalogue",
        "pose of zeros",
        ONE + ", pose: {camera_to_world: [[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,1]]}}\n",
        "DIR/catalogue.yaml:6",
    ),
    Hostile(
        "catalogue",
        "mirrored pose",
        ONE + ", pose: {camera_to_world: [[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}}\n",
        "DIR/catalogue.yaml:6",
    ),
    Hostile(
        "catalogue",
        "scaled pose",
        ONE + ", pose: {camera_to_world: [[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]}}\n",
        "DIR/catalogue.yaml:6",
    ),
    Hostile(
        "catalogue",
        "pose of 1e300 mm",
        ONE + ", pose: {camera_to_world: [[1,0,0,1e300],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].pose.camera_to_world[0][3] is 1e+300",
    ),
    Hostile(
        "catalogue",
        "unknown stage",
        ONE + ", parameters: {lable: {method: sheets}}}\n",
        "DIR/catalogue.yaml:6: unknown key 'lable' in parameters: did you mean 'labels'?",
    ),
    Hostile(
        "catalogue",
        "parameter out of range",
        ONE + ", parameters: {thresholds: {threshold: 2}}}\n",
        "DIR/catalogue.yaml:6: parameters.thresholds.threshold is 2: input should be less than or equal to 1",
    ),
    Hostile(
        "catalogue",
        "parameter of 1e300",
        ONE + ", parameters: {labels: {tension_length: 1e300}}}\n",
        "DIR/catalogue.yaml:6: unknown key 'tension_length' in parameters.labels: did you mean 'strength'?",
    ),
    Hostile(
        "catalogue",
        "parameter without number",
        ONE + ", parameters: {thresholds: {threshold: .nan}}}\n",
        "DIR/catalogue.yaml:6: parameters.thresholds.threshold is nan: input should be a finite number",
    ),
    Hostile(
        "catalogue",
        "parameters as text",
        ONE + ", parameters: fast}\n",
        "DIR/catalogue.yaml:6: objects[0].captures[0].parameters is 'fast'",
    ),
    Hostile("lights", "empty", b"", "DIR/l.lp:1: this is not a count: write the number of lights into the first line"),
    Hostile(
        "lights",
        "password file",
        SECRET,
        "DIR/l.lp:1: this is not a count: write the number of lights into the first line",
    ),
    Hostile(
        "lights",
        "count, then secrets",
        "2\n" + SECRET,
        "DIR/l.lp is not an .lp file: write `name x y z` into each line after the first",
    ),
    Hostile("lights", "count alone", "3\n", "DIR/l.lp holds no light: give one row `name x y z` per frame"),
    Hostile(
        "lights",
        "negative count",
        "-1\nx 0 0 1\n",
        "DIR/l.lp:1: this is not a count: write the number of lights into the first line",
    ),
    Hostile(
        "lights",
        "count in other digits",
        "٣\nx 0 0 1\n",
        "DIR/l.lp:1: the first line states 3 lights, 1 follow: correct the number or add the missing rows",
    ),
    Hostile(
        "lights",
        "wrong count",
        "3\nx 0 0 1\n",
        "DIR/l.lp:1: the first line states 3 lights, 1 follow: correct the number or add the missing rows",
    ),
    Hostile(
        "lights",
        "zero direction",
        "1\nx 0 0 0\n",
        "DIR/l.lp:2: 'x 0 0 0' has no direction: write a direction with finite length, or remove the frame",
    ),
    Hostile(
        "lights",
        "direction without numbers",
        "2\na 0 0 1\nb nan 0 1\n",
        "DIR/l.lp:3: 'b nan 0 1' has no direction: write a direction with finite length, or remove the frame",
    ),
    Hostile(
        "lights",
        "infinite direction",
        "2\na 0 0 1\nb inf 0 1\n",
        "DIR/l.lp:3: 'b inf 0 1' has no direction: write a direction with finite length, or remove the frame",
    ),
    Hostile(
        "lights", "vanishing direction", "2\na 0 0 1\nb 1e-320 0 0\n", "DIR/l.lp:3: 'b 1e-320 0 0' has no direction"
    ),
    Hostile("lights", "two numbers", "2\na 0 0 1\nb 0 1\n", "DIR/l.lp:3: 'b 0 1' is not a light: write `name x y z`"),
    Hostile(
        "lights",
        "escape sequence in a name",
        "2\na 0 0 1\n\x1b[2J x y z\n",
        "DIR/l.lp:3: '\\x1b[2J x y z' is not a light: write `name x y z`",
    ),
    Hostile("lights", "too few for the frames", "1\nx 0 0 1\n", "DIR/l.lp has 1 lights for 2 frames"),
    Hostile(
        "lights",
        "binary",
        bytes(range(256)),
        "DIR/l.lp:1: this is not a count: write the number of lights into the first line",
    ),
    Hostile("lights", "PNG", png(), "DIR/l.lp:1: this is not a count: write the number of lights into the first line"),
    Hostile("lights", "folder", folder(), "DIR/l.lp is not a file: give the path of a file"),
    Hostile("lights", "pipe", os.mkfifo, "DIR/l.lp is not a file: give the path of a file"),
    Hostile(
        "lights",
        "environment of a process",
        link("/proc/self/environ"),
        "DIR/l.lp belongs to the system and is not an input: give the path of a file on a disk",
    ),
    Hostile(
        "lights",
        "100 GB",
        sparse(100 << 30),
        "DIR/l.lp has 107,374,182,400 bytes, more than 32,000,000: check that it is the right file",
    ),
    Hostile(
        "lights",
        "missing",
        lambda path: None,
        "DIR/l.lp does not exist: check the path; relative paths count from the catalogue's folder",
    ),
    Hostile(
        "markup",
        "empty",
        b"",
        "DIR/m.json:1: this is not a list of marks: write [{frame: .., x: .., y: .., kind: ..}, ..]",
    ),
    Hostile(
        "markup",
        "password file",
        SECRET,
        "DIR/m.json:2: this is not a list of marks (mapping values are not allowed in this context)",
    ),
    Hostile(
        "markup",
        "secrets in JSON",
        '[{"password": "hunter2"}]',
        "DIR/m.json:1: this is not a list of marks: write [{frame: .., x: .., y: .., kind: ..}, ..]",
    ),
    Hostile(
        "markup",
        "mapping",
        "{" + MARK[1:] + "}",
        "DIR/m.json:1: this is not a list of marks: write [{frame: .., x: .., y: .., kind: ..}, ..]",
    ),
    Hostile("markup", "cut", "[" + MARK, "DIR/m.json:2: this is not YAML: did not find expected ',' or '}'"),
    Hostile(
        "markup",
        "frame after the last",
        "[" + MARK.replace("0", "99", 1) + "}]",
        "DIR/m.json:1: mark 1 at frame 99, x 1, y 1 is after the last frame, 49: move or remove it",
    ),
    Hostile(
        "markup",
        "frame of 5,000 digits",
        "[" + MARK.replace("0", "9" * 5000, 1) + "}]",
        "DIR/m.json:1: [0].frame is inf: input should be a valid integer: write a whole number without quotes",
    ),
    Hostile(
        "markup",
        "negative frame",
        "[" + MARK.replace("0", "-1", 1) + "}]",
        "DIR/m.json:1: [0].frame is -1: input should be greater than or equal to 0",
    ),
    Hostile(
        "markup",
        "no position of a picture",
        "[" + MARK.replace("1.0", "1e300", 1) + "}]",
        "DIR/m.json:1: [0].x is 1e+300: input should be less than or equal to 1000000: check the number and its unit",
    ),
    Hostile(
        "markup",
        "outside the frame",
        "[" + MARK.replace("1.0", "1000.0", 1) + "}]",
        "DIR/m.json:1: mark 1 at frame 0, x 1000, y 1 lies outside the frame of 30 x 20 pixels",
    ),
    Hostile(
        "markup",
        "infinite position",
        "[" + MARK.replace("1.0", "1e999", 1) + "}]",
        "DIR/m.json:1: [0].x is inf: input should be a finite number: write a finite number",
    ),
    Hostile(
        "markup",
        "third kind",
        "[" + MARK.replace("true", "perhaps") + "}]",
        "DIR/m.json:1: [0].kind is 'perhaps': input should be 'true' or 'false': write one of them",
    ),
    Hostile(
        "markup",
        "unknown key",
        "[" + MARK + ', "colour": "red"}]',
        "DIR/m.json:1: unknown key 'colour' in [0]: known keys are frame, x, y, kind",
    ),
    Hostile(
        "markup",
        "nested 100,000 deep",
        "[" * 100_000,
        "DIR/m.json:1: this is not a list of marks: write [{frame: .., x: .., y: .., kind: ..}, ..]",
    ),
    Hostile(
        "markup", "not UTF-8", b'[{"frame": \xff}]', "DIR/m.json is not UTF-8 text: name a text file, saved as UTF-8"
    ),
    Hostile("markup", "device", link("/dev/urandom"), "DIR/m.json is not a file: give the path of a file"),
    Hostile(
        "markup",
        "100 GB",
        sparse(100 << 30),
        "DIR/m.json has 107,374,182,400 bytes, more than 32,000,000: check that it is the right file",
    ),
    Hostile("mask", "empty", b"", "DIR/mask.png is no image that can be read: replace the image"),
    Hostile("mask", "text", SECRET, "DIR/mask.png is no image that can be read: replace the image"),
    Hostile("mask", "cut PNG", png()[:40], "DIR/mask.png is no image that can be read: replace the image"),
    Hostile("mask", "head alone", png()[:33], "DIR/mask.png is no image that can be read: replace the image"),
    Hostile(
        "mask",
        "decompression bomb",
        png_of_size(60_000, 60_000),
        "DIR/mask.png states an impossible size: at most 170,000,000 pixels are read",
    ),
    Hostile(
        "mask",
        "two thousand million pixels wide",
        png_of_size(2_000_000_000, 1),
        "DIR/mask.png states an impossible size: at most 170,000,000 pixels are read",
    ),
    Hostile("mask", "no pixels", png_of_size(0, 0), "DIR/mask.png is no image that can be read: replace the image"),
    Hostile(
        "mask", "other size", png(31, 20), "the mask DIR/mask.png is 31 x 20: it must have the frame's 30 x 20 pixels"
    ),
    Hostile("mask", "turned", png(20, 30), "the mask DIR/mask.png is 20 x 30: it must have the frame's 30 x 20 pixels"),
    Hostile("mask", "black", png(value=0), "the mask DIR/mask.png is empty"),
    Hostile(
        "mask", "floats", float_tiff(), "DIR/mask.png is no image that can be read, or is truncated: replace the image"
    ),
    Hostile(
        "mask",
        "SVG",
        "<svg xmlns='http://www.w3.org/2000/svg'/>",
        "DIR/mask.png is no image that can be read: replace the image",
    ),
    Hostile("mask", "PDF", b"%PDF-1.7\n", "DIR/mask.png is no image that can be read: replace the image"),
    Hostile(
        "mask",
        "PostScript",
        b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 30 20\n",
        "DIR/mask.png is no image that can be read, or is truncated: replace the image",
    ),
    Hostile("mask", "folder", folder(), "DIR/mask.png is not a file: give the path of a file"),
    Hostile(
        "mask",
        "memory of the kernel",
        link("/proc/version"),
        "DIR/mask.png belongs to the system and is not an input: give the path of a file on a disk",
    ),
    Hostile(
        "mask",
        "100 GB",
        sparse(100 << 30),
        "DIR/mask.png has 107,374,182,400 bytes, more than 2,000,000,000: check that it is the right file",
    ),
    Hostile(
        "mask",
        "transparent",
        lambda path: Image.new("RGBA", (30, 20), (255, 255, 255, 0)).save(path, "PNG"),
        "the mask DIR/mask.png is empty",
    ),
    Hostile("frames", "empty", b"", "DIR/f.mp4 is empty (0 bytes): give a video or a folder of images"),
    Hostile("frames", "text", SECRET, "DIR/f.mp4 is a text file: give a video or a folder of images"),
    Hostile(
        "frames",
        "playlist",
        playlist,
        "DIR/f.mp4 is a text file: give a video or a folder of images",
    ),
    Hostile(
        "frames",
        "list of files",
        "ffconcat version 1.0\nfile /etc/passwd\n",
        "DIR/f.mp4 has a format that holds no video: give a video (MP4, MKV, ..) or a folder of images",
    ),
    Hostile(
        "frames",
        "MP4 without index",
        mp4(cut=False),
        "DIR/f.mp4 is no video that can be read (Invalid data found when processing input)",
    ),
    Hostile(
        "frames",
        "ten bytes of MP4",
        mp4(cut=True),
        "DIR/f.mp4 is no video that can be read (Invalid data found when processing input)",
    ),
    Hostile(
        "frames",
        "100 GB of zeros",
        sparse(100 << 30),
        "DIR/f.mp4 is no video that can be read (Invalid data found when processing input)",
    ),
    Hostile(
        "frames", "ZIP", archive(), "DIR/f.mp4 is an archive: unpack it, and give the video or the folder of images"
    ),
    Hostile(
        "frames",
        "sound",
        write_sound,
        "DIR/f.mp4 has a format that holds no video: give a video (MP4, MKV, ..) or a folder of images",
    ),
    Hostile(
        "frames",
        "PNG",
        png(),
        "DIR/f.mp4 has a format that holds no video: give a video (MP4, MKV, ..) or a folder of images",
    ),
    Hostile("frames", "empty folder", folder(), "no images at DIR/f.mp4"),
    Hostile("frames", "folder of texts", folder(("a.txt", b"x")), "no images at DIR/f.mp4"),
    Hostile(
        "frames",
        "folder of broken images",
        folder(("1.png", png()), ("2.png", png()[:40])),
        "DIR/f.mp4/2.png is no image that can be read: replace the image",
    ),
    Hostile(
        "frames",
        "images of two sizes",
        folder(("1.png", png()), ("2.png", png(40, 20))),
        "DIR/f.mp4/2.png is 40 x 20, the first image 30 x 20",
    ),
    Hostile(
        "frames",
        "images of two depths",
        folder(("1.png", png()), ("2.png", cv2.imencode(".png", np.ones((20, 30), np.uint16))[1].tobytes())),
        "DIR/f.mp4/2.png has 16 bits, the first image 8: save all with the same depth",
    ),
    Hostile(
        "frames",
        "image bomb in a folder",
        folder(("1.png", png_of_size(60_000, 60_000)), ("2.png", png())),
        "DIR/f.mp4/1.png states an impossible size: at most 170,000,000 pixels are read",
    ),
    Hostile(
        "frames",
        "folder of links to nowhere",
        folder_with_link("1.png", "/nowhere/1.png"),
        "no images at DIR/f.mp4",
    ),
    Hostile("frames", "pipe", os.mkfifo, "DIR/f.mp4 is neither a file nor a folder"),
    Hostile("frames", "socket", socket, "DIR/f.mp4 is neither a file nor a folder"),
    Hostile("frames", "device", link("/dev/zero"), "DIR/f.mp4 is neither a file nor a folder"),
    Hostile(
        "frames",
        "memory of a process",
        link("/proc/self/maps"),
        "DIR/f.mp4 belongs to the system and is not an input: give the path of a file on a disk",
    ),
    Hostile(
        "frames",
        "link to itself",
        lambda path: path.symlink_to(path),
        "DIR/f.mp4 does not exist: check the path; relative paths count from the catalogue's folder",
    ),
    Hostile(
        "frames",
        "missing",
        lambda path: None,
        "DIR/f.mp4 does not exist: check the path; relative paths count from the catalogue's folder",
    ),
    Hostile(
        "truth",
        "missing",
        lambda path: None,
        "DIR/truth holds no truth: put normals.npy, depth.npy or lights.npy there",
    ),
    Hostile(
        "truth", "empty folder", folder(), "DIR/truth holds no truth: put normals.npy, depth.npy or lights.npy there"
    ),
    Hostile("truth", "file", b"x", "DIR/truth/normals.npy cannot be read (Not a directory): check its permissions"),
    Hostile(
        "truth",
        "no array",
        folder(("depth.npy", SECRET.encode())),
        "DIR/truth/depth.npy is no NumPy array: save it with numpy.save",
    ),
    Hostile(
        "truth",
        "pickle",
        folder(("depth.npy", array(np.full((20, 30), None, object), allow_pickle=True))),
        "DIR/truth/depth.npy holds values of type object: save numbers",
    ),
    Hostile(
        "truth",
        "text",
        folder(("depth.npy", array(np.full((20, 30), "a")))),
        "DIR/truth/depth.npy holds values of type <U1: save numbers",
    ),
    Hostile(
        "truth",
        "code in the head",
        folder(("depth.npy", array_head("__import__('os').system('reboot')"))),
        "DIR/truth/depth.npy is no NumPy array: save it with numpy.save",
    ),
    Hostile(
        "truth",
        "wrong shape",
        folder(("depth.npy", array(np.ones((3, 3))))),
        "DIR/truth/depth.npy has shape 3 x 3: it must be 20 x 30",
    ),
    Hostile(
        "truth",
        "cut",
        folder(("depth.npy", array(np.ones((20, 30)))[:200])),
        "DIR/truth/depth.npy is truncated or empty: copy it again",
    ),
    Hostile(
        "truth",
        "claims of 1e18 numbers",
        folder(
            ("depth.npy", array_head("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000, 1000000000)}\n"))
        ),
        "DIR/truth/depth.npy has shape 1000000000 x 1000000000: it must be 20 x 30",
    ),
    Hostile(
        "truth",
        "link to a device",
        folder_with_link("depth.npy", "/dev/zero"),
        "DIR/truth/depth.npy is not a file: give the path of a file",
    ),
    Hostile(
        "address",
        "s3://user:secret@bucket/key",
        "s3://user:secret@bucket/key",
        "an address of s3:// names only the container and the key",
    ),
    Hostile(
        "address",
        "s3://b",
        "s3://b",
        "'s3://b' names no valid container: give a path, s3://bucket/key or az://container/key",
    ),
    Hostile(
        "address",
        "s3://bucket/../other",
        "s3://bucket/../other",
        "'s3://bucket/../other' has a part '.' or '..' in its key: write the key without it",
    ),
    Hostile(
        "address",
        "az://container/a/../../b",
        "az://container/a/../../b",
        "'az://container/a/../../b' has a part '.' or '..' in its key: write the key without it",
    ),
    Hostile(
        "address",
        "http://169.254.169.254/latest",
        "http://169.254.169.254/latest",
        "addresses of http:// are not supported: give a path, s3://bucket/key or az://container/key",
    ),
    Hostile(
        "address",
        "ftp://host/a.mp4",
        "ftp://host/a.mp4",
        "addresses of ftp:// are not supported: give a path, s3://bucket/key or az://container/key",
    ),
    Hostile(
        "address",
        "s3://",
        "s3://",
        "'s3://' names no valid container: give a path, s3://bucket/key or az://container/key",
    ),
    Hostile(
        "address", "a NUL b", "a\0b", "'a\\x00b' is not an address: give a path, s3://bucket/key or az://container/key"
    ),
    Hostile("address", "blank", " ", "' ' is not an address: give a path, s3://bucket/key or az://container/key"),
    Hostile(
        "address",
        "s3://bucket:9000/key",
        "s3://bucket:9000/key",
        "an address of s3:// names only the container and the key",
    ),
)
