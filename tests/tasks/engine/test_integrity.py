"""What a run trusts: results that are whole, inputs that stayed the same, frames as they were written."""

import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glint.storage.errors import InputError, StoreError
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.references import load_catalogue
from glint.tasks.engine.stage import Stage, StageOutput, perform, stage_keys
from glint.tasks.pipeline import BY_NAME, STAGES
from glint.tasks.publish import catalogues_of, check_catalogue, publish
from glint.tasks.up_to_date import up_to_date_records
from tests.scene import draw_scene
from tests.tasks.make_context import make_context

NAMES = ("survey", "frames")


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The catalogue of a drawn capture of 130 frames."""
    return draw_scene(tmp_path_factory.mktemp("scene"), frames=130).catalogue


@pytest.fixture
def context(scene: Path, tmp_path: Path) -> CaptureContext:
    """Its capture in an empty store, with files of its own."""
    folder = tmp_path / "inputs"
    shutil.copytree(scene.parent, folder)
    loaded = make_context(folder / scene.name, tmp_path / "store")
    return loaded


def _perform(context: CaptureContext, names: tuple[str, ...] = NAMES) -> list[bool]:
    """Perform stages; return which were stored already."""
    keys = stage_keys(context, STAGES)
    return [perform(context, BY_NAME[name], keys[name]).cached for name in names]


def _flip_a_chunk(context: CaptureContext) -> Path:
    chunks = Path(context.store, "objects", context.object_id, "repo", "chunks")
    largest = max(chunks.iterdir(), key=lambda path: (path.stat().st_size, path.stat().st_mtime_ns))
    data = bytearray(largest.read_bytes())
    data[len(data) // 2] ^= 4
    largest.write_bytes(data)
    return largest


def test_a_damaged_result_is_computed_again(context: CaptureContext) -> None:
    assert _perform(context) == [False, False]
    assert _perform(context) == [True, True]
    before = context.load("frames").read("peak")
    for damage in (lambda path: path, Path.unlink):
        damage(_flip_a_chunk(context))
        assert False in _perform(context)
        assert _perform(context) == [True, True]
        assert np.array_equal(context.load("frames").read("peak"), before)


def test_only_what_is_whole_is_up_to_date(context: CaptureContext, monkeypatch: pytest.MonkeyPatch) -> None:
    stages = [BY_NAME[name] for name in NAMES]
    monkeypatch.setattr("glint.tasks.up_to_date.STAGES", stages)
    monkeypatch.setattr("glint.tasks.publish.NAMES", NAMES)

    def run() -> str:
        fresh = replace(context)
        _perform(fresh)
        return publish([fresh], "run", "catalogue.yaml").name

    assert run() == "v1"
    stored = up_to_date_records([context])
    assert stored is not None
    assert stored[0].name == "v1"
    _flip_a_chunk(context)
    assert up_to_date_records([context]) is None
    assert up_to_date_records([replace(context, rehash=True)]) is None
    assert run() == "v2"
    assert up_to_date_records([context]) is not None
    with pytest.raises(StoreError, match=r"in v1 is damaged"):
        for name in NAMES:
            result = context.repository.load(context.capture.id, name, "v1")
            for array in result.arrays:
                result.read(array)


def test_damaged_frames_are_taken_from_the_video_again(context: CaptureContext) -> None:
    _perform(context)
    frames = Path(context.store, "frames")
    (shard, *_) = sorted(path for path in frames.rglob("0") if path.is_file() and "object" in path.parts)
    data = bytearray(shard.read_bytes())
    data[100] ^= 1
    before = context.load("frames").read("background")
    shard.write_bytes(data)
    context.repository.save(context.capture.id, "frames", "stale", {}, {})
    assert _perform(context) == [True, False]
    assert np.array_equal(context.load("frames").read("background"), before)


Change = Callable[[Path], None]


def _replace(path: Path) -> None:
    """Put another file in its place, of the same size and time of modification."""
    status = path.stat()
    other = path.with_name("other")
    other.write_bytes(bytes([path.read_bytes()[0] ^ 1]) + path.read_bytes()[1:])
    os.utime(other, ns=(status.st_atime_ns, status.st_mtime_ns))
    other.rename(path)


def _append(path: Path) -> None:
    with path.open("ab") as file:
        file.write(b"\0")


@pytest.mark.parametrize("change", [_replace, _append])
@pytest.mark.parametrize("moment", ["before", "while"])
def test_inputs_that_change_are_not_stored_under_the_old_key(
    context: CaptureContext, change: Change, moment: str
) -> None:
    address = context.file("mask") or context.file("frames")
    assert address is not None
    key = "mask" if context.file("mask") else "frames"

    def run(inputs: Any, progress: Any) -> StageOutput:
        if moment == "while":
            change(Path(address))
        return StageOutput({"a": np.zeros(3)}, counts={}, warnings=())

    stage = replace(BY_NAME["mask"], run=run, files=(key,), reads=())
    digests = context.digest(key)
    assert digests
    if moment == "before":
        change(Path(address))
    with pytest.raises(InputError, match="change"):
        perform(context, stage, "key of the old file")
    assert context.repository.stage_key(context.capture.id, "mask") is None


def test_an_input_that_was_another_for_a_while_is_read_again(context: CaptureContext) -> None:
    path, runs = Path(str(context.file("frames"))), list[int]()
    whole = path.read_bytes()

    def run(inputs: Any, progress: Any) -> StageOutput:
        runs.append(1)
        if len(runs) == 1:
            _append(path)
            path.write_bytes(whole)
        return StageOutput({"a": np.zeros(3)})

    stage: Stage = replace(BY_NAME["mask"], run=run, files=("frames",), reads=(), arrays={})
    assert not perform(context, stage, "key").cached
    assert len(runs) == 2


def test_a_video_that_changes_leaves_no_frames_under_its_digest(context: CaptureContext) -> None:
    keys = stage_keys(context, STAGES)
    perform(context, BY_NAME["survey"], keys["survey"])
    video = Path(str(context.file("frames")))
    whole = video.read_bytes()
    _append(video)
    with pytest.raises(InputError, match="changed while it was read"):
        perform(context, BY_NAME["frames"], keys["frames"])
    video.write_bytes(whole)
    assert _perform(replace(context)) == [True, False]


def test_digests_travel_with_the_context(context: CaptureContext) -> None:
    import pickle

    digest = context.digest("frames")
    sent = pickle.loads(pickle.dumps(context))
    _append(Path(str(context.file("frames"))))
    assert sent.digest("frames") == digest
    with pytest.raises(InputError, match="changed while it was read"):
        sent.check_unchanged(["frames"])


def test_an_object_belongs_to_one_catalogue(
    context: CaptureContext, scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("glint.tasks.publish.NAMES", NAMES)
    check_catalogue([context], "/a/catalogue.yaml")
    _perform(context)
    publish([context], "run", "/a/catalogue.yaml")
    assert catalogues_of(context.location, [context.object_id]) == {"/a/catalogue.yaml": [context.object_id]}
    check_catalogue([context], "/a/catalogue.yaml")
    # A catalogue that moved with its videos is the same one.
    check_catalogue([context], "/moved/catalogue.yaml")
    # A capture of it whose address cannot be used says nothing against the others.
    misnamed = context.capture.model_copy(update={"frames": "http://host/video.mkv"})
    check_catalogue([replace(context, capture=misnamed), context], "/moved/catalogue.yaml")
    other = tmp_path / "other.mkv"
    shutil.copy(str(context.file("frames")), other)
    _append(other)
    capture = context.capture.model_copy(update={"frames": str(other)})
    with pytest.raises(StoreError, match=r"published from the catalogue /a/catalogue.yaml.*--adopt"):
        check_catalogue([replace(context, capture=capture)], "/b/catalogue.yaml")
    check_catalogue([replace(context, capture=capture)], "/a/catalogue.yaml")
    # So is a copy of the catalogue, as the inbox makes one, when the video was replaced or is named by a link.
    shutil.copy(other, str(context.file("frames")))
    link = tmp_path / "link.mkv"
    link.symlink_to(str(context.file("frames")))
    for address in (context.capture.frames, str(link)):
        replaced = replace(context, capture=context.capture.model_copy(update={"frames": address}))
        check_catalogue([replaced], "/store/inbox/catalogue.yaml")
    assert load_catalogue(scene).objects
