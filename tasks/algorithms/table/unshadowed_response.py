"""Table response to the lights that reach a pixel past the object, under which the table has no shadow and no caustics.

Under all lights together the table that an object shadows follows the light as little as glass does. Under those on its
own side of the object it is the bare table again, while glass still flashes there.
"""

from dataclasses import replace

import numpy as np

from glint.tasks.algorithms.table.light_sectors import LIGHT_SECTORS, passing_sectors
from glint.tasks.algorithms.table.table_response import LargestFlashes, TableResponse, brightness

DAMPING = 1e-6
"""Share of the mean square of the table's time series that is added where few frames leave amplitudes open."""


def unshadowed_response(
    response: TableResponse, frames: np.ndarray, sectors: np.ndarray, mask: np.ndarray
) -> TableResponse:
    """Return the response with deviation and flash of the frames alone whose lights reach a pixel past a mask.

    Args:
        response: of all frames.
        frames: (T, H, W) uint8.
        sectors: (T,) int, of the light, see `light_sectors`; frames of -1 are left out.
        mask: (H, W) bool, the object and what may be its shadow.
    """
    series = frames.reshape(len(frames), -1)
    passing = passing_sectors(mask, np.bincount(sectors[sectors >= 0], minlength=LIGHT_SECTORS))
    amplitudes = _amplitudes(response.basis, series, sectors, passing.reshape(LIGHT_SECTORS, -1))
    square, count = np.zeros(mask.shape, np.float32), np.zeros(mask.shape, np.float32)
    flashes = LargestFlashes(mask.shape)
    for number in np.flatnonzero(sectors >= 0):
        residual = (series[number].astype(np.float32) - amplitudes @ response.basis[number]).reshape(mask.shape)
        is_reached = passing[sectors[number]]
        square += np.where(is_reached, residual * residual, 0.0)
        count += is_reached
        flashes.add(residual, int(number), is_reached)
    level = brightness(amplitudes[:, 0].reshape(mask.shape), response.basis)
    return replace(
        response,
        deviation=response.noise.log_ratio(np.sqrt(square / np.maximum(count, 1.0)), level),
        flash=response.flash_noise.log_ratio(flashes.second, level),
        moment=flashes.moment,
    )


def _amplitudes(basis: np.ndarray, series: np.ndarray, sectors: np.ndarray, passing: np.ndarray) -> np.ndarray:
    """Return the amplitudes (N, k) float32 of the table's time series (T, k) in pixels' series (T, N) uint8.

    Least squares over the frames of the sectors (T,) that reach a pixel: passing (LIGHT_SECTORS, N) bool.
    """
    size, pixels = basis.shape[1], series.shape[1]
    gram = np.tile(DAMPING * float((basis**2).sum()) / size * np.eye(size), (pixels, 1, 1))
    product = np.zeros((pixels, size))
    for sector in np.unique(sectors[sectors >= 0]):
        shown, is_reached = basis[sectors == sector].astype(float), passing[sector]
        gram[is_reached] += shown.T @ shown
        product[is_reached] += series[sectors == sector][:, is_reached].T @ shown
    return np.linalg.solve(gram, product[..., None])[..., 0].astype(np.float32)
