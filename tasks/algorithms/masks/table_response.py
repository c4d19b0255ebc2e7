"""Table response: how a pixel follows the moving light, against how the table does.

The table is matt: under a moving light all its pixels brighten and darken together, in proportion to their own
reflectance, up to a smooth change over the picture. A few time series span that (their principal components along the
frame's border; low-dimensional illumination of matt surfaces: Basri and Jacobs 2003). Glass does not follow them:
highlights flash for a few frames, and what it refracts and reflects is lit otherwise.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy import optimize

COMPONENTS = 3
"""Principal components of the table's time series: an even change, and a gradient across the picture."""
BORDER_SHARE, MIN_BORDER_PX = 0.06, 4
"""Width of the frame's border that shows the table, as a share of its shorter edge and in pixels."""
BORDER_SAMPLES = 1500
"""Pixels of the border whose time series are decomposed."""
FRAMES_PER_BLOCK = 16
"""Frames that are held as floating-point numbers at once."""
FLASH_SIGMA_PX = 3.0
"""Standard deviation of the blur against which a flash stands out: wider than a highlight, narrower than a shadow."""


@dataclass(frozen=True, slots=True)
class TableResponse:
    """Deviation of N pixels' time series from the table's.

    deviation: (H, W), log ratio of the RMS residual to that of the table at the same brightness. flash: (H, W), log
    ratio of the second largest flash to the table's. moment: (H, W) int, number of the frame with the largest flash.
    background: (H, W) temporal median, 0 to 255. border: (H, W) bool, pixels that were taken as the table.
    """

    deviation: np.ndarray
    flash: np.ndarray
    moment: np.ndarray
    background: np.ndarray
    border: np.ndarray


def table_response(frames: np.ndarray, free: np.ndarray) -> TableResponse:
    """Compute the deviation of every pixel of the frames (T, H, W) uint8 from the table's response.

    free: (H, W) bool, pixels beside the spheres.
    """
    count, height, width = frames.shape
    border = _border((height, width)) & free
    basis = _border_basis(frames, border)
    blocks = [slice(start, start + FRAMES_PER_BLOCK) for start in range(0, count, FRAMES_PER_BLOCK)]
    flat = frames.reshape(count, -1)
    amplitudes = np.zeros((basis.shape[1], flat.shape[1]), np.float32)
    for block in blocks:
        amplitudes += basis[block].T @ flat[block].astype(np.float32)
    square = np.zeros((height, width), np.float32)
    largest, second, moment = np.zeros_like(square), np.zeros_like(square), np.zeros((height, width), np.int32)
    for block in blocks:
        residuals = flat[block].astype(np.float32) - basis[block] @ amplitudes
        for number, residual in enumerate(residuals.reshape(-1, height, width), block.start):
            square += residual * residual
            flash = residual - cv2.GaussianBlur(residual, (0, 0), FLASH_SIGMA_PX)
            # The second largest: a single noisy frame does not count.
            np.maximum(second, np.minimum(largest, flash), out=second)
            moment[flash > largest] = number
            np.maximum(largest, flash, out=largest)
    level = np.abs(amplitudes[0].reshape(height, width)) * float(np.abs(basis[:, 0]).mean())
    residual = np.sqrt(square / count)
    return TableResponse(
        np.log(np.maximum(residual, 0.2) / _expected(residual, level, border)),
        np.log(np.maximum(second, 0.5) / _expected(second, level, border)),
        moment,
        _median(frames),
        border,
    )


def _border(shape: tuple[int, int]) -> np.ndarray:
    width = max(MIN_BORDER_PX, round(BORDER_SHARE * min(shape)))
    border = np.ones(shape, bool)
    border[width:-width, width:-width] = False
    return border


def _border_basis(frames: np.ndarray, border: np.ndarray) -> np.ndarray:
    """Return orthonormal time series (T, k) float32 that span those of the border's pixels."""
    rows, columns = np.nonzero(border)
    step = max(1, len(rows) // BORDER_SAMPLES)
    series = frames[:, rows[::step], columns[::step]].astype(np.float32)
    vectors = np.linalg.svd(series / (series.mean(axis=0) + 1.0), full_matrices=False)[0]
    return np.asarray(vectors[:, : max(1, min(COMPONENTS, len(frames) // 4))], np.float32)


def _expected(values: np.ndarray, level: np.ndarray, border: np.ndarray) -> np.ndarray:
    """Return the table's RMS of `values` (H, W) at each pixel's brightness: noise, and a share of the brightness."""
    terms = np.column_stack([np.ones(int(border.sum())), level[border] ** 2])
    (noise, share), _ = optimize.nnls(terms, values[border].astype(float) ** 2)
    return np.asarray(np.sqrt(np.maximum(noise + share * level**2, 1e-3)), np.float32)


def _median(frames: np.ndarray) -> np.ndarray:
    """Return the temporal median (H, W) float32, the lower of two, computed by rows to bound memory."""
    middle = (len(frames) - 1) // 2
    rows = [np.partition(frames[:, row], middle, axis=0)[middle] for row in range(frames.shape[1])]
    return np.stack(rows).astype(np.float32)
