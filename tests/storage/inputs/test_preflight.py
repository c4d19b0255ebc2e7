"""All mistakes in the small files of captures are found at once, before a frame is decoded."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from glint.storage.catalogue.loading import Capture
from glint.storage.errors import InputError, StoreError
from glint.storage.inputs.lp_file import write_lights
from glint.storage.inputs.preflight import check_inputs, input_errors


def _images(folder: Path, count: int) -> str:
    """Files that are no images: nothing may be decoded."""
    folder.mkdir()
    for number in range(count):
        (folder / f"img_{number}.png").write_text(f"no image {number}")
    return str(folder)


def test_every_mistake_of_every_capture_is_found(tmp_path: Path) -> None:
    frames = _images(tmp_path / "jpg", 3)
    (tmp_path / "bad.lp").write_text("2\na 1 2\nb 0 0 0\n")
    (tmp_path / "bad.json").write_text('[{"frame": -1, "x": 1.0, "y": 1.0, "kind": "maybe"}]')
    write_lights(tmp_path / "two.lp", np.eye(3)[:2], ["a", "b"])
    write_lights(tmp_path / "good.lp", np.eye(3), ["a", "b", "c"])
    late = tmp_path / "late.json"
    late.write_text(json.dumps([{"frame": 3, "x": 1.0, "y": 1.0, "kind": "true"}]))
    captures = [
        Capture(id="bare", frames=frames),
        Capture(id="good", frames=frames, lights=str(tmp_path / "good.lp")),
        Capture(id="both", frames=frames, lights=str(tmp_path / "bad.lp"), markup=str(tmp_path / "bad.json")),
        Capture(id="short", frames=frames, lights=str(tmp_path / "two.lp"), markup=str(late)),
        Capture(id="missing", frames=str(tmp_path / "no"), lights=str(tmp_path / "no.lp")),
    ]
    errors = [[error.message for error in found] for found in input_errors(captures)]
    assert errors[:2] == [[], []]
    lights, marks = errors[2]
    assert "bad.lp:2" in lights and "bad.lp:3" in lights
    assert "kind" in marks and "frame" in marks
    assert "2 lights for 3 frames" in errors[3][0] and "after the last frame, 2" in errors[3][1]
    assert len(errors[4]) == 2
    with pytest.raises(InputError) as caught:
        check_inputs(captures[3])
    assert all(message in caught.value.message for message in errors[3])


def test_the_length_of_a_video_is_not_known_before_it_is_decoded(tmp_path: Path) -> None:
    (tmp_path / "video.mp4").write_bytes(b"no video")
    write_lights(tmp_path / "lights.lp", np.eye(3), ["a", "b", "c"])
    check_inputs(Capture(id="a", frames=str(tmp_path / "video.mp4"), lights=str(tmp_path / "lights.lp")))


def test_an_address_that_is_none_is_the_mistake_of_its_capture_alone(tmp_path: Path) -> None:
    write_lights(tmp_path / "lights.lp", np.eye(3), ["a", "b", "c"])
    bad = Capture.model_construct(
        id="bad", frames="https://host/a.mp4", lights=str(tmp_path / "lights.lp"), markup=None
    )
    (tmp_path / "video.mp4").write_bytes(b"no video")
    good = Capture(id="good", frames=str(tmp_path / "video.mp4"), lights=str(tmp_path / "lights.lp"))
    (mistake,), nothing = input_errors([bad, good])
    assert "https:// are not supported" in mistake.message and nothing == []


def test_an_object_store_that_cannot_be_read_is_an_error_of_its_captures_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in os.environ if name.startswith("AZURE_")]:
        monkeypatch.delenv(name)
    (tmp_path / "lights.lp").write_text("no count\n")
    frames = str(tmp_path / "video.mp4")
    remote = Capture(id="remote", frames=frames, lights="az://bucket/lights.lp")
    local = Capture(id="local", frames=frames, lights=str(tmp_path / "lights.lp"))
    (store_error,), (missing, count) = input_errors([remote, local])
    assert isinstance(store_error, StoreError) and "no Azure account is named" in store_error.message
    assert "video.mp4 does not exist" in missing.message and "this is not a count" in count.message
    with pytest.raises(StoreError, match="no Azure account"):
        check_inputs(remote)
