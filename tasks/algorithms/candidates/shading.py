"""Highlights or shading: candidates that reflect the light, and those of a surface that scatters it.

Judged by the level that a pixel keeps when the light moves on (`surround`), a property of the surface alone: no
threshold can tell the two apart, since every object is brightest somewhere.
"""

from dataclasses import replace

import numpy as np

from glint.tasks.algorithms.candidates.clusters import Clusters

MAX_SHADING = 0.25
"""Shading above which a candidate is no highlight: glass and chrome have less, lobes broader than 6 degrees more."""

TRUE_MEAN, FALSE_MEAN = 0.08, 0.19
"""Mean shading of true highlights, and of false ones, whose light was scattered or spread on its way."""


def object_shading(shading: np.ndarray) -> float:
    """Return the mean shading of an object's pixels by their first candidates, of (K, H, W); NaN if none is known."""
    known = np.isfinite(shading[0])
    return float(shading[0][known].mean()) if known.any() else float("nan")


def with_object_shading(shading: np.ndarray) -> np.ndarray:
    """Complete the shading (K, H, W) of candidates by that of the object.

    The object's mean is taken where a candidate has nothing to be compared with. On a matte object no candidate has
    less: a pixel that keeps less of its level than the rest is noise or in shadow.
    """
    mean = object_shading(shading)
    return np.asarray(np.fmax(shading, mean) if mean > MAX_SHADING else np.where(np.isnan(shading), mean, shading))


def without_shading(clusters: Clusters) -> Clusters:
    """Return clusters without the candidates that show shading; a pixel's winner goes with its first."""
    shaded = clusters.shading > MAX_SHADING
    return replace(
        clusters,
        normals=np.where(shaded[..., None], np.float32(np.nan), clusters.normals),
        winner=np.where(shaded[0, ..., None], np.float32(np.nan), clusters.winner),
    )


def shading_log_ratio(shading: np.ndarray) -> np.ndarray:
    """Return the log-likelihood ratio (K, H, W), nats, of a true against a false highlight; 0 where nothing is known.

    Both are taken to have exponentially distributed shading. It only counts against a candidate: in clear glass false
    highlights are as sharp as true ones.
    """
    ratio = np.log(FALSE_MEAN / TRUE_MEAN) - shading * (1.0 / TRUE_MEAN - 1.0 / FALSE_MEAN)
    return np.asarray(np.nan_to_num(np.minimum(ratio, 0.0)), np.float32)
