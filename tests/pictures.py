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
