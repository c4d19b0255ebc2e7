"""Catalogues made from folders that follow the usual names."""

import os
from pathlib import Path

import numpy as np
import pytest

from glint.storage.catalogue.ids import id_from_name
from glint.storage.catalogue.loading import Capture, Catalogue, from_folder, load, write
from glint.storage.errors import InputError
from glint.storage.footage.source import open_footage
from tests.storage.footage.videos import ramp, write_images

FRAMES = [ramp(index, 24, 48) for index in range(12)]


def _touch(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"")


def _captures(catalogue: Catalogue) -> dict[str, list[str]]:
    return {item.id: [capture.id for capture in item.captures] for item in catalogue.objects}


def _only(catalogue: Catalogue) -> Capture:
    (item,) = catalogue.objects
    (capture,) = item.captures
    return capture


def _kept(folder: Path, catalogue: Catalogue) -> None:
    """Written and read again it is the same."""
    write(catalogue, folder / "catalogue.yaml")
    assert load(folder / "catalogue.yaml") == catalogue


def test_an_object_with_one_video_and_all_beside_it(tmp_path: Path) -> None:
    _touch(tmp_path, "duck/video.MP4", "duck/mask.png", "duck/lights.lp", "duck/markup.json", "duck/notes.txt")
    _touch(tmp_path, "duck/truth/normals.npy", "duck/truth_model.ply")
    catalogue = from_folder(tmp_path)
    place = tmp_path / "duck"
    capture = _only(catalogue)
    assert (catalogue.name, catalogue.objects[0].id) == (tmp_path.name, "duck")
    assert capture.frames == str(place / "video.MP4")
    assert capture.mask == str(place / "mask.png")
    assert capture.lights == str(place / "lights.lp")
    assert capture.markup == str(place / "markup.json")
    assert capture.truth == str(place / "truth")
    assert catalogue.objects[0].truth_model == str(place / "truth_model.ply")
    _kept(tmp_path, catalogue)


def test_ids_are_names_without_accents(tmp_path: Path) -> None:
    joined, apart = "Große Vase (Böhmen), 1890", "O\u0308lka\u0308nnchen"
    _touch(tmp_path, f"{joined}/Smørøj.mp4", f"{apart}/Łódź.avi", "花瓶/a.mp4", "皿/b.mp4", "№½/c.mp4")
    captures = _captures(from_folder(tmp_path))
    assert captures["grosse-vase-bohmen-1890"] == ["smoroj"]
    assert captures["olkannchen"] == ["lodz"]
    assert id_from_name("O\u0308l") == id_from_name("Öl")
    others = sorted(name for name in captures if name.startswith("unnamed-"))
    assert others == sorted({id_from_name("花瓶"), id_from_name("皿")}), "digests do not depend on other folders"


def test_what_is_left_out_is_told(tmp_path: Path) -> None:
    _touch(tmp_path, "vase/a.CR2", "vase/b.CR2", "vase/c.heic", "dish/views/a.NEF", "notes/read.txt")
    with pytest.raises(InputError, match=r"holds no captures.*develop the CR2 and HEIC and NEF files to 16-bit TIFF"):
        from_folder(tmp_path)
    _touch(tmp_path, "cup/a.mp4")
    left_out = dict[str, str]()
    assert [item.id for item in from_folder(tmp_path, left_out.__setitem__).objects] == ["cup"]
    assert left_out == {
        "dish": "its NEF files are not read",
        "notes": "no video and no set of images",
        "vase": "its CR2 and HEIC files are not read",
    }


def test_views_are_captures(tmp_path: Path) -> None:
    _touch(tmp_path, "duck/view_10/a.mp4", "duck/view_2/b.mov", "duck/view_2/mask.png", "glass/c.avi", "empty/x.txt")
    catalogue = from_folder(tmp_path)
    assert _captures(catalogue) == {"duck": ["view_2", "view_10"], "glass": ["c"]}
    assert catalogue.object("duck").capture("view_2").mask == str(tmp_path / "duck/view_2/mask.png")
    _kept(tmp_path, catalogue)


@pytest.mark.parametrize("view", ["duck", "duck/turn"])
def test_several_videos_in_one_folder_each_have_their_own(tmp_path: Path, view: str) -> None:
    _touch(tmp_path / view, "a.mp4", "b.mp4", "a.mask.png", "b.lp", "b.markup.json", "mask.png", "truth/depth.npy")
    first, second = from_folder(tmp_path).objects[0].captures
    prefix = "turn-" if view == "duck/turn" else ""
    assert (first.id, second.id) == (f"{prefix}a", f"{prefix}b")
    assert (first.mask, first.lights, first.markup) == (str(tmp_path / view / "a.mask.png"), None, None)
    assert (second.mask, second.lights) == (None, str(tmp_path / view / "b.lp"))
    assert second.markup == str(tmp_path / view / "b.markup.json")
    assert first.truth is None


@pytest.mark.parametrize("place", ["dirs.lp", "JPG/dirs.lp", "assembly-files/vase_highlight.lp"])
def test_lights_lie_beside_the_folder_of_the_images_or_in_it(tmp_path: Path, place: str) -> None:
    write_images(tmp_path / "vase" / "JPG", FRAMES)
    _touch(tmp_path / "vase", place)
    capture = _only(from_folder(tmp_path))
    assert (capture.id, capture.lights) == ("front", str(tmp_path / "vase" / place))
    with open_footage(capture.frames) as footage:
        assert footage.count == len(FRAMES)


def test_of_two_files_of_lights_none_is_taken(tmp_path: Path) -> None:
    write_images(tmp_path / "vase" / "jpg", FRAMES)
    _touch(tmp_path / "vase", "jpg/a.lp", "assembly-files/b.lp")
    assert _only(from_folder(tmp_path)).lights is None


@pytest.mark.parametrize("inside", [".", "frames", "images", "jpeg-exports"])
def test_images_are_a_pattern_that_leaves_out_what_is_no_frame(tmp_path: Path, inside: str) -> None:
    write_images(tmp_path / "duck" / inside, FRAMES)
    write_images(tmp_path / "duck", FRAMES[:1], "duck_mask.png")
    write_images(tmp_path / "duck" / inside, FRAMES[:3], "preview_{}.png")
    (tmp_path / "duck" / "lights_of_the_dome.lp").write_text("")
    capture = _only(from_folder(tmp_path))
    assert capture.id == "front"
    assert capture.mask == str(tmp_path / "duck/duck_mask.png")
    assert capture.lights == str(tmp_path / "duck/lights_of_the_dome.lp")
    assert np.array_equal(np.stack(list(open_footage(capture.frames).frames())), np.stack(FRAMES))


def test_masks_and_maps_beside_images_are_no_frames(tmp_path: Path) -> None:
    write_images(tmp_path / "duck", FRAMES, "{}.png")
    for name in ("mask", "normal", "normals", "normal_map", "depth", "albedo", "reference", "duck-mask"):
        write_images(tmp_path / "duck", FRAMES[:1], f"{name}.png")
    footage = open_footage(_only(from_folder(tmp_path)).frames)
    assert footage.names == tuple(f"{number}.png" for number in range(1, 13))


def test_folders_whose_names_hold_signs_of_patterns(tmp_path: Path) -> None:
    write_images(tmp_path / "[duck] *", FRAMES, "a[1]_{}.png")
    catalogue = from_folder(tmp_path)
    assert catalogue.objects[0].id == "duck"
    assert open_footage(_only(catalogue).frames).count == 12


def test_names_become_ids(tmp_path: Path) -> None:
    _touch(
        tmp_path, "Großes Glas/Take 1.mp4", "grosses-glas/a.mp4", "gro-es-glas/a.mp4", "世界/a.mp4", f"{'x' * 90}/a.mp4"
    )
    catalogue = from_folder(tmp_path)
    ids = [item.id for item in catalogue.objects]
    assert len(set(ids)) == 5
    assert set(ids) == {"gro-es-glas", "grosses-glas", "grosses-glas-2", id_from_name("世界"), "x" * 56}
    _kept(tmp_path, catalogue)


def test_no_capture_takes_a_reserved_id(tmp_path: Path) -> None:
    _touch(tmp_path, "duck/model/video.mp4", "duck/front/video.mp4", "duck/zarr.json/video.mp4")
    assert set(_captures(from_folder(tmp_path))["duck"]) == {"model-2", "front", "zarr.json-2"}


def test_of_several_masks_none_is_taken(tmp_path: Path) -> None:
    _touch(tmp_path, "duck/video.mp4", "duck/a_mask.png", "duck/b_mask.png", "duck/a.lp", "duck/b.lp")
    capture = _only(from_folder(tmp_path))
    assert (capture.mask, capture.lights) == (None, None)


@pytest.mark.parametrize("name", ["mask.jpg", "Mask.PNG", "duck_mask.tif", "duck-mask.webp"])
def test_a_mask_may_be_any_image(tmp_path: Path, name: str) -> None:
    _touch(tmp_path, "duck/video.mp4", f"duck/{name}", "duck/unmask.png")
    assert _only(from_folder(tmp_path)).mask == str(tmp_path / "duck" / name)


def test_files_that_might_have_been_meant_are_named(tmp_path: Path) -> None:
    images = [f"vase/jpeg-exports/{number}.jpg" for number in range(3)]
    _touch(
        tmp_path, *images, "vase/assembly-files/a.lp", "vase/assembly-files/b.lp", "vase/mask.jpg", "vase/b_mask.png"
    )
    _touch(tmp_path, "bear/1.png", "bear/2.png", "bear/light_directions.txt", "bear/mask.png")
    _touch(tmp_path, "ring/1.jpg", "ring/2.jpg", "ring/1.tif", "ring/2.tif", "ring/preview-1.png", "ring/a.bmp")
    left_out = dict[str, str]()
    catalogue = from_folder(tmp_path, left_out.__setitem__)
    assert [capture.lights for item in catalogue.objects for capture in item.captures] == [None, None, None]
    assert set(left_out) == {
        "bear/light_directions.txt",
        "assembly-files/a.lp, assembly-files/b.lp",
        "vase/b_mask.png, vase/mask.jpg",
        "ring/[0-9]*.jpg",
        "ring/preview-[0-9]*.png",
        "ring/a.bmp",
    }
    assert "`lights`" in left_out["assembly-files/a.lp, assembly-files/b.lp"]


def test_photographs_of_another_name_are_named_and_copies_go_with_theirs(tmp_path: Path) -> None:
    write_images(tmp_path / "vase", FRAMES[:5], "IMG_{}.png")
    write_images(tmp_path / "vase", FRAMES[5:8], "DSC_{}.png")
    write_images(tmp_path / "vase", FRAMES[2:3], "IMG_{} (1).png")
    write_images(tmp_path / "vase", FRAMES[2:3], "IMG_{} - Copy.png")
    left_out = dict[str, str]()
    capture = _only(from_folder(tmp_path, left_out.__setitem__))
    assert list(left_out) == ["vase/DSC_[0-9]*.png"]
    assert left_out["vase/DSC_[0-9]*.png"].startswith("3 images that do not match IMG_[0-9]*.png")
    with open_footage(capture.frames) as footage:
        assert footage.names == tuple(f"IMG_{number}.png" for number in range(1, 6))
        assert "2 images are copies" in footage.warnings[0]


def test_hidden_files_and_folders_are_left_out(tmp_path: Path) -> None:
    _touch(tmp_path, ".git/a.mp4", "duck/.hidden.mp4", "duck/video.mp4")
    assert _captures(from_folder(tmp_path)) == {"duck": ["video"]}


def test_nothing_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no captures"):
        from_folder(tmp_path)
    with pytest.raises(InputError, match="cannot be read"):
        from_folder(tmp_path / "none")
    _touch(tmp_path, "video.mp4")
    with pytest.raises(InputError, match="cannot be read"):
        from_folder(tmp_path / "video.mp4")


@pytest.mark.shared
def test_the_shared_captures(shared_data: Path) -> None:
    catalogue = from_folder(shared_data / "captures")
    hemisphere = catalogue.object("hemisphere").capture("front")
    with open_footage(hemisphere.frames) as footage:
        assert footage.count > 0


def test_a_long_folder_name_is_shortened(tmp_path: Path) -> None:
    _touch(tmp_path / ("n" * 230), "duck/a.mp4")
    assert from_folder(tmp_path / ("n" * 230)).name == "n" * 200


def test_a_file_name_that_is_no_text_is_the_folders_mistake(tmp_path: Path) -> None:
    (tmp_path / "duck").mkdir()
    (tmp_path / "duck" / os.fsdecode(b"a\xff.mp4")).write_bytes(b"")
    with pytest.raises(InputError, match="duck cannot be an object"):
        from_folder(tmp_path)


def test_footage_that_lies_in_no_sub_folder_or_too_deep_is_named(tmp_path: Path) -> None:
    _touch(tmp_path / "flat", "a.mp4", "1.png", "2.png")
    with pytest.raises(InputError, match=r"flat holds no captures: 1 video and 2 images lie in it directly") as caught:
        from_folder(tmp_path / "flat")
    assert "sub-folder" in caught.value.remedy
    _touch(tmp_path / "deep", "vase/2024/raw/day/1.png", "vase/2024/raw/day/2.png", "cup/x.txt")
    with pytest.raises(InputError, match=r"videos lie deeper, in vase/2024/raw/day"):
        from_folder(tmp_path / "deep")
    _touch(tmp_path / "deep", "dish/a.mp4", "b.mp4")
    left_out = dict[str, str]()
    assert list(_captures(from_folder(tmp_path / "deep", left_out.__setitem__))) == ["dish"]
    assert left_out == {
        "cup": "no video and no set of images",
        "vase": "its images or videos lie deeper, in 2024/raw/day: move them up",
        "deep": "1 video beside the sub-folders: move each object's to a sub-folder",
    }


def test_images_beside_a_video_and_folders_of_masks_are_no_captures(tmp_path: Path) -> None:
    _touch(tmp_path, "cup/a.mp4", "cup/1.png", "cup/2.png", "cup/mask.png")
    _touch(
        tmp_path, "jug/clips/a.mp4", "jug/masks/1.png", "jug/masks/2.png", "jug/jug_mask/3.png", "jug/jug_mask/4.png"
    )
    left_out = dict[str, str]()
    assert _captures(from_folder(tmp_path, left_out.__setitem__)) == {"cup": ["a"], "jug": ["clips"]}
    assert left_out == {"cup": "2 images beside a video, which is taken for the capture"}
