"""Whatever a catalogue, lights, marks, a name or a store say: a clear refusal, and nothing is written elsewhere."""

import json
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from glint.storage.catalogue.from_folder import from_folder
from glint.storage.catalogue.loading import Catalogue, load
from glint.storage.catalogue.models import Region
from glint.storage.errors import GlintError, InputError, StoreError
from glint.storage.footage.source import open_footage
from glint.storage.frames.cache import FrameCache
from glint.storage.inputs.digests import content_digest
from glint.storage.inputs.lp_file import read_lights
from glint.storage.inputs.markup import read_markup
from glint.storage.inputs.masks_and_truth import read_mask
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import StoredFile
from glint.tasks.engine.parameters import Parameters
from tests.storage.catalogue.hostile_inputs import png_of_size

QUICK = settings(
    max_examples=80,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    database=None,
    derandomize=True,
)
GOOD = """schema: 1
name: glass
parameters: {labels: {method: sheets}}
objects:
  - id: wine-glass
    captures:
      - id: front
        frames: front.mp4
        spheres: [{x: 344.0, y: 126.5, radius: 42.0, diameter_mm: 25.0}]
        region: {x: 16, y: 16, width: 251, height: 221}
        camera: {matrix: [[2900.0, 0.0, 959.5], [0.0, 2900.0, 539.5], [0.0, 0.0, 1.0]]}
        pose: {turntable: 30.0}
"""
BITS = [
    "&a",
    "*a",
    "!!python/object/apply:os.system [x]",
    "<<: *a",
    "---",
    "...",
    "? ",
    "- ",
    ": ",
    "{",
    "]",
    "#",
    "\t",
]
BITS += ["../../x", "id: ../up", "~root", "s3://a@b/c", "\x00", "\ud800", "é", "9" * 400, "1e999", ".nan", "|", ">-"]
KEYS = ["schema", "name", "parameters", "objects", "id", "captures", "frames", "spheres", "x", "radius", "pose", "mask"]
SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.sampled_from(KEYS + BITS) | st.text(max_size=12)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(KEYS) | st.text(max_size=5), inner),
    max_leaves=12,
)


@st.composite
def spoiled(draw: st.DrawFn, text: str) -> str:
    """A text with some of its parts cut out, doubled, or replaced by what does harm."""
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        stop = draw(st.integers(start, min(len(text), start + 20)))
        text = text[:start] + draw(st.sampled_from([*BITS, text[start:stop] * 2, ""])) + text[stop:]
    return text


def only_refused(read: Callable[[], Any]) -> Any:
    """What reading gives, None if it is refused with a message and a remedy; any other error is a defect."""
    try:
        return read()
    except GlintError as error:
        assert error.message and error.remedy
        assert len(str(error)) < 20_000
        return None


def is_safe(catalogue: Catalogue) -> bool:
    """Whether all its ids stay in their folder."""
    place = Location.parse("/store")
    ids = [item.id for item in catalogue.objects]
    ids += [capture.id for item in catalogue.objects for capture in item.captures]
    return all(place.child(name).parent == place for name in ids)


@QUICK
@given(text=spoiled(GOOD))
@example(text="[" * 100_000)
@example(text="{a: " * 50_000)
@example(text="a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n")
@example(text="- " * 50_000 + "x")
@example(text=GOOD + "  " * 200_000)
def test_spoiled_catalogues(tmp_path: Path, text: str) -> None:
    path = tmp_path / "catalogue.yaml"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    value = only_refused(lambda: load(path, Parameters))
    assert value is None or is_safe(value)


@pytest.mark.long
@QUICK
@given(value=VALUES)
def test_catalogues_of_anything(tmp_path: Path, value: Any) -> None:
    path = tmp_path / "catalogue.yaml"
    document = {"schema": 1, "name": "x", "objects": value}
    path.write_text(json.dumps(document if isinstance(value, list) else value, allow_nan=True))
    value = only_refused(lambda: load(path, Parameters))
    assert value is None or is_safe(value)


@QUICK
@given(
    text=spoiled(
        '[{"frame": 984, "x": 120.0, "y": 88.0, "kind": "true"}, {"frame": 0, "x": 1, "y": 2, "kind": "false"}]'
    )
)
@example(text="[" * 100_000)
@example(text='[{"frame": ' + "9" * 5000 + ', "x": 1, "y": 1, "kind": "true"}]')
@example(text='[{"frame": 1, "x": 1e999, "y": -1e999, "kind": "true"}]')
def test_spoiled_annotations(tmp_path: Path, text: str) -> None:
    (tmp_path / "annotations.json").write_bytes(text.encode("utf-8", "surrogatepass"))
    annotations = only_refused(lambda: read_markup(tmp_path / "annotations.json", (480, 640), 2000))
    assert annotations is None or all(0 <= entry.frame < 2000 and -0.5 <= entry.x < 640 for entry in annotations)


@QUICK
@given(text=spoiled("3\nimg_1.png 0.1 0.2 0.9\nimg 2.png 0 0 1\nimg_3.png -0.5 0.1 0.8\n"))
@example(text="999999999\nx 0 0 1\n")
@example(text="1\nx 1e308 1e308 1e308\n")
def test_spoiled_lights(tmp_path: Path, text: str) -> None:
    (tmp_path / "lights.lp").write_bytes(text.encode("utf-8", "surrogatepass"))
    lights = only_refused(lambda: read_lights(tmp_path / "lights.lp"))
    assert lights is None or np.allclose(np.linalg.norm(lights, axis=1), 1.0, atol=1e-5)


@QUICK
@given(
    name=st.sampled_from(["..", ".", "", "a/b", "/etc", "a\\b", "a\0b", "~", "con", "a" * 65, "A"])
    | st.text(max_size=9)
)
def test_names_never_leave_the_store(tmp_path: Path, name: str) -> None:
    before = sorted(path.name for path in tmp_path.iterdir())
    location = Location.parse(tmp_path / "store")
    value = only_refused(lambda: ObjectRepository.open(location, name, create=False))
    assert value is None and sorted(path.name for path in tmp_path.iterdir()) == before
    try:
        assert location.child(name).parent == location
    except GlintError as error:
        assert error.remedy


@QUICK
@given(address=st.text(max_size=20) | spoiled("s3://bucket/some/key") | spoiled("az://container/../key"))
def test_addresses_of_anything(address: str) -> None:
    value = only_refused(lambda: Location.parse(address))
    assert value is None or ".." not in value.path.split("/")


def test_links_that_lead_in_a_circle_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.mp4").symlink_to(tmp_path / "b.mp4")
    (tmp_path / "b.mp4").symlink_to(tmp_path / "a.mp4")
    (tmp_path / "inside").mkdir()
    (tmp_path / "inside" / "again").symlink_to(tmp_path / "inside")
    with pytest.raises(InputError):
        open_footage(str(tmp_path / "a.mp4"))
    with pytest.raises(InputError):
        content_digest(str(tmp_path / "a.mp4"), Location.parse(tmp_path / "store"))
    with pytest.raises(InputError):
        from_folder(tmp_path)


def test_a_catalogue_that_is_a_device_or_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    import os

    os.mkfifo(tmp_path / "pipe.yaml")
    for place in (tmp_path / "pipe.yaml", Path("/dev/zero"), tmp_path):
        with pytest.raises(GlintError):
            load(place, Parameters)


def test_a_picture_that_unpacks_to_gigabytes_is_refused_by_its_head(tmp_path: Path) -> None:
    (tmp_path / "mask.png").write_bytes(png_of_size(60_000, 60_000, 5_000_000))
    assert (tmp_path / "mask.png").stat().st_size < 10_000
    tracemalloc.start()
    with pytest.raises(InputError):
        read_mask(tmp_path / "mask.png", (480, 640), Region(x=0, y=0, width=64, height=64))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 50e6


def test_frames_that_claim_to_be_huge_are_refused(tmp_path: Path) -> None:
    location, digest = Location.parse(tmp_path), "a" * 64
    place = tmp_path / "frames" / digest
    crops = {"object": {"x": 0, "y": 0, "width": 10**9, "height": 10**9}}
    about = {"layout": 1, "bits": 8, "frame_size": [10**9, 10**9], "crops": crops, "frames": 10**12, "total": 10**12}
    group = {"zarr_format": 3, "node_type": "group", "attributes": about | {"warnings": []}}
    place.mkdir(parents=True)
    (place / "zarr.json").write_text(json.dumps(group))
    with pytest.raises(StoreError):
        FrameCache.open(location, digest).read("object", slice(0, 64), slice(0, 64), slice(0, 64))


@pytest.mark.parametrize("name", ["../../etc/passwd", "a/b", "/etc/passwd", "", ".bashrc", "zarr.json", "x\x00y"])
def test_files_have_plain_names(tmp_path: Path, name: str) -> None:
    repository = ObjectRepository.open(Location.parse(tmp_path), "duck")
    with pytest.raises(StoreError, match="names a file"):
        repository.save("front", "surface", "k", {}, {}, {name: StoredFile(b"ply", "model/ply")})
    assert repository.stage_key("front", "surface") is None
