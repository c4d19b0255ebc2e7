"""Pictures that benchmarks and tests read."""

from pathlib import Path

import cv2
import numpy as np


def read_picture(path: Path, flags: int = cv2.IMREAD_UNCHANGED) -> np.ndarray:
    """Read a picture as OpenCV does with these flags.

    Raises:
        ValueError: it cannot be read.
    """
    picture = cv2.imread(str(path), flags)
    if picture is None:
        raise ValueError(f"{path} cannot be read as a picture")
    return np.asarray(picture)


def decode_picture(data: bytes, flags: int = cv2.IMREAD_UNCHANGED) -> np.ndarray:
    """Decode a picture as OpenCV does with these flags.

    Raises:
        ValueError: it is no picture.
    """
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    if picture is None:
        raise ValueError(f"{len(data)} bytes are no picture")
    return np.asarray(picture)
