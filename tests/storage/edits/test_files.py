"""Edits as files: written as a catalogue names them, taken from there, and mistakes in them named."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from glint.storage.edits.edits import Edits
from glint.storage.edits.files import changes_of_files, take_files, write_files
from glint.storage.edits.models import Changes, mask_png
from glint.storage.errors import InputError, OutputError
from glint.storage.inputs.markup import read_markup
from glint.storage.inputs.masks_and_truth import read_mask
from tests.storage.edits.sample_edits import MARKS, VALUES, drawn_mask
from tests.storage.stores import local_store


@pytest.fixture
def edits(tmp_path: Path) -> Edits:
    return Edits.open(local_store(tmp_path / "store"), "duck")


def test_what_was_written_is_taken_again(edits: Edits, tmp_path: Path) -> None:
    everything = Changes.model_validate(VALUES | {"mask": drawn_mask(), "note": "it leaked"}, strict=False)
    edits.save("front", everything, "Ann", 0)
    edits.save("back", Changes.model_validate({"pose": {"camera_to_world": np.eye(4).tolist()}}), "Ann", 1)
    written = write_files(edits, edits.captures(), tmp_path / "out")
    names = [path.relative_to(tmp_path / "out").as_posix() for path in written]
    assert names == ["edits.yaml", "front/mask.png", "front/markup.json"]
    np.testing.assert_array_equal(read_mask(tmp_path / "out/front/mask.png", (48, 64)), drawn_mask())
    marks = read_markup(tmp_path / "out/front/markup.json", (48, 64))
    assert [mark.model_dump() for mark in marks] == MARKS

    copy = Edits.open(local_store(tmp_path / "copy"), "duck")
    saved = take_files(copy, tmp_path / "out/edits.yaml", "Bob")
    assert [(item.capture, item.author) for item in saved] == [("back", "Bob"), ("front", "Bob")]
    for capture in ("front", "back"):
        old, new = edits.current(capture), copy.current(capture)
        assert old.edited == new.edited
        for field in set(old.edited) - {"mask"}:
            assert getattr(old, field) == getattr(new, field)
    np.testing.assert_array_equal(copy.current("front").mask, drawn_mask())
    assert take_files(copy, tmp_path / "out/edits.yaml", "Bob") == [], "it is there already"
    with pytest.raises(OutputError, match="is not empty"):
        write_files(edits, ["front"], tmp_path / "out")


def test_a_disk_that_is_full_leaves_nothing_in_the_way_of_another_attempt(edits: Edits, tmp_path: Path) -> None:
    noise = np.random.default_rng(0).random((400, 400)) < 0.5
    edits.save("side", Changes(mask=noise), "Ann", edits.revision)
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=12k", "none", str(disk)]
    if os.geteuid() or subprocess.run(mount, check=False).returncode:
        pytest.skip("mounting a small disk needs root")
    try:
        with pytest.raises(OSError, match="No space left"):
            write_files(edits, edits.captures(), disk)
        assert not list(disk.iterdir())
    finally:
        subprocess.run(["umount", disk], check=True)


def test_only_named_keys_change_and_null_takes_an_edit_back(edits: Edits, tmp_path: Path) -> None:
    edits.save("front", Changes(pixel_size=0.5, verdict="good", mask=drawn_mask()), "Ann", 0)
    (tmp_path / "edits.yaml").write_text("captures:\n- {id: front, mask: null, pixel_size: 0.25}\n- {id: back}\n")
    (saved,) = take_files(edits, tmp_path / "edits.yaml", "Bob")
    assert saved.fields == ("pixel_size", "mask")
    current = edits.current("front")
    assert (current.mask, current.pixel_size, current.verdict) == (None, 0.25, "good")
    assert take_files(edits, tmp_path / "edits.yaml", "Bob", only="back") == []
    with pytest.raises(InputError, match="has no capture side"):
        take_files(edits, tmp_path / "edits.yaml", "Bob", only="side")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("captures:\n- id: front\n  sphere: []\n", "edits.yaml:3: unknown key 'sphere'.*did you mean 'spheres'"),
        ("captures:\n- id: front\n  pixel_size: 0\n", "edits.yaml:3: .*pixel_size is 0"),
        ("captures:\n- id: ../up\n", "is not a valid id"),
        ("captures:\n- id: front\n  mask: absent.png\n", "absent.png does not exist"),
        ("captures:\n- id: front\n  mask: edits.yaml\n", "edits.yaml is no image"),
        ("captures:\n- id: front\n  mask: empty.png\n", "empty.png is empty"),
        ("captures:\n- id: front\n  markup: bad.json\n", "bad.json:1: .*maybe"),
        ("objects: []\n", "begin with `captures:`"),
        ("captures: !!python/object [1]\n", "edits.yaml:1: "),
    ],
)
def test_mistakes_are_named_and_nothing_is_saved(edits: Edits, tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "edits.yaml").write_text("captures:\n- {id: first, verdict: good}\n" + text.partition("\n")[2])
    if not text.startswith("captures:\n"):
        (tmp_path / "edits.yaml").write_text(text)
    (tmp_path / "empty.png").write_bytes(mask_png(np.zeros((4, 4), bool)))
    (tmp_path / "bad.json").write_text('[{"frame": 1, "x": 1, "y": 2, "kind": "maybe"}]')
    with pytest.raises(InputError, match=message.replace("yaml:3", "yaml:4")):
        take_files(edits, tmp_path / "edits.yaml", "Bob")
    assert edits.revision == 0


def test_single_files_are_taken(edits: Edits, tmp_path: Path) -> None:
    (tmp_path / "mask.png").write_bytes(mask_png(drawn_mask()))
    changes = changes_of_files(tmp_path / "mask.png", None)
    assert changes.changed == ("mask",)
    edits.save("front", changes, "Ann", 0)
    np.testing.assert_array_equal(edits.current("front").mask, drawn_mask())
