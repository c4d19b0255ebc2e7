"""Image files of arrays: 8-bit and 16-bit PNG, OpenEXR, float TIFF; colour images of normals, codes and values.

Arrays are (H, W) or (H, W, 3) with row 0 at the top; vectors become colours in the order x = red, y = green, z = blue.
"""

from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import tifffile

from glint.storage.errors import OutputError, StoreError

PROVENANCE_PALETTE = np.array(
    [(255, 255, 255), (46, 125, 82), (216, 120, 24), (108, 92, 176), (168, 176, 186), (190, 60, 70), (60, 130, 190)],
    np.uint8,
)
"""Colours (uint8 RGB) of the provenance codes, in order."""


def encode_normals(normals: np.ndarray) -> np.ndarray:
    """Encode unit normals (H, W, 3) as uint16: round((n + 1) / 2 * 65535), 0 where a component is not finite."""
    is_undefined = ~np.isfinite(normals).all(axis=-1)
    scaled = np.rint((np.where(is_undefined[..., None], -1.0, normals).astype(np.float64) + 1.0) * 32767.5)
    return np.clip(scaled, 0, 65535).astype(np.uint16)


def write_png(path: Path, image: np.ndarray) -> None:
    """Write a lossless PNG; see `encode_png`.

    Raises:
        StoreError: the image is empty.
        ValueError: another dtype or shape.
        OSError: the file cannot be written.
    """
    path.write_bytes(encode_png(image))


def write_pictures(folder: Path, pictures: Mapping[str, np.ndarray]) -> tuple[Path, ...]:
    """Write pictures as PNG by name, without suffix, into a folder that is created if absent; return their paths.

    Raises:
        OutputError: the folder cannot be written.
    """
    paths = tuple(folder / f"{name}.png" for name in pictures)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path, picture in zip(paths, pictures.values(), strict=True):
            write_png(path, picture)
    except OSError as error:
        raise OutputError(f"{folder} cannot be written ({error.strerror})", "name another folder with --out") from error
    return paths


def encode_png(image: np.ndarray) -> bytes:
    """Encode uint8 or uint16, grey (H, W) or RGB (H, W, 3), as PNG; booleans become 0 and 255.

    Raises:
        StoreError: the image is empty.
        ValueError: another dtype or shape.
    """
    if image.dtype == bool:
        image = image.astype(np.uint8) * 255
    if image.dtype not in (np.uint8, np.uint16) or image.ndim not in (2, 3) or image.shape[2:] not in ((), (3,)):
        raise ValueError(f"no PNG holds {image.dtype} of shape {image.shape}")
    is_encoded, data = cv2.imencode(".png", image if image.ndim == 2 else image[..., ::-1])
    if not is_encoded:
        raise StoreError(f"an image of shape {image.shape} cannot be encoded", "give an image that is not empty")
    return data.tobytes()


def write_exr(path: Path, image: np.ndarray) -> None:
    """Write lossless OpenEXR of 32-bit floats: channels R, G, B of (H, W, 3), or Y of (H, W). NaN is kept."""
    image = np.ascontiguousarray(image, np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB" if image.ndim == 3 else "Y": image}) as file:
        file.write(str(path))


def write_tiff(path: Path, image: np.ndarray) -> None:
    """Write an uncompressed TIFF of one 32-bit float channel (H, W). NaN is kept."""
    tifffile.imwrite(path, np.asarray(image, np.float32), photometric="minisblack")


def colour_normals(normals: np.ndarray, background: int = 255) -> np.ndarray:
    """Return the usual colour image of normals (H, W, 3), uint8 RGB, with `background` where they are not finite."""
    is_known = np.isfinite(normals).all(axis=-1)
    colours = np.rint((np.where(is_known[..., None], normals, 0.0) + 1.0) * 127.5).astype(np.uint8)
    return np.where(is_known[..., None], colours, np.uint8(background))


def colour_codes(codes: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """Return codes (H, W) uint8 as uint8 RGB by `palette` (N, 3); codes beyond it take its last colour."""
    return palette[np.minimum(codes, len(palette) - 1)].astype(np.uint8)


def colour_values(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return values (H, W) from `low` to `high` as uint8 RGB, dark blue to yellow; white where not finite."""
    is_known = np.isfinite(values)
    scaled = np.clip((np.where(is_known, values, low) - low) / max(high - low, 1e-12), 0, 1)
    colours = cv2.applyColorMap(np.rint(scaled * 255).astype(np.uint8), cv2.COLORMAP_CIVIDIS)[..., ::-1]
    return np.where(is_known[..., None], colours, np.uint8(255))
