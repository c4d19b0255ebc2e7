"""Read a set of images as footage: 8 or 16 bits, grey or colour, all of the same size."""

import io
import warnings
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from glint.storage.errors import InputError
from glint.storage.locations.input_files import read_bytes
from glint.storage.locations.location import Location

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".ppm", ".webp", ".jp2")
UNDEVELOPED = frozenset((".cr2", ".cr3", ".nef", ".arw", ".dng", ".orf", ".rw2", ".raf", ".pef", ".heic", ".heif"))
"""Suffixes of cameras' own formats, which are not read."""
HEIC_REMEDY = "convert all to 16-bit TIFF or PNG, or set the phone to store JPEG"
_HEIC_BRANDS = frozenset((b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1"))
_HEIC_HEAD_BYTES = 12
MAX_PIXELS = 170_000_000
"""Largest frame that is decoded; the header of a file of a few kilobytes can state far more (decompression bomb)."""
MAX_IMAGE_BYTES = 2_000_000_000
"""Size of the largest image that is read, as a frame or a mask."""
_HALF_OPAQUE = 128
"""Level of an 8-bit alpha channel from which a pixel belongs to a cut-out: the middle of an antialiased edge."""
_LOSSY = frozenset(("JPEG", "MPO", "WEBP", "JPEG2000"))
"""Formats that do not always keep the levels of a mask."""
_BLOCK_PX = 16
"""Distance from a contour within which they change levels: the largest block of a JPEG with reduced colours."""
_FLAT_SHARE = 0.1
"""Share of the paint's level by which a level away from the contour may differ from black or white."""
_MIN_WHITE = 32
"""Highest level below which a lossy mask is black."""
# What is wrong with an image is said once, by an error.
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
warnings.filterwarnings("ignore", category=Image.DecompressionBombWarning)
_READ_AHEAD = 4
_N_READERS = 2


def decode_image(data: bytes, name: str, colour: bool = False) -> np.ndarray:
    """Decode an image, uint8 or uint16: (H, W) grey, or (H, W, 3) blue-green-red with `colour`.

    Raises:
        InputError: no image, too large, or of another depth.
    """
    image_size(data, name)
    flags = (cv2.IMREAD_COLOR if colour else cv2.IMREAD_GRAYSCALE) | cv2.IMREAD_ANYDEPTH
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise InputError(f"{name} cannot be decoded", "replace the image") from error
    if pixels is None:
        raise InputError(f"{name} is no image that can be read, or is truncated", "replace the image")
    if pixels.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{name} has pixels of type {pixels.dtype}", "save it with 8 or 16 bits")
    return pixels


def decode_mask(data: bytes, name: str) -> np.ndarray:
    """Decode an image as a mask, bool (H, W): true where a pixel is not black, and not transparent.

    In a cut-out, the object's own colours on a transparent ground, black pixels count too. Lossy formats leave grey
    levels beside the contour of a black and white mask: there, true is what is brighter than the middle.

    Raises:
        InputError: no image, too large, of another depth, or in a lossy format with grey levels away from the contour.
    """
    pixels = decode_image(data, name, colour=True)
    is_painted = pixels.any(axis=2)
    is_opaque = _opaque(data)
    if is_opaque is None or is_opaque.shape != is_painted.shape or is_opaque.all():
        form = _format(data)
        return _brighter_half(pixels.max(axis=2), name, form) if form in _LOSSY else is_painted
    with Image.open(io.BytesIO(data)) as image:
        levels = np.asarray(image.convert("L"))[is_opaque]
    is_black_and_white = levels.size > 0 and {int(levels.min()), int(levels.max())} == {0, 255}
    is_black_and_white = is_black_and_white and bool(np.isin(levels, (0, 255)).all())
    return is_opaque & is_painted if is_black_and_white else is_opaque


def _brighter_half(levels: np.ndarray, name: str, form: str) -> np.ndarray:
    """Return where levels (H, W) of a lossy mask are above their middle, bool (H, W).

    Raises:
        InputError: away from the contour there are other levels than black and white.
    """
    # Beside the contour levels exceed those of the paint.
    white = np.float32(np.median(levels[levels > 0.5 * levels.max()] if levels.any() else 0))
    if white < _MIN_WHITE:
        return np.zeros(levels.shape, bool)
    is_bright = (levels > 0.5 * white).astype(np.uint8)
    block = np.ones((2 * _BLOCK_PX + 1,) * 2, np.uint8)
    is_flat = cv2.dilate(is_bright, block) == cv2.erode(is_bright, block)
    is_grey = is_flat & (np.abs(levels - white * is_bright) > _FLAT_SHARE * white)
    if is_grey.any():
        row, column = np.argwhere(is_grey)[0]
        raise InputError(
            f"the mask {name} is a {form} with the level {levels[row, column]} at x {column}, y {row}, neither black"
            " nor white: it is not clear which pixels are the object",
            "save it as PNG, the object white on black",
        )
    return is_bright.astype(bool)


def _format(data: bytes) -> str:
    """Return the name of an image's format, such as JPEG; empty if it is not known."""
    try:
        with Image.open(io.BytesIO(data)) as image:
            return image.format or ""
    except (OSError, ValueError, SyntaxError):
        return ""


def _opaque(data: bytes) -> np.ndarray | None:
    """Return where an image is at least half opaque, bool (H, W); None if it has no transparency."""
    try:
        with Image.open(io.BytesIO(data)) as image:
            if not image.has_transparency_data:
                return None
            return np.asarray(image.convert("RGBA").getchannel("A")) >= _HALF_OPAQUE
    except (OSError, ValueError, SyntaxError):
        return None


def check_image_head(file: Location) -> None:
    """Refuse a local file whose head is not that of an image.

    Raises:
        InputError: no image, or too large.
    """
    if file.local is not None:
        image_size(file.local, file.uri)


def image_size(source: bytes | Path, name: str) -> tuple[int, int]:
    """Return the size (rows, columns) that an image's head states; source: its bytes, or its path.

    Raises:
        InputError: no image, or too large.
    """
    try:
        with Image.open(source if isinstance(source, Path) else io.BytesIO(source)) as image:
            width, height = image.size
    except Image.DecompressionBombError as error:
        raise InputError(f"{name} states an impossible size", f"at most {MAX_PIXELS:,} pixels are read") from error
    except (OSError, ValueError, SyntaxError) as error:
        if _is_heic(source):
            raise InputError(f"{name} is a HEIC picture, which is not read", HEIC_REMEDY) from error
        remedy = "replace the image: PNG, JPEG and TIFF of 8 or 16 bits are read"
        raise InputError(f"{name} is no image that can be read", remedy) from error
    if width * height > MAX_PIXELS:
        raise InputError(f"{name} states {width} x {height} pixels", f"at most {MAX_PIXELS:,} pixels are read")
    return height, width


def _is_heic(source: bytes | Path) -> bool:
    """Return whether a file is a picture as phones store them, whatever its name."""
    head = b""
    if isinstance(source, bytes):
        head = source[:_HEIC_HEAD_BYTES]
    else:
        with suppress(OSError), source.open("rb") as file:
            head = file.read(_HEIC_HEAD_BYTES)
    return head[4:8] == b"ftyp" and head[8:12] in _HEIC_BRANDS


class ImageSet:
    """Footage of images; see `Footage`."""

    codec = "images"

    def __init__(self, uri: str, files: Sequence[Location], warnings: Sequence[str] = ()) -> None:
        """Read the first image; `warnings`: of what was left out."""
        self.uri, self.files = uri, tuple(files)
        self.names = tuple(file.name for file in self.files)
        self.count = len(self.files)
        self.warnings = list(warnings)
        first = self._read(self.files[0])
        self.height, self.width = first.shape
        self.bits = 8 * first.itemsize

    def __enter__(self) -> "ImageSet":
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Do nothing: no file stays open between frames."""

    def frames(self, start: int = 0, step: int = 1) -> Iterator[np.ndarray]:
        """Yield luma (H, W) of frames start, start + step, ..

        Raises:
            InputError: an image cannot be read, or differs in size or depth from the first.
        """
        chosen = iter(self.files[start::step])
        with ThreadPoolExecutor(_N_READERS) as pool:
            pending: deque[Future[np.ndarray]] = deque(
                pool.submit(self._read_checked, file) for file in islice(chosen, _READ_AHEAD)
            )
            while pending:
                frame = pending.popleft().result()
                pending.extend(pool.submit(self._read_checked, file) for file in islice(chosen, 1))
                yield frame

    def spread(self, count: int) -> list[np.ndarray]:
        """Return about `count` images spread over the set, luma (H, W), the first one first."""
        return list(self.frames(step=max(1, self.count // count)))

    def _read_checked(self, file: Location) -> np.ndarray:
        frame = self._read(file)
        if frame.shape != (self.height, self.width):
            remedy = "all images of a capture must have the same size; give a pattern if the folder holds other images"
            if frame.shape == (self.width, self.height):
                remedy = "turn all images the same way: some are upright, others not, perhaps by their EXIF orientation"
            raise InputError(
                f"{file.uri} is {frame.shape[1]} x {frame.shape[0]}, the first image {self.width} x {self.height}",
                remedy,
            )
        if 8 * frame.itemsize != self.bits:
            raise InputError(
                f"{file.uri} has {8 * frame.itemsize} bits, the first image {self.bits}", "save all with the same depth"
            )
        return frame

    def _read(self, file: Location) -> np.ndarray:
        return decode_image(read_bytes(file, MAX_IMAGE_BYTES), file.uri)
