"""Copies among the images of a capture are no frames of their own."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from glint.storage.errors import InputError
from glint.storage.footage.copies import image_files
from glint.storage.footage.source import open_footage
from glint.storage.inputs.lp_file import read_lights, write_lights
from tests.storage.footage.videos import ramp, write_images

FRAMES = [ramp(index) for index in range(6)]


def _copies(folder: Path) -> dict[str, str]:
    files = image_files(folder)
    assert files is not None
    return {copy.name: original.name for copy, original in files.originals.items()}


@pytest.mark.parametrize(
    "name", ["img_3 (1).png", "img_3 - Copy.png", "img_3 copy 2.png", "Kopie von img_3.png", "img_61.png", "a.png"]
)
def test_a_file_of_equal_bytes_is_a_copy_whatever_its_name(tmp_path: Path, name: str) -> None:
    paths = write_images(tmp_path, FRAMES)
    shutil.copy(paths[2], tmp_path / name)
    original, copy = ("a.png", "img_3.png") if name == "a.png" else ("img_3.png", name)
    with open_footage(tmp_path) as footage:
        assert footage.count == 6 == len(list(footage.frames()))
        assert footage.names == tuple(sorted({path.name for path in paths} - {copy} | {original}, key=_number))
        (warning,) = footage.warnings
    assert f"1 image is a copy of another and left out: {copy} of {original}" in warning


def _number(name: str) -> int:
    return int("".join(filter(str.isdigit, name)) or 0)


@pytest.mark.parametrize("name", ["img_3 (1).png", "img_3 - Kopie.tif", "Copy of img_3.png", "IMG_3.bmp"])
def test_pixels_decide_where_a_name_is_that_of_a_copy(tmp_path: Path, name: str) -> None:
    write_images(tmp_path, FRAMES)
    Image.fromarray(FRAMES[2]).save(tmp_path / name)
    assert _copies(tmp_path) == {name: "img_3.png"}
    Image.fromarray(FRAMES[2] + np.uint8(1)).save(tmp_path / name)
    assert _copies(tmp_path) == {}, "the name alone makes no copy"


def test_numbers_in_parentheses_are_names_of_photographs(tmp_path: Path) -> None:
    write_images(tmp_path, FRAMES, "vase ({}).png")
    assert open_footage(tmp_path).count == 6
    shutil.copy(tmp_path / "vase (2).png", tmp_path / "vase (2) (1).png")
    assert _copies(tmp_path) == {"vase (2) (1).png": "vase (2).png"}


def test_images_of_one_size_in_bytes_are_no_copies(tmp_path: Path) -> None:
    """They may be alike in all places that are compared first."""
    dark = [np.full((256, 256), 7, np.uint8) for _ in range(3)]
    for number, frame in enumerate(dark):
        frame[0, number] = 200
    paths = write_images(tmp_path, dark, "{}.pgm")
    assert len({path.stat().st_size for path in paths}) == 1
    assert _copies(tmp_path) == {}
    shutil.copy(paths[1], tmp_path / "4.pgm")
    assert _copies(tmp_path) == {"4.pgm": "2.pgm"}


def test_what_cannot_be_decoded_is_left_to_its_reader(tmp_path: Path) -> None:
    write_images(tmp_path, FRAMES)
    (tmp_path / "img_3 copy.png").write_bytes(b"no image")
    assert _copies(tmp_path) == {}
    with pytest.raises(InputError, match=r"img_3 copy\.png"):
        list(open_footage(tmp_path).frames())


def test_many_copies_are_counted(tmp_path: Path) -> None:
    for path in write_images(tmp_path, [*FRAMES, ramp(6)]):
        shutil.copy(path, path.with_stem(f"{path.stem} (1)"))
    (warning,) = open_footage(tmp_path).warnings
    assert warning.startswith("7 images are copies of others and left out: img_1 (1).png of img_1.png")
    assert "and 2 more" in warning


def test_photographs_in_two_formats_are_refused(tmp_path: Path) -> None:
    write_images(tmp_path, FRAMES, "dsc_{}.jpg")
    write_images(tmp_path, FRAMES[:5], "DSC_{}.tif")
    with pytest.raises(InputError, match=r"holds 5 images twice, as \.jpg and as \.tif") as caught:
        open_footage(tmp_path)
    assert "*.jpg" in caught.value.remedy
    assert open_footage(tmp_path / "*.tif").count == 5


def test_lights_of_images_with_a_copy(tmp_path: Path) -> None:
    """Rows in order may count the copy; rows by name need none for it."""
    paths = write_images(tmp_path / "images", FRAMES[:3])
    shutil.copy(paths[0], tmp_path / "images" / "img_1 (1).png")
    directions = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8]])
    files = image_files(tmp_path / "images")
    assert files is not None and [file.name for file in files.listed][files.skipped[0]] == "img_1 (1).png"
    names = [file.name for file in files.kept]
    for rows, row_names in (
        (directions, ["a", "b", "c"]),
        (directions, names),
        (np.insert(directions, files.skipped[0], [0.6, 0.0, 0.8], axis=0), ["a", "b", "c", "d"]),
    ):
        write_lights(tmp_path / "lights.lp", rows, row_names)
        lights = read_lights(tmp_path / "lights.lp", names, skipped=files.skipped)
        assert np.allclose(lights, directions, atol=1e-5)
    write_lights(tmp_path / "lights.lp", directions[:2], ["a", "b"])
    with pytest.raises(InputError, match="2 lights for 3 frames without 1 that are copies"):
        read_lights(tmp_path / "lights.lp", names, skipped=files.skipped)
