"""Table response: how a pixel follows the moving light, against how the table does.

The table is matte: under a moving light all its pixels brighten and darken together, in proportion to their own
reflectance, up to a smooth change over the picture. A few time series span that (their principal components along the
frame's border; low-dimensional illumination of matte surfaces: Basri and Jacobs 2003). Glass does not follow them:
highlights flash for a few frames, and what it refracts and reflects is lit otherwise.
"""

from dataclasses import dataclass, replace

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
LEAST_RESIDUAL, LEAST_FLASH = 0.2, 0.5
"""Levels below which residuals and flashes count as that large: rounding hides smaller ones."""
FLASH_SIGMA_PX = 3.0
"""Standard deviation of the blur against which a flash stands out: wider than a highlight, narrower than a shadow."""


@dataclass(frozen=True, slots=True)
class TableNoise:
    """Noise of the table: the expected square of its residuals is constant + share * brightness^2.

    constant: in square levels. share: without unit. least: levels, below which a residual counts as that large.
    """

    constant: float
    share: float
    least: float

    @classmethod
    def of(cls, values: np.ndarray, level: np.ndarray, border: np.ndarray, least: float) -> "TableNoise":
        """Fit the residuals `values` (H, W) of the table's pixels, border (H, W) bool, to its brightness (H, W)."""
        terms = np.column_stack([np.ones(int(border.sum())), level[border] ** 2])
        (constant, share), _ = optimize.nnls(terms, values[border].astype(float) ** 2)
        return cls(float(constant), float(share), least)

    def log_ratio(self, values: np.ndarray, level: np.ndarray) -> np.ndarray:
        """Return the log ratio (...) float32 of residuals (...) to those of the table at the same brightness (...)."""
        expected = np.sqrt(np.maximum(self.constant + self.share * level**2, 1e-3))
        return np.asarray(np.log(np.maximum(values, self.least) / expected), np.float32)


class LargestFlashes:
    """The largest flashes of pixels so far.

    second: (H, W) float32, the second largest, levels, since a single noisy frame does not count. moment: (H, W) int32,
    number of the frame with the largest.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        """Begin with no flash, in a picture of a shape (H, W)."""
        self._largest = np.zeros(shape, np.float32)
        self.second, self.moment = np.zeros(shape, np.float32), np.zeros(shape, np.int32)

    def add(self, residual: np.ndarray, number: int, used: np.ndarray | bool = True) -> None:
        """Add the residual (H, W) float32 of a numbered frame, at the pixels `used` (H, W) bool."""
        flash = np.where(used, residual - cv2.GaussianBlur(residual, (0, 0), FLASH_SIGMA_PX), 0.0)
        np.maximum(self.second, np.minimum(self._largest, flash), out=self.second)
        self.moment[flash > self._largest] = number
        np.maximum(self._largest, flash, out=self._largest)


@dataclass(frozen=True, slots=True)
class TableResponse:
    """Deviation of pixels' time series from the table's.

    deviation: (H, W), log ratio of the RMS residual to that of the table at the same brightness. flash: (H, W), log
    ratio of the second largest flash to the table's. moment: (H, W) int, number of the frame with the largest flash.
    background: (H, W) temporal median, 0 to 255. border: (H, W) bool, pixels that are taken as the table. basis:
    (T, k) float32, orthonormal time series of the table. noise, flash_noise: of its residuals and flashes.
    """

    deviation: np.ndarray
    flash: np.ndarray
    moment: np.ndarray
    background: np.ndarray
    border: np.ndarray
    basis: np.ndarray
    noise: TableNoise
    flash_noise: TableNoise

    def within(self, window: tuple[slice, slice], is_table: np.ndarray) -> "TableResponse":
        """Return the response in a window of the picture, whose table are the pixels (H, W) bool of the picture."""
        return replace(
            self,
            deviation=self.deviation[window],
            flash=self.flash[window],
            moment=self.moment[window],
            background=self.background[window],
            border=is_table[window],
        )


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
    flashes = LargestFlashes((height, width))
    for block in blocks:
        residuals = flat[block].astype(np.float32) - basis[block] @ amplitudes
        for number, residual in enumerate(residuals.reshape(-1, height, width), block.start):
            square += residual * residual
            flashes.add(residual, number)
    level = brightness(amplitudes[0].reshape(height, width), basis)
    residual = np.sqrt(square / count)
    noise = TableNoise.of(residual, level, border, LEAST_RESIDUAL)
    flash_noise = TableNoise.of(flashes.second, level, border, LEAST_FLASH)
    return TableResponse(
        noise.log_ratio(residual, level),
        flash_noise.log_ratio(flashes.second, level),
        flashes.moment,
        _median(frames),
        border,
        basis,
        noise,
        flash_noise,
    )


def brightness(amplitudes: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """Return the brightness (...) of pixels, levels, by their amplitudes (...) of the first time series of (T, k)."""
    return np.asarray(np.abs(amplitudes) * float(np.abs(basis[:, 0]).mean()))


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


def _median(frames: np.ndarray) -> np.ndarray:
    """Return the temporal median (H, W) float32, the lower of two, computed by rows to bound memory."""
    middle = (len(frames) - 1) // 2
    rows = [np.partition(frames[:, row], middle, axis=0)[middle] for row in range(frames.shape[1])]
    return np.stack(rows).astype(np.float32)
