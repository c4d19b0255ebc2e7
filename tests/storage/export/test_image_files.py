from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import tifffile
from PIL import Image

from glint.storage.export import image_files
from tests.pictures import read_picture
from tests.storage.export.image_readers import decode_normals, read_exr, read_png


@pytest.fixture
def normals() -> np.ndarray:
    values = np.random.default_rng(0).normal(size=(7, 11, 3)).astype(np.float32)
    values /= np.linalg.norm(values, axis=-1, keepdims=True)
    values[:2] = np.nan
    return values


def test_normals_as_colours_follow_the_formula() -> None:
    image = image_files.encode_normals(np.array([[[1, 0, 0], [0, -1, 0], [0, 0, 1], [np.nan] * 3]], np.float32))
    assert image.dtype == np.uint16
    assert image.tolist() == [[[65535, 32768, 32768], [32768, 0, 32768], [32768, 32768, 65535], [0, 0, 0]]]


def test_a_16_bit_png_keeps_normals_to_its_last_bit(normals: np.ndarray, tmp_path: Path) -> None:
    image_files.write_png(tmp_path / "n.png", image_files.encode_normals(normals))
    with Image.open(tmp_path / "n.png") as image:
        assert image.size == (11, 7)
    back = read_png(tmp_path / "n.png")
    np.testing.assert_array_equal(back, image_files.encode_normals(normals))
    np.testing.assert_allclose(decode_normals(back), normals, atol=2.5e-5)
    raw = read_picture(tmp_path / "n.png")
    np.testing.assert_array_equal(raw[..., 2], image_files.encode_normals(normals)[..., 0], "red is x")


def test_8_bit_images_and_masks(tmp_path: Path) -> None:
    mask = np.array([[True, False, True]])
    image_files.write_png(tmp_path / "mask.png", mask)
    assert read_png(tmp_path / "mask.png").tolist() == [[255, 0, 255]]
    colours = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    image_files.write_png(tmp_path / "rgb.png", colours)
    with Image.open(tmp_path / "rgb.png") as image:
        np.testing.assert_array_equal(np.asarray(image), colours)


def test_float_images_are_lossless(normals: np.ndarray, tmp_path: Path) -> None:
    image_files.write_exr(tmp_path / "n.exr", normals)
    np.testing.assert_array_equal(read_exr(tmp_path / "n.exr"), normals)
    with OpenEXR.File(str(tmp_path / "n.exr"), separate_channels=True) as file:
        np.testing.assert_array_equal(file.channels()["G"].pixels, normals[..., 1], "green is y")
    image_files.write_exr(tmp_path / "y.exr", normals[..., 0])
    np.testing.assert_array_equal(read_exr(tmp_path / "y.exr"), normals[..., 0])
    image_files.write_tiff(tmp_path / "d.tiff", normals[..., 2])
    np.testing.assert_array_equal(tifffile.imread(tmp_path / "d.tiff"), normals[..., 2])
    np.testing.assert_array_equal(read_picture(tmp_path / "d.tiff"), normals[..., 2])


def test_other_types_and_shapes_are_refused(tmp_path: Path) -> None:
    for image in (np.zeros((2, 2)), np.zeros((2, 2, 4), np.uint8), np.zeros(3, np.uint8)):
        with pytest.raises(ValueError, match="no PNG"):
            image_files.write_png(tmp_path / "x.png", image)


def test_colours_leave_the_background_plain() -> None:
    values = np.array([[0.0, 1.0, np.nan]])
    colours = image_files.colour_values(values, 0, 1)
    assert colours[0, 2].tolist() == [255] * 3 and colours[0, 1].sum() > colours[0, 0].sum()
    assert image_files.colour_normals(np.array([[[0, 0, 1.0], [np.nan] * 3]])).tolist() == [
        [[128, 128, 255], [255] * 3]
    ]
    palette = np.array([[0, 0, 0], [9, 9, 9]])
    assert image_files.colour_codes(np.array([[0, 1, 200]], np.uint8), palette)[0, :, 0].tolist() == [0, 9, 9]
