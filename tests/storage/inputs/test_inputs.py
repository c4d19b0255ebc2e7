"""What lies beside the frames is checked: masks, lights, markup, truth."""

import json
import unicodedata
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
import pytest
from PIL import Image

from glint.storage.catalogue.loading import Camera, Region
from glint.storage.errors import InputError
from glint.storage.inputs.lp_file import write_lights
from glint.storage.inputs.masks_and_truth import (
    camera_matrix,
    read_lights,
    read_markup,
    read_mask,
    read_truth,
)

SIZE = (20, 30)
REGION = Region(x=5, y=4, width=12, height=10)


def _image(path: Path, pixels: np.ndarray) -> Path:
    assert cv2.imwrite(str(path), pixels)
    return path


def _disc(size: tuple[int, int] = SIZE) -> np.ndarray:
    rows, columns = np.indices(size)
    return np.asarray((rows - 8) ** 2 + (columns - 10) ** 2 < 16)


def _refused(call: Any, *arguments: Any, **options: Any) -> InputError:
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    assert caught.value.remedy
    return caught.value


def test_a_mask_of_the_frame_or_of_the_region(tmp_path: Path) -> None:
    whole, part = _disc(), _disc()[REGION.rows, REGION.columns]
    frame = _image(tmp_path / "frame.png", whole.astype(np.uint8))
    region = _image(tmp_path / "region.png", part.astype(np.uint8) * 255)
    assert np.array_equal(read_mask(frame, SIZE), whole)
    assert np.array_equal(read_mask(frame, SIZE, REGION), part)
    assert np.array_equal(read_mask(region, SIZE, REGION), part)
    assert read_mask(region, SIZE, REGION).dtype == bool


@pytest.mark.parametrize("kind", ["colour", "alpha", "deep", "faint blue"])
def test_depth_and_channels_of_a_mask_do_not_matter(tmp_path: Path, kind: str) -> None:
    mask = _disc()
    kinds: dict[str, np.ndarray] = {
        "colour": np.repeat(mask[..., None], 3, axis=2).astype(np.uint8) * 255,
        "alpha": np.dstack([mask * 255] * 3 + [np.full(SIZE, 255)]).astype(np.uint8),
        "deep": mask.astype(np.uint16),
        "faint blue": np.dstack([mask, np.zeros(SIZE), np.zeros(SIZE)]).astype(np.uint8),
    }
    assert np.array_equal(read_mask(_image(tmp_path / "mask.png", kinds[kind]), SIZE), mask)


@pytest.mark.parametrize("form", ["jpg", "webp", "jp2"])
def test_the_grey_edge_of_a_lossy_mask_is_no_object(tmp_path: Path, form: str) -> None:
    rows, columns = np.mgrid[:120, :160]
    mask = np.hypot(rows - 60, columns - 70) < 40
    for number, colour in enumerate(((255, 255, 255), (220, 30, 20))):
        path = tmp_path / f"mask{number}.{form}"
        Image.fromarray(mask[..., None] * np.array(colour, np.uint8)).save(path, quality=60)
        with Image.open(path) as image:
            assert np.asarray(image).any(axis=2).sum() > mask.sum() or form == "jp2", "the format is lossy"
        assert (read_mask(path, mask.shape) ^ mask).sum() < 0.15 * 2 * np.pi * 40


def test_a_lossy_mask_with_other_levels_than_black_and_white_is_refused(tmp_path: Path) -> None:
    photograph = np.full((120, 160), 60, np.uint8)
    photograph[40:80, 60:90] = 250
    Image.fromarray(photograph).save(tmp_path / "mask.jpg")
    error = _refused(read_mask, tmp_path / "mask.jpg", photograph.shape)
    assert "mask.jpg is a JPEG with the level 60 at x 0, y 0" in error.message and "save it as PNG" in error.remedy
    Image.fromarray(photograph // 10).save(tmp_path / "dark.jpg")
    assert "is empty" in _refused(read_mask, tmp_path / "dark.jpg", photograph.shape).message


def test_a_mask_of_a_wrong_size(tmp_path: Path) -> None:
    path = _image(tmp_path / "mask.png", np.ones((20, 31), np.uint8))
    error = _refused(read_mask, path, SIZE, REGION)
    assert "is 31 x 20" in error.message
    assert error.remedy == "it must have the frame's 30 x 20 or the region's 12 x 10 pixels"


def test_an_empty_mask(tmp_path: Path) -> None:
    assert "is empty" in _refused(read_mask, _image(tmp_path / "a.png", np.zeros(SIZE, np.uint8)), SIZE).message
    outside = np.zeros(SIZE, np.uint8)
    outside[0, 0] = 255
    path = _image(tmp_path / "b.png", outside)
    assert "is empty inside the region" in _refused(read_mask, path, SIZE, REGION).message


def test_a_mask_that_is_no_image(tmp_path: Path) -> None:
    (tmp_path / "mask.png").write_bytes(b"no image")
    assert str(tmp_path / "mask.png") in _refused(read_mask, tmp_path / "mask.png", SIZE).message
    assert "does not exist" in _refused(read_mask, tmp_path / "none.png", SIZE).message
    assert "is not a file" in _refused(read_mask, tmp_path, SIZE).message


def test_the_matrix_of_a_camera() -> None:
    assert camera_matrix(None) is None
    matrix = camera_matrix(Camera(matrix=((9.0, 0, 3), (0, 9.0, 2), (0, 0, 1))))
    assert matrix is not None
    assert matrix.tolist() == [[9, 0, 3], [0, 9, 2], [0, 0, 1]]


def _lights(folder: Path, text: str | bytes) -> Path:
    path = folder / "lights.lp"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_lights_in_order_become_unit(tmp_path: Path) -> None:
    lights = read_lights(_lights(tmp_path, "2\na.jpg 0 0 2\nb.jpg 3 0 4\n"), count=2)
    assert lights.dtype == np.float32
    assert np.allclose(lights, np.array([[0, 0, 1], [0.6, 0, 0.8]]))


@pytest.mark.parametrize("rows", [("b.png", "a.png"), ("dir/b.png", "c:\\dir\\A.PNG"), ("b.tif", "a.jpg")])
def test_lights_match_images_by_name(tmp_path: Path, rows: tuple[str, str]) -> None:
    path = _lights(tmp_path, f"2\n{rows[0]} 1 0 0\n{rows[1]} 0 1 0\n")
    assert read_lights(path, ["a.png", "b.png"]).tolist() == [[0, 1, 0], [1, 0, 0]]


def test_names_may_hold_spaces_tabs_and_other_letters(tmp_path: Path) -> None:
    path = _lights(tmp_path, "\ufeff2\r\n\r\nmy photo 1.png\t1 0 0\r\nphoto é.png   0 1 0\r\n\r\n")
    assert read_lights(path, ["photo é.png", "my photo 1.png"]).tolist() == [[0, 1, 0], [1, 0, 0]]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252"])
@pytest.mark.parametrize("form", ["NFC", "NFD"])
def test_names_with_umlauts_match_in_the_encodings_of_all_systems(
    tmp_path: Path, encoding: str, form: Literal["NFC", "NFD"]
) -> None:
    (tmp_path / "a.lp").write_bytes("2\r\nC:\\rti\\Größe 2.jpg 1 0 0\r\nGröße 1.jpg 0 1 0\r\n".encode(encoding))
    names = [unicodedata.normalize(form, name) for name in ("Größe 1.jpg", "Größe 2.jpg")]
    assert read_lights(tmp_path / "a.lp", names).tolist() == [[0, 1, 0], [1, 0, 0]]


def test_more_rows_than_images_are_chosen_by_name(tmp_path: Path) -> None:
    path = _lights(tmp_path, "3\na.png 1 0 0\nb.png 0 1 0\nc.png 0 0 1\n")
    assert read_lights(path, ["c.png", "a.png"]).tolist() == [[0, 0, 1], [1, 0, 0]]


def test_names_that_do_not_match_fall_back_to_the_order(tmp_path: Path) -> None:
    path = _lights(tmp_path, "2\nx.png 1 0 0\ny.png 0 1 0\n")
    assert read_lights(path, ["a.png", "b.png"]).tolist() == [[1, 0, 0], [0, 1, 0]]


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        (("b.png", "c.png", "d.png"), "2 of 3 names match; 'd.png' is no image; 'a.png' has no row"),
        (("a.png", "a.png", "b.png"), "1 of 3 names match; 'c.png' has no row; 'a.png' has several rows"),
        (("a.png", "b.png"), "2 of 3 names match; 'c.png' has no row"),
    ],
)
def test_names_of_which_only_some_match_are_refused(tmp_path: Path, rows: tuple[str, ...], text: str) -> None:
    path = _lights(tmp_path, "\n".join([str(len(rows)), *(f"{name} 1 0 0" for name in rows)]))
    assert text in _refused(read_lights, path, ["a.png", "b.png", "c.png"]).message


def test_lights_behind_the_object_are_refused(tmp_path: Path) -> None:
    rows = ["100", *["a 0.6 0 0.8"] * 6, *["a 0.6 0 -0.8"] * 94]
    error = _refused(read_lights, _lights(tmp_path, "\n".join(rows)))
    assert "94 of 100 lights of" in error.message and "(z < 0)" in error.message and "negate it" in error.remedy


def test_images_of_several_folders_with_the_same_name_are_taken_in_order(tmp_path: Path) -> None:
    path = _lights(tmp_path, "2\n2/img.png 1 0 0\n10/img.png 0 1 0\n")
    assert read_lights(path, ["img.png", "img.png"]).tolist() == [[1, 0, 0], [0, 1, 0]]


def test_several_rows_of_what_is_no_image_do_not_matter(tmp_path: Path) -> None:
    path = _lights(tmp_path, "4\nz.png 0 0 1\nb.png 1 0 0\nz.png 0 0 1\na.png 0 1 0\n")
    assert read_lights(path, ["a.png", "b.png"]).tolist() == [[0, 1, 0], [1, 0, 0]]


@pytest.mark.parametrize(
    ("rows", "refused"),
    [
        (("0 0.1 0.2 0.9 1", "photo 2.png 0 0 1"), "0 0.1 0.2 0.9 1"),
        (("a.png 0 0 1 1", "b.png 0 1 0 2"), "a.png 0 0 1 1"),
        (("a.png 1 0 0 1", "b.png 2 0 1 0"), "a.png 1 0 0 1"),
    ],
)
def test_rows_of_more_numbers_are_refused(tmp_path: Path, rows: tuple[str, str], refused: str) -> None:
    error = _refused(read_lights, _lights(tmp_path, "\n".join(["2", *rows])))
    assert f":2: {refused!r} has more than three numbers" in error.message


@pytest.mark.parametrize("names", [("Light 1", "Light 2"), ("a.png 1", "b.png")])
def test_names_of_several_words_may_end_with_a_whole_number(tmp_path: Path, names: tuple[str, str]) -> None:
    path = _lights(tmp_path, f"2\n{names[0]} 0 0 1\n{names[1]} 0 1 0\n")
    assert read_lights(path, count=2).tolist() == [[0, 0, 1], [0, 1, 0]]


@pytest.mark.parametrize("count", [1, 3])
def test_lights_for_another_number_of_frames(tmp_path: Path, count: int) -> None:
    path = _lights(tmp_path, "2\na 1 0 0\nb 0 1 0\n")
    assert f"2 lights for {count} frames" in _refused(read_lights, path, count=count).message
    names = [f"img_{number}.png" for number in range(count)]
    assert f"2 lights for {count} frames" in _refused(read_lights, path, names).message


def test_a_mistake_in_every_row_is_listed_a_few_times(tmp_path: Path) -> None:
    rows = [f"{number}.png 0 0 1 1" for number in range(200)]
    error = _refused(read_lights, _lights(tmp_path, "\n".join(["200", *rows])))
    assert error.message.count("has more than three numbers") == 5 and error.message.endswith("; and 195 more")


def test_everything_wrong_with_lights_is_reported_with_its_line(tmp_path: Path) -> None:
    rows = ["7", "a 1 0 0", "b nan 0 1", "c 0 0 0", "d 1 0", "", "e 1 0 z", "f inf 0 0", "g 1e-9 0 0"]
    path = _lights(tmp_path, "\n".join(rows))
    error = _refused(read_lights, path)
    for line in (3, 4, 5, 7, 8, 9):
        assert f"{path}:{line}:" in error.message
    for line in (1, 2, 6):
        assert f"{path}:{line}:" not in error.message


def test_a_count_that_is_not_true(tmp_path: Path) -> None:
    path = _lights(tmp_path, "3\na 1 0 0\nb 0 1 0\n")
    assert f"{path}:1: the first line states 3 lights, 2 follow" in _refused(read_lights, path).message


@pytest.mark.parametrize(
    "text", ["", "\n", "a 1 0 0\n", "-1\n", "1.0\na 1 0 0\n", "²\na 1 0 0\n", b"\xff\xfe\x00", "9" * 30]
)
def test_no_lights_at_all(tmp_path: Path, text: str | bytes) -> None:
    path = _lights(tmp_path, text)
    assert f"{path}:1:" in _refused(read_lights, path).message


def test_no_light_for_no_frame_is_refused(tmp_path: Path) -> None:
    assert _refused(read_lights, _lights(tmp_path, "0\n"))


def test_written_lights_are_read_again(tmp_path: Path) -> None:
    directions = np.array([[0, 0.6, 0.8], [0.28, 0, 0.96]], np.float32)
    write_lights(tmp_path / "a.lp", directions, ["b 1.png", "a.png"])
    assert np.allclose(read_lights(tmp_path / "a.lp", ["a.png", "b 1.png"]), directions[::-1], atol=1e-7)
    with pytest.raises(ValueError, match="zip"):
        write_lights(tmp_path / "b.lp", directions, ["a.png"])


def _markup(folder: Path, value: Any) -> Path:
    path = folder / "markup.json"
    path.write_text(value if isinstance(value, str) else json.dumps(value, indent=1), encoding="utf-8")
    return path


def _mark(frame: int = 0, x: float = 10.0, y: float = 8.0, kind: str = "true") -> dict[str, Any]:
    return {"frame": frame, "x": x, "y": y, "kind": kind}


def test_annotations_keep_their_order(tmp_path: Path) -> None:
    path = _markup(tmp_path, [_mark(5, 10, 8.25, "false"), _mark(2)])
    first, second = read_markup(path, SIZE, 6, REGION, _disc()[REGION.rows, REGION.columns])
    assert (first.frame, first.x, first.y, first.kind) == (5, 10.0, 8.25, "false")
    assert second.frame == 2
    assert read_markup(_markup(tmp_path, []), SIZE) == []


@pytest.mark.parametrize(
    ("mark", "says"),
    [
        (_mark(frame=6), "is after the last frame, 5"),
        (_mark(x=29.6), "outside the frame of 30 x 20"),
        (_mark(y=-0.6), "outside the frame"),
        (_mark(x=4.4), "outside the region"),
        (_mark(y=14.0), "outside the region"),
        (_mark(x=16.0), "outside the object"),
    ],
)
def test_misplaced_annotations_are_reported_with_their_line(tmp_path: Path, mark: dict[str, Any], says: str) -> None:
    path = _markup(tmp_path, [_mark(), mark])
    error = _refused(read_markup, path, SIZE, 6, REGION, _disc()[REGION.rows, REGION.columns])
    assert error.message.startswith(f"{path}:8: mark 2 at frame {mark['frame']}")
    assert says in error.message


def test_all_misplaced_annotations_are_reported(tmp_path: Path) -> None:
    path = _markup(tmp_path, [_mark(x=99), _mark(), _mark(frame=9)])
    error = _refused(read_markup, path, SIZE, 6)
    assert f"{path}:2: mark 1 " in error.message
    assert f"{path}:14: mark 3 " in error.message
    assert "mark 2 " not in error.message


def test_borders_belong_to_the_frame(tmp_path: Path) -> None:
    marks = [_mark(x=-0.5, y=-0.5), _mark(x=29.4, y=19.4)]
    assert len(read_markup(_markup(tmp_path, marks), SIZE)) == 2


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("frame", -1),
        ("frame", 1.5),
        ("frame", "3"),
        ("frame", True),
        ("x", "10"),
        ("x", float("nan")),
        ("y", float("inf")),
        ("y", None),
        ("kind", True),
        ("kind", "maybe"),
        ("colour", "red"),
    ],
)
def test_malformed_annotations_are_reported_with_their_line(tmp_path: Path, key: str, value: Any) -> None:
    path = _markup(tmp_path, [_mark(), _mark() | {key: value}])
    line = 8 + ["frame", "x", "y", "kind", "colour"].index(key) + 1
    assert f"{path}:{line}:" in _refused(read_markup, path, SIZE).message


def test_a_missing_key_and_the_nearest_known_one(tmp_path: Path) -> None:
    path = _markup(tmp_path, '[{"fram": 0, "x": 1.0, "y": 1.0, "kind": "true"}]')
    error = _refused(read_markup, path, SIZE)
    assert "is missing" in error.message
    assert "did you mean 'frame'?" in error.remedy


@pytest.mark.parametrize(
    "text", ["", "{}", "3", "null", '"a"', "[", "[3]", "[[]]", '{"marks": []}', "[" * 5000, '[{"x": 1,']
)
def test_other_values_than_a_list_of_annotations(tmp_path: Path, text: str) -> None:
    path = _markup(tmp_path, text)
    assert f"{path}:" in _refused(read_markup, path, SIZE).message


def test_markup_that_is_not_utf_8(tmp_path: Path) -> None:
    (tmp_path / "markup.json").write_bytes(b'["\xff"]')
    assert "not UTF-8" in _refused(read_markup, tmp_path / "markup.json", SIZE).message


def _truth(folder: Path, **arrays: np.ndarray) -> Path:
    for name, array in arrays.items():
        np.save(folder / f"{name}.npy", array, allow_pickle=True)
    return folder


def _normals() -> np.ndarray:
    """Unit normals (10, 12, 3) towards the camera."""
    normals = np.random.default_rng(0).normal(size=(10, 12, 3))
    normals[..., 2] = np.abs(normals[..., 2])
    return np.asarray(normals / np.linalg.norm(normals, axis=-1, keepdims=True))


@pytest.mark.parametrize(
    ("factors", "message"),
    [
        ((0.5, 0.5, 0.5), "have a length of 0.5"),
        ((1, -1, -1), "point away from the camera"),
        ((0, 0, 0), "holds no normal"),
    ],
)
def test_true_normals_of_another_convention(tmp_path: Path, factors: tuple[float, ...], message: str) -> None:
    assert message in _refused(read_truth, _truth(tmp_path, normals=_normals() * factors), (10, 12)).message


def test_truth_is_read_as_it_is(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    normals, depth = _normals(), np.asfortranarray(random.normal(size=(10, 12)).astype(np.float32))
    depth[0] = np.nan
    truth = read_truth(_truth(tmp_path, normals=normals, depth=depth), (10, 12))
    assert truth.normals is not None
    assert truth.depth is not None
    assert truth.lights is None
    assert truth.normals.dtype == np.float32
    assert np.array_equal(truth.normals, normals.astype(np.float32))
    assert np.array_equal(truth.depth, depth, equal_nan=True)


@pytest.mark.parametrize("kind", [">f8", "<f2", "<i4", ">u2"])
def test_truth_of_any_kind_of_number(tmp_path: Path, kind: str) -> None:
    lights = np.arange(12).reshape(4, 3)
    truth = read_truth(_truth(tmp_path, lights=lights.astype(kind)))
    assert truth.lights is not None
    assert np.array_equal(truth.lights, lights.astype(np.float32))


@pytest.mark.parametrize(
    ("name", "shape"),
    [("normals", (10, 12)), ("normals", (12, 10, 3)), ("depth", (10, 12, 1)), ("depth", (9, 12)), ("lights", (4, 2))],
)
def test_truth_of_a_wrong_shape(tmp_path: Path, name: str, shape: tuple[int, ...]) -> None:
    error = _refused(read_truth, _truth(tmp_path, **{name: np.zeros(shape)}), (10, 12))
    assert f"{name}.npy has shape {' x '.join(map(str, shape))}" in error.message


def test_no_truth(tmp_path: Path) -> None:
    assert "holds no truth" in _refused(read_truth, tmp_path).message
    assert "holds no truth" in _refused(read_truth, tmp_path / "none").message


class _Trap:
    """Writes a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return Path.touch, (self.path,)


def test_pickled_arrays_are_refused_and_never_run(tmp_path: Path) -> None:
    trap = np.empty((10, 12), object)
    trap[:] = _Trap(tmp_path / "sprung")
    assert "object" in _refused(read_truth, _truth(tmp_path, depth=trap), (10, 12)).message
    assert not (tmp_path / "sprung").exists()


@pytest.mark.parametrize("kind", ["U3", "bool", "complex64", "M8[s]", "f4,f4"])
def test_truth_that_is_no_numbers(tmp_path: Path, kind: str) -> None:
    assert "values of type" in _refused(read_truth, _truth(tmp_path, depth=np.zeros((10, 12), kind))).message


@pytest.mark.parametrize("keep", [0, 4, 8, 60, 128, 500])
def test_truth_that_is_cut_off(tmp_path: Path, keep: int) -> None:
    path = _truth(tmp_path, depth=np.zeros((10, 12))) / "depth.npy"
    path.write_bytes(path.read_bytes()[:keep])
    assert str(path) in _refused(read_truth, tmp_path).message


@pytest.mark.parametrize(
    "header",
    [
        "{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999, 99999999999), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (3037000500, 3037000500), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (-1, -8), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (4294967296, 4294967296), }",
        "__import__('os').abort()",
        "{'descr': '<f8'}",
        "(" * 3000,
    ],
)
def test_hostile_headers_are_refused(tmp_path: Path, header: str) -> None:
    text = header.encode().ljust(118) + b"\n"
    data = b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + bytes(64)
    (tmp_path / "depth.npy").write_bytes(data)
    assert str(tmp_path / "depth.npy") in _refused(read_truth, tmp_path).message


@pytest.mark.parametrize("kind", ["dark object", "white on clear", "palette", "grey with alpha", "painted", "soft"])
def test_a_cut_out_is_a_mask(tmp_path: Path, kind: str) -> None:
    """A transparent ground is background, whatever colour lies under it."""
    mask = _disc()
    alpha = (mask * 255).astype(np.uint8)
    colours = np.random.default_rng(1).integers(0, 256, (*SIZE, 3), np.uint8)
    path = tmp_path / "mask.png"
    if kind == "dark object":
        colours[mask] //= 8
        colours[8, 10] = 0
        Image.fromarray(np.dstack([colours, alpha])).save(path)
    elif kind == "white on clear":
        Image.fromarray(np.dstack([np.full((*SIZE, 3), 255, np.uint8), alpha])).save(path)
    elif kind == "palette":
        palette = Image.fromarray(np.where(mask, 3, 7).astype(np.uint8), "P")
        palette.putpalette([90] * 768)
        palette.save(path, transparency=7)
    elif kind == "grey with alpha":
        Image.fromarray(np.dstack([colours[..., 0], alpha])).save(path)
    elif kind == "painted":
        # Black and white, with a transparent margin: the paint counts.
        margin = np.full(SIZE, 255, np.uint8)
        margin[0] = 0
        Image.fromarray(np.dstack([np.repeat(alpha[..., None], 3, axis=2), margin])).save(path)
    else:
        rows, columns = np.indices(SIZE)
        edge = np.clip(4.0 - np.hypot(rows - 8, columns - 10), -0.5, 0.5) + 0.5
        Image.fromarray(np.dstack([colours, np.floor(edge * 255).astype(np.uint8)])).save(path)
        mask = np.floor(edge * 255) >= 128
    assert np.array_equal(read_mask(path, SIZE), mask)
