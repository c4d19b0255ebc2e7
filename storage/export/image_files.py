"""Arrays as picture files that other programs read: 16-bit PNG, OpenEXR, float TIFF, 8-bit PNG.

Arrays are (H, W) or (H, W, 3) with row 0 at the top; vectors become colours in the order x = red, y = green, z = blue.
"""

from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import tifffile

from glint.storage.errors import StoreError


def encode_normals(normals: np.ndarray) -> np.ndarray:
    """Unit normals (H, W, 3) as uint16 (H, W, 3): round((n + 1) / 2 * 65535), 0 where a component is not finite."""
    outside = ~np.isfinite(normals).all(axis=-1)
    scaled = np.rint((np.where(outside[..., None], -1.0, normals).astype(np.float64) + 1.0) * 32767.5)
    return np.clip(scaled, 0, 65535).astype(np.uint16)


def decode_normals(picture: np.ndarray) -> np.ndarray:
    """Unit normals (H, W, 3) float32 from their uint16 picture, NaN where all three channels are 0."""
    normals = picture.astype(np.float32) / 32767.5 - 1.0
    normals[~picture.any(axis=-1)] = np.nan
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def write_png(path: Path, picture: np.ndarray) -> None:
    """Lossless PNG of uint8 or uint16, grey (H, W) or RGB (H, W, 3); booleans become 0 and 255.

    Raises:
        StoreError: the file cannot be written.
        ValueError: another type or shape.
    """
    path.write_bytes(encode_png(picture))


def encode_png(picture: np.ndarray) -> bytes:
    """The PNG file's bytes of what `write_png` takes."""
    if picture.dtype == bool:
        picture = picture.astype(np.uint8) * 255
    if picture.dtype not in (np.uint8, np.uint16) or picture.ndim not in (2, 3) or picture.shape[2:] not in ((), (3,)):
        raise ValueError(f"no PNG holds {picture.dtype} of shape {picture.shape}")
    done, data = cv2.imencode(".png", picture if picture.ndim == 2 else picture[..., ::-1])
    if not done:
        raise StoreError(f"a picture of shape {picture.shape} could not be encoded", "give a picture that is not empty")
    return data.tobytes()


def read_png(path: Path) -> np.ndarray:
    """A PNG as it is: uint8 or uint16, (H, W) or RGB (H, W, 3).

    Raises:
        StoreError: not a picture.
    """
    picture = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    if picture is None:
        raise StoreError(f"{path} is not a picture", "export it again")
    return picture if picture.ndim == 2 else np.ascontiguousarray(picture[..., :3][..., ::-1])


def write_exr(path: Path, picture: np.ndarray) -> None:
    """OpenEXR of 32-bit floats, lossless: channels R, G, B of (H, W, 3), or Y of (H, W). NaN is kept."""
    picture = np.ascontiguousarray(picture, np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB" if picture.ndim == 3 else "Y": picture}) as file:
        file.write(str(path))


def read_exr(path: Path) -> np.ndarray:
    """Pixels of what `write_exr` wrote, float32."""
    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        return np.array(channels["RGB" if "RGB" in channels else "Y"].pixels)


def write_tiff(path: Path, picture: np.ndarray) -> None:
    """Uncompressed TIFF of one 32-bit float channel (H, W). NaN is kept."""
    tifffile.imwrite(path, np.asarray(picture, np.float32), photometric="minisblack")


def colour_normals(normals: np.ndarray, background: int = 255) -> np.ndarray:
    """Normals (H, W, 3) as people know them, uint8 RGB, with a plain background where there are none."""
    known = np.isfinite(normals).all(axis=-1)
    colours = np.rint((np.where(known[..., None], normals, 0.0) + 1.0) * 127.5).astype(np.uint8)
    return np.where(known[..., None], colours, np.uint8(background))


def colour_codes(codes: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """Codes (H, W) uint8 as uint8 RGB by `palette` (N, 3); codes beyond it take its last colour."""
    return palette[np.minimum(codes, len(palette) - 1)].astype(np.uint8)


def colour_values(values: np.ndarray, low: float, high: float, background: int = 255) -> np.ndarray:
    """Values (H, W) from `low` to `high` as uint8 RGB from dark blue to yellow; `background` where not finite."""
    known = np.isfinite(values)
    scaled = np.clip((np.where(known, values, low) - low) / max(high - low, 1e-12), 0, 1)
    colours = cv2.applyColorMap(np.rint(scaled * 255).astype(np.uint8), cv2.COLORMAP_CIVIDIS)[..., ::-1]
    return np.where(known[..., None], colours, np.uint8(background))
