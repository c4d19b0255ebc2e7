"""Normal distribution of samples of which a few are outliers."""

import numpy as np

KEPT_QUANTILE, TRIMMING_ROUNDS, VARIANCE_FACTOR = 0.97, 4, 1.15
"""Trimming of the covariance: share that is kept, rounds, and factor that makes up for the removed tail."""
LEAST_VARIANCE = 1e-4
"""Variance that is added, so that constant samples have a distribution too."""


def trimmed_normal(samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean (K,) and covariance (K, K) of samples (N, K) without their outliers."""
    kept = np.ones(len(samples), bool)
    for _ in range(TRIMMING_ROUNDS):
        mean = samples[kept].mean(axis=0)
        covariance = np.cov(samples[kept].T) + LEAST_VARIANCE * np.eye(samples.shape[1])
        distance = squared_distance(samples - mean, covariance)
        kept = distance <= np.quantile(distance, KEPT_QUANTILE)
    return mean, VARIANCE_FACTOR * covariance


def squared_distance(offset: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return the squared Mahalanobis distance (...) of offsets (..., K) from a mean, for a covariance (K, K)."""
    return np.asarray(((offset @ np.linalg.inv(covariance)) * offset).sum(axis=-1))
