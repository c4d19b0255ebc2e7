"""Readers of the files that exports write, for tests."""

from pathlib import Path

import cv2
import numpy as np
import OpenEXR


def decode_normals(image: np.ndarray) -> np.ndarray:
    """Return unit normals (H, W, 3) float32 from their uint16 image, NaN where all three channels are 0."""
    normals = image.astype(np.float32) / 32767.5 - 1.0
    normals[~image.any(axis=-1)] = np.nan
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def read_png(path: Path) -> np.ndarray:
    """Return a PNG as it is: uint8 or uint16, (H, W) or RGB (H, W, 3)."""
    image = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    assert image is not None, f"{path} is not an image"
    return image if image.ndim == 2 else np.ascontiguousarray(image[..., :3][..., ::-1])


def read_exr(path: Path) -> np.ndarray:
    """Return the pixels of an OpenEXR file, float32, (H, W) or (H, W, 3)."""
    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        return np.array(channels["RGB" if "RGB" in channels else "Y"].pixels)
