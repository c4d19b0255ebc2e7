"""Footage gives every frame upright, in order, full range; what is damaged is told."""

from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from PIL import Image

from glint.storage.errors import InputError
from glint.storage.footage.source import ImageSet, Video, open_footage
from tests.storage.footage.videos import ramp, turn, write_images, write_video

FRAMES = [ramp(index) for index in range(30)]


def _read(path: Path | str) -> np.ndarray:
    with open_footage(path) as footage:
        frames = np.stack(list(footage.frames()))
        assert frames.shape[1:] == (footage.height, footage.width)
        assert 8 * frames.itemsize == footage.bits
    return frames


def _grey(frames: np.ndarray) -> np.ndarray:
    """Levels from 0 to 255."""
    return frames.astype(float) / np.iinfo(frames.dtype).max * 255


def _noisy(count: int = 60) -> list[np.ndarray]:
    """Frames that do not compress to nothing, so that a cut through the file hits many of them."""
    random = np.random.default_rng(0)
    return [
        np.clip(ramp(index, 96, 128) + random.normal(0, 9, (96, 128)), 0, 255).astype(np.uint8)
        for index in range(count)
    ]


def _damaged(path: Path) -> tuple[np.ndarray, list[str]]:
    with open_footage(path) as video:
        return np.stack(list(video.frames())), video.warnings


LOSSLESS = [
    ("ffv1.mkv", {"codec": "ffv1", "pixels": "gray"}, 8),
    ("ffv1_10.mkv", {"codec": "ffv1", "pixels": "yuv420p10le"}, 16),
    ("ffv1_16.mkv", {"codec": "ffv1", "pixels": "gray16le"}, 16),
    ("lossless.mp4", {"options": {"qp": "0"}}, 8),
    ("full.mp4", {"options": {"qp": "0"}, "full_range": True}, 8),
]
LOSSY = [
    ("h264.mp4", {}, 8, 1.0),
    ("h264_10.mp4", {"pixels": "yuv420p10le"}, 16, 1.0),
    ("h264_444.mp4", {"pixels": "yuv444p"}, 8, 1.0),
    ("mp4v.mp4", {"codec": "mpeg4", "options": {"qscale": "2", "flags": "+qscale"}}, 8, 4.0),
    ("mjpg.avi", {"codec": "mjpeg", "pixels": "yuvj420p", "full_range": True}, 8, 2.5),
    ("vp9.webm", {"codec": "libvpx-vp9"}, 8, 1.0),
]


@pytest.mark.parametrize(("name", "options", "bits"), LOSSLESS)
def test_a_lossless_video_is_read_exactly(tmp_path: Path, name: str, options: dict[str, Any], bits: int) -> None:
    video = open_footage(write_video(tmp_path / name, FRAMES, **options))
    assert isinstance(video, Video)
    assert (video.count, video.height, video.width, video.bits) == (30, 48, 64, bits)
    frames = _read(tmp_path / name)
    # Limited range has 219 steps for 255 levels.
    assert np.abs(_grey(frames) - np.stack(FRAMES)).max() <= (1.0 if "lossless" in name else 0.2)


@pytest.mark.parametrize(("name", "options", "bits", "error"), LOSSY)
def test_every_codec(tmp_path: Path, name: str, options: dict[str, Any], bits: int, error: float) -> None:
    video = open_footage(write_video(tmp_path / name, FRAMES, **options))
    frames = np.stack(list(video.frames()))
    assert video.warnings == []
    assert (video.count, len(frames), video.bits) == (30, 30, bits)
    distance = np.abs(_grey(frames)[:, None] - np.stack(FRAMES)[None]).mean(axis=(2, 3))
    assert distance.diagonal().max() < error
    assert (distance.argmin(axis=1) % 16 == np.arange(30) % 16).all()


def test_a_variable_frame_rate_loses_and_doubles_nothing(tmp_path: Path) -> None:
    times = np.cumsum([0, 3, 40, 900, 2, *[77] * 25]).tolist()
    frames, warnings = _damaged(
        write_video(tmp_path / "a.mkv", FRAMES, "ffv1", "gray", times=times)
    )  # fmt: skip
    assert warnings == []
    assert np.array_equal(frames, np.stack(FRAMES))


def test_slots_without_a_frame_are_no_truncation(tmp_path: Path) -> None:
    times = [40 * index + 400 * (index > 20) for index in range(30)]
    path = write_video(tmp_path / "a.avi", FRAMES, "mjpeg", "yuvj420p", times=times, full_range=True)
    frames, warnings = _damaged(path)
    assert len(frames) == 30
    assert warnings == []


@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_the_rotation_flag_turns_frames_upright(tmp_path: Path, degrees: int) -> None:
    path = write_video(tmp_path / "a.mp4", FRAMES[:3], options={"qp": "0"})
    turn(path, degrees)
    upright = np.stack([np.rot90(frame, -degrees // 90) for frame in FRAMES[:3]])
    frames = _read(path)
    assert frames.shape == upright.shape
    assert np.abs(frames.astype(int) - upright).max() <= 1


def test_opencv_turns_the_same_way(tmp_path: Path) -> None:
    path = write_video(tmp_path / "a.mp4", FRAMES[:3], options={"qp": "0"})
    turn(path, 90)
    read, colour = cv2.VideoCapture(str(path)).read()
    assert read
    assert np.abs(_read(path)[0].astype(int) - colour[..., 0]).max() <= 2


@pytest.mark.parametrize(("height", "width"), [(47, 63), (2, 2), (1, 1), (33, 17)])
def test_odd_sizes(tmp_path: Path, height: int, width: int) -> None:
    wanted = [np.full((height, width), 40 * index, np.uint8) for index in range(5)]
    frames = _read(write_video(tmp_path / "a.mkv", wanted, "ffv1", "gray"))
    assert np.array_equal(frames, np.stack(wanted))


@pytest.mark.parametrize(("start", "step"), [(0, 1), (7, 1), (0, 4), (5, 3), (29, 1), (30, 1), (99, 2)])
def test_part_of_the_frames(tmp_path: Path, start: int, step: int) -> None:
    video = open_footage(write_video(tmp_path / "a.mkv", FRAMES, "ffv1", "gray"))
    images = open_footage(write_images(tmp_path / "images", FRAMES)[0].parent)
    for footage in (video, images):
        frames = list(footage.frames(start, step))
        assert len(frames) == len(FRAMES[start::step])
        for have, want in zip(frames, FRAMES[start::step], strict=True):
            assert np.array_equal(have, want)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("faststart.mp4", {"container_options": {"movflags": "faststart"}}),
        ("pieces.mp4", {"container_options": {"movflags": "frag_keyframe+empty_moov"}, "options": {"g": "10"}}),
        ("a.mkv", {}),
        ("a.avi", {"codec": "mjpeg", "pixels": "yuvj420p", "full_range": True}),
    ],
)
def test_a_truncated_video_gives_what_is_there_and_names_the_frame(
    tmp_path: Path, name: str, options: dict[str, Any]
) -> None:
    wanted = _noisy()
    path = write_video(tmp_path / name, wanted, **options)
    whole, warnings = _damaged(path)
    assert len(whole) == 60
    assert warnings == []
    data = path.read_bytes()
    path.write_bytes(data[: int(0.6 * len(data))])
    part, warnings = _damaged(path)
    assert 20 < len(part) < 50
    assert f"the video ends early: frames 0 to {len(part) - 1}" in warnings[-1]
    # The decoder may lack the reference of the very last frame.
    assert np.array_equal(part[:-1], whole[: len(part) - 1])


def test_reading_again_does_not_double_the_warnings(tmp_path: Path) -> None:
    path = write_video(tmp_path / "a.mkv", _noisy())
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    video = open_footage(path)
    assert len(list(video.frames())) == len(list(video.frames()))
    assert len(video.warnings) == 1


def test_a_hole_in_the_file_is_reported(tmp_path: Path) -> None:
    path = write_video(tmp_path / "a.avi", _noisy(), "mjpeg", "yuvj420p", full_range=True)
    data = path.read_bytes()
    middle = len(data) // 2
    path.write_bytes(data[:middle] + bytes(200) + data[middle + 200 :])
    frames, warnings = _damaged(path)
    assert 55 <= len(frames) < 60
    assert len(warnings) == 1
    assert "cannot be decoded" in warnings[0]


def test_a_video_without_its_index_is_refused(tmp_path: Path) -> None:
    path = write_video(tmp_path / "a.mp4", _noisy())
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match="lost its index"):
        open_footage(path)


@pytest.mark.parametrize(
    ("data", "kind"),
    [(b"", r"empty \(0 bytes\)"), (b"hello\n" * 200, "a text file"), (b"PK\x03\x04" + bytes(90), "an archive")],
)
def test_what_a_file_is_instead_of_a_video_is_named(tmp_path: Path, data: bytes, kind: str) -> None:
    (tmp_path / "a.mp4").write_bytes(data)
    with pytest.raises(InputError, match=f"a.mp4 is {kind}: .*give (a|the) video"):
        open_footage(tmp_path / "a.mp4")


def test_a_video_that_may_not_be_read_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def denied(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    (tmp_path / "a.mp4").write_bytes(b"xx")
    monkeypatch.setattr("av.open", denied)
    monkeypatch.setattr(Path, "open", denied)
    with pytest.raises(InputError, match=r"a.mp4 is no video that can be read \(Permission denied\)"):
        open_footage(tmp_path / "a.mp4")


@pytest.mark.parametrize("data", [b"\0" * 100_000, bytes(range(256)) * 400])
@pytest.mark.parametrize("name", ["a.mp4", "a.avi", "a.mkv", "a"])
def test_garbage_is_refused(tmp_path: Path, data: bytes, name: str) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=r"no video that can be read|no frame|no video stream"):
        open_footage(tmp_path / name)


def test_the_head_of_a_video_followed_by_garbage_is_refused_or_read(tmp_path: Path) -> None:
    data = bytearray(write_video(tmp_path / "a.mkv", FRAMES).read_bytes())
    data[600:] = np.random.default_rng(0).bytes(len(data) - 600)
    (tmp_path / "a.mkv").write_bytes(data)
    with pytest.raises(InputError):
        open_footage(tmp_path / "a.mkv")


def test_an_unknown_codec_is_refused(tmp_path: Path) -> None:
    path = write_video(tmp_path / "a.mp4", FRAMES)
    path.write_bytes(path.read_bytes().replace(b"avc1", b"zzzz"))
    with pytest.raises(InputError, match="how its video is encoded"):
        open_footage(path)


def test_an_empty_container_is_refused(tmp_path: Path) -> None:
    path = write_video(tmp_path / "a.mp4", FRAMES)
    path.write_bytes(path.read_bytes()[:40])
    with pytest.raises(InputError, match="no video that can be read"):
        open_footage(path)


def test_sound_alone_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=8000)
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), "fltp", "mono")
        sound.sample_rate = 8000
        for packet in [*stream.encode(sound), *stream.encode()]:
            container.mux(packet)
    with pytest.raises(InputError, match="no video stream"):
        open_footage(path)


@pytest.mark.parametrize("name", ["none.mp4", "none", "none/img_*.png"])
def test_nothing_there(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"does not exist|no images") as caught:
        open_footage(tmp_path / name)
    assert str(tmp_path / "none") in caught.value.message
    assert caught.value.remedy


def test_images_come_in_natural_order(tmp_path: Path) -> None:
    write_images(tmp_path, FRAMES[:12])
    (tmp_path / "notes.txt").write_text("no image")
    (tmp_path / ".img_0.png").write_bytes(b"hidden")
    footage = open_footage(tmp_path)
    assert isinstance(footage, ImageSet)
    assert footage.names == tuple(f"img_{number}.png" for number in range(1, 13))
    assert np.array_equal(_read(tmp_path), np.stack(FRAMES[:12]))


def test_a_pattern_chooses_among_the_files(tmp_path: Path) -> None:
    write_images(tmp_path, FRAMES[:12])
    write_images(tmp_path, FRAMES[20:22], "mask_{}.png")
    assert np.array_equal(_read(tmp_path / "img_*.png"), np.stack(FRAMES[:12]))
    assert np.array_equal(_read(tmp_path / "mask_[12].png"), np.stack(FRAMES[20:22]))


def test_a_folder_whose_name_holds_signs_of_patterns(tmp_path: Path) -> None:
    write_images(tmp_path / "glass [1]", FRAMES[:2])
    assert len(_read(tmp_path / "glass [1]")) == 2


def test_a_folder_without_images(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no images at [^,]*: the folder"):
        open_footage(tmp_path)
    for number in range(3):
        (tmp_path / f"IMG_{number}.DNG").write_bytes(b"raw")
    (tmp_path / "IMG_9.png").symlink_to(tmp_path / "none")
    with pytest.raises(InputError, match=r", but 3 \.dng files and 1 link that leads nowhere") as caught:
        open_footage(tmp_path)
    assert "convert" in caught.value.remedy
    with pytest.raises(InputError, match=r"\*\.tif, but 3 \.dng files"):
        open_footage(tmp_path / "*.tif")


def test_a_heic_picture_is_named_whatever_its_suffix(tmp_path: Path) -> None:
    (tmp_path / "IMG_1.jpg").write_bytes(b"\0\0\0\x18ftypheic\0\0\0\0")
    with pytest.raises(InputError, match=r"IMG_1\.jpg is a HEIC picture") as caught:
        open_footage(tmp_path)
    assert "JPEG" in caught.value.remedy


@pytest.mark.parametrize("suffix", ["png", "tif", "bmp", "pgm", "webp"])
def test_grey_images(tmp_path: Path, suffix: str) -> None:
    folder = write_images(tmp_path, FRAMES[:3], f"{{}}.{suffix}")[0].parent
    error = np.abs(_read(folder).astype(int) - np.stack(FRAMES[:3]))
    assert error.max() <= (12 if suffix == "webp" else 0)


def test_colour_images_become_luma(tmp_path: Path) -> None:
    colour = np.zeros((8, 10, 3), np.uint8)
    colour[..., 2], colour[..., 1], colour[..., 0] = 200, 100, 50
    colour[0, 0] = 90
    frames = _read(write_images(tmp_path, [colour] * 2)[0].parent)
    assert abs(int(frames[0, 4, 4]) - (0.299 * 200 + 0.587 * 100 + 0.114 * 50)) <= 1
    assert frames[0, 0, 0] == 90


@pytest.mark.parametrize("suffix", ["png", "tif"])
def test_images_of_16_bits(tmp_path: Path, suffix: str) -> None:
    wanted = [(frame.astype(np.uint16) * 200 + index).astype(np.uint16) for index, frame in enumerate(FRAMES[:3])]
    footage = open_footage(write_images(tmp_path, wanted, f"{{}}.{suffix}")[0].parent)
    assert footage.bits == 16
    assert np.array_equal(np.stack(list(footage.frames())), np.stack(wanted))


def test_transparency_and_palettes_do_not_matter(tmp_path: Path) -> None:
    grey = Image.fromarray(FRAMES[0])
    grey.convert("LA").save(tmp_path / "1.png")
    grey.convert("RGBA").save(tmp_path / "2.png")
    grey.convert("P").save(tmp_path / "3.png")
    assert np.array_equal(_read(tmp_path), np.stack([FRAMES[0]] * 3))


def test_the_turn_that_a_camera_notes_is_heeded(tmp_path: Path) -> None:
    image = Image.fromarray(FRAMES[0])
    notes = Image.Exif()
    notes[0x0112] = 6
    image.save(tmp_path / "1.jpg", quality=100, exif=notes)
    assert np.abs(_read(tmp_path)[0].astype(int) - np.rot90(FRAMES[0], -1)).max() <= 6


@pytest.mark.parametrize(
    ("odd_image", "says"),
    [
        (np.zeros((48, 63), np.uint8), "63 x 48, the first image 64 x 48"),
        (np.zeros((48, 64), np.uint16), "16 bits, the first image 8"),
    ],
)
def test_images_that_differ_are_named(tmp_path: Path, odd_image: np.ndarray, says: str) -> None:
    write_images(tmp_path, [*FRAMES[:6], odd_image])
    with pytest.raises(InputError, match=says) as caught:
        _read(tmp_path)
    assert str(tmp_path / "img_7.png") in caught.value.message


def test_a_picture_that_is_turned_is_named_as_turned(tmp_path: Path) -> None:
    write_images(tmp_path, [*FRAMES[:2], np.zeros((64, 48), np.uint8)])
    with pytest.raises(InputError, match="turn all images the same way"):
        _read(tmp_path)


def test_a_corrupt_image_is_named(tmp_path: Path) -> None:
    paths = write_images(tmp_path, FRAMES[:6])
    whole = paths[3].read_bytes()
    for data in (b"", b"hello", whole[: len(whole) // 2], whole[:40]):
        paths[3].write_bytes(data)
        with pytest.raises(InputError) as caught:
            _read(tmp_path)
        assert str(paths[3]) in caught.value.message


def test_an_image_that_claims_an_absurd_size_is_refused(tmp_path: Path) -> None:
    (tmp_path / "1.pgm").write_bytes(b"P5 60000 60000 255\n" + bytes(100))
    with pytest.raises(InputError, match=r"impossible size|60000 x 60000"):
        open_footage(tmp_path)


def test_values_that_are_no_grey_levels_are_refused(tmp_path: Path) -> None:
    assert cv2.imwrite(str(tmp_path / "1.tiff"), np.zeros((4, 4), np.float32))
    with pytest.raises(InputError, match="float32"):
        open_footage(tmp_path)
