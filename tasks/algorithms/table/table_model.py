"""The table around the object as a normal distribution of log responses, whose mean and spread vary over the picture.

Shadow and caustics of the object change the table's response smoothly around it, so mean and spread are those nearby
(normalised convolution: Knutsson and Westin 1993).
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from glint.tasks.algorithms.table.trimmed_normal import squared_distance, trimmed_normal

TABLE_NEAR_SHARE, MIN_TABLE_NEAR_PX = 0.05, 4.0
"""Standard deviation of the neighbourhood, as a share of the square root of the object's area and in pixels."""
FAR_FACTOR, MIN_FAR_PX = 4.0, 6.0
"""The same of the wider neighbourhood that is used inside the object: relative to the near one, and in pixels."""
MIN_NEIGHBOURS = 0.02
"""Share of a neighbourhood that must be table for its mean to count in full."""
MIN_SPREAD = 0.12
"""Standard deviation of the log response that the table has at least: a difference of 12% is no evidence."""
MAX_LOCAL_VARIANCE = 9.0
"""Bound of the local variance, relative to that of the whole table."""
MIN_FLASH, MIN_FLASH_SPREADS = 1.0, 5.0
"""Log ratio of a flash to the table's, and its number of standard deviations, that make a highlight."""
TABLE_FLASH_QUANTILE, MIN_FLASH_QUANTILES = 0.999, 1.6
"""Quantile of the table's log flashes, and its multiple that makes a highlight where it is less: where a near light or
the codec leaves a part of the table without any change, flashes spread, but none of the table's is large."""
AREA_SIGMA_PX = 3.0
"""Standard deviation of the blur, in pixels, by which an area that flashes stands out."""
MAX_FALSE_SHARE, MIN_PIXEL_SHARE = 0.05, 0.2
"""Share of what flashes that may be the table, and share of it that single pixels must show for areas not to count."""
LIMIT_STEP = 0.05
"""Step, in log ratios, in which a limit is looked for."""


@dataclass(frozen=True, slots=True)
class TableModel:
    """The table's log responses, deviation and flash, as a normal distribution.

    mean: (H, W, 2), expected log responses.
    covariance: (2, 2), of the whole table.
    variance: (H, W, 2), local variance relative to that.
    flash_limit, area_limit: log ratios of a flash to the table's that make a highlight of a pixel, and of an area
        around it; the latter is infinite where single pixels tell the object from the table.
    """

    mean: np.ndarray
    covariance: np.ndarray
    variance: np.ndarray
    flash_limit: float
    area_limit: float

    def within(self, window: tuple[slice, slice]) -> "TableModel":
        """Return the model in a window of the picture."""
        return replace(self, mean=self.mean[window], variance=self.variance[window])

    def distance(self, features: np.ndarray) -> np.ndarray:
        """Return the squared Mahalanobis distance (H, W) of log responses (H, W, 2) from the table."""
        offset = (features - self.mean) / np.sqrt(self.variance)
        return squared_distance(offset, self.covariance)

    def flashing(self, features: np.ndarray) -> np.ndarray:
        """Return the pixels (H, W) bool that show highlights."""
        excess = features[..., 1] - self.mean[..., 1]
        pixels = np.asarray(excess > self.flash_limit)
        return pixels if np.isinf(self.area_limit) else pixels | (_of_areas(excess) > self.area_limit)


def fit_table(features: np.ndarray, is_table: np.ndarray, root_area: float | None) -> TableModel:
    """Fit the table's log responses.

    Args:
        features: (H, W, 2) float32, log responses.
        is_table: (H, W) bool, pixels of the table.
        root_area: square root of the object's area, pixels; None: unknown, so one mean holds everywhere.
    """
    mean, covariance = trimmed_normal(features[is_table])
    if root_area is None:
        means, variance = np.broadcast_to(mean, features.shape), np.ones(features.shape, np.float32)
        return _with_limits(features, is_table, means, covariance, variance)
    sigma = max(MIN_TABLE_NEAR_PX, TABLE_NEAR_SHARE * root_area)
    weight = is_table.astype(np.float32)
    wide, wide_trust = _local_mean(features, weight, max(MIN_FAR_PX, FAR_FACTOR * sigma))
    near, near_trust = _local_mean(features, weight, sigma)
    wide = wide_trust * wide + (1.0 - wide_trust) * mean
    means = near_trust * near + (1.0 - near_trust) * wide
    offsets = features - means
    covariance = trimmed_normal(offsets[is_table])[1]
    square, _ = _local_mean(offsets**2, weight, sigma)
    variance = (near_trust * square / np.diag(covariance) + (1.0 - near_trust)).clip(1.0, MAX_LOCAL_VARIANCE)
    return _with_limits(features, is_table, means, covariance, variance)


def _with_limits(
    features: np.ndarray, is_table: np.ndarray, means: np.ndarray, covariance: np.ndarray, variance: np.ndarray
) -> TableModel:
    """Return the table's model with the limits of highlights, and with the least spread.

    Where the table flashes nearly as strongly as the object (under shadows' edges and caustics of a light nearby), few
    single pixels exceed what its spread allows. But in the object flashes lie side by side.
    """
    covariance = covariance + MIN_SPREAD**2 * np.eye(2)
    excess = features[..., 1] - means[..., 1]
    spread = MIN_FLASH_SPREADS * float(np.sqrt(covariance[1, 1]))
    quantile = MIN_FLASH_QUANTILES * float(np.quantile(excess[is_table], TABLE_FLASH_QUANTILE))
    flash_limit = max(MIN_FLASH, min(spread, quantile))
    stands_out = excess > _least_limit(excess, is_table)
    is_shown = (excess > flash_limit).sum() >= MIN_PIXEL_SHARE * stands_out.sum()
    area_limit = np.inf if is_shown else _least_limit(_of_areas(excess), is_table)
    return TableModel(means, covariance, variance, flash_limit, area_limit)


def _least_limit(excess: np.ndarray, is_table: np.ndarray) -> float:
    """Return the least limit beyond which hardly any excess (H, W) is the table's, infinite where there is none.

    The table's sample, is_table (H, W) bool, shows how much of it lies beyond a limit (the false discovery rate by
    decoys of Elias and Gygi 2007).
    """
    limits = np.arange(MIN_FLASH, max(float(excess.max()), MIN_FLASH), LIMIT_STEP)
    table, everything = np.sort(excess[is_table]), np.sort(excess, axis=None)
    table_share = 1.0 - np.searchsorted(table, limits) / len(table)
    share = 1.0 - np.searchsorted(everything, limits) / len(everything)
    refused = np.flatnonzero(table_share > MAX_FALSE_SHARE * share)
    kept = limits[refused[-1] + 1 :] if len(refused) else limits
    return float(kept[0]) if len(kept) else np.inf


def _of_areas(excess: np.ndarray) -> np.ndarray:
    """Return the mean excess (H, W) of the area around each pixel."""
    return np.asarray(cv2.GaussianBlur(np.ascontiguousarray(excess), (0, 0), AREA_SIGMA_PX))


def _local_mean(values: np.ndarray, weight: np.ndarray, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the weighted local mean (H, W, 2) of values, and how far it can be trusted (H, W, 1), 0 to 1."""
    total = cv2.GaussianBlur(weight, (0, 0), sigma)
    channels = [np.ascontiguousarray(channel) for channel in np.moveaxis(values, -1, 0)]
    sums = [cv2.GaussianBlur(channel * weight, (0, 0), sigma) for channel in channels]
    mean = np.stack(sums, axis=-1) / np.maximum(total, 1e-6)[..., None]
    return mean, np.clip(total / MIN_NEIGHBOURS, 0.0, 1.0)[..., None]
