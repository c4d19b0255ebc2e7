"""Object mask from its highlights: GrabCut (Rother et al. 2004) seeded by the temporal maximum.

Yeung et al. 2009 take the silhouette as given (section 4.1). In the temporal maximum glass is bright all over, while
the table around it shows at most the light's soft shading and a few caustics. Highlights seed the foreground, pixels
far from them the background, and GrabCut finds the boundary in the temporal median and maximum and their difference.
"""

from collections.abc import Sequence

import cv2
import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.lighting.spheres import Sphere

MAX_GRABCUT_EDGE_PX = 700
"""Longest edge at which GrabCut runs; larger images are reduced to it."""
SPHERE_MARGIN = 1.2
"""Radii around a sphere's centre that are excluded: beside the sphere lie its caustics."""
MASK_REMEDY = "paint a mask (white object on black) and name it as `mask: mask.png`, or give the object's `region`"


def estimate_mask(
    median: np.ndarray,
    maximum: np.ndarray,
    *,
    spheres: Sequence[Sphere] = (),
    min_rise: float = 0.85,
    iterations: int = 4,
    min_area_ratio: float = 0.15,
) -> np.ndarray:
    """Estimate the mask (H, W) bool of the object.

    Args:
        median: temporal median (H, W), any real dtype.
        maximum: temporal maximum (H, W).
        spheres: chrome spheres in these pixels; they are excluded, with the object's reflections in them.
        min_rise: rise of the maximum above the median that makes a highlight, as a share of the largest rise.
        iterations: of GrabCut.
        min_area_ratio: smallest area of a further component, relative to the largest.

    Raises:
        UnusableCapture: no pixel shows a highlight, or nearly all do.
        ValueError: the images differ in shape.
    """
    if median.shape != maximum.shape or median.ndim != 2:
        raise ValueError(f"images have shapes {median.shape} and {maximum.shape}, expected two equal (H, W)")
    height, width = median.shape
    scale = min(1.0, MAX_GRABCUT_EDGE_PX / max(height, width))
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    low, high = (
        cv2.resize(image.astype(np.float32), size, interpolation=cv2.INTER_AREA) for image in (median, maximum)
    )
    free = _outside_spheres(low.shape, spheres, scale)
    residual = np.where(free, high - low, 0.0)
    # A high percentile in place of the maximum, which a single noisy pixel would decide.
    peak = float(np.percentile(residual, 99.5))
    if peak < 0.1 * max(float(high.max()), 1.0):
        raise UnusableCapture(
            f"no highlight in {width} x {height} pixels (the maximum rises by at most {peak:.0f} levels)", MASK_REMEDY
        )
    highlights = _large_components(_closed(residual > min_rise * peak) & free, min_area_ratio)
    if highlights.mean() > 0.9:
        raise UnusableCapture(f"{highlights.mean():.0%} of {width} x {height} pixels show a highlight", MASK_REMEDY)
    depth = ndimage.distance_transform_edt(highlights)
    channels = [
        low * (255.0 / max(float(low.max()), 1.0)),
        high * (255.0 / float(high.max())),
        residual * (255.0 / peak),
    ]
    image = np.clip(np.stack(channels, axis=-1), 0, 255).astype(np.uint8)
    foreground = _grabcut(image, _trimap(highlights, depth, free), iterations)
    # Opening cuts off thin leaks along edges of the table; the interior of the highlights is the object in any case.
    foreground = ndimage.binary_opening(foreground, iterations=1) | (depth > 2.0)
    foreground = _large_components(_without_pinholes(foreground), min_area_ratio)
    smooth = cv2.resize(foreground.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR)
    return cv2.GaussianBlur(smooth, (0, 0), max(0.8, 0.5 / scale)) > 0.5


def _outside_spheres(shape: tuple[int, ...], spheres: Sequence[Sphere], scale: float) -> np.ndarray:
    """Return the pixels (h, w) bool of an image reduced by `scale` that lie beside the spheres."""
    free = np.ones(shape, bool)
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    for sphere in spheres:
        distance = np.hypot(columns - sphere.x * scale, rows - sphere.y * scale)
        free &= distance > SPHERE_MARGIN * sphere.radius * scale
    return free


def _trimap(highlights: np.ndarray, depth: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return GrabCut's initial classes (h, w) uint8 from the highlights and their depth inside them in pixels."""
    distance = ndimage.distance_transform_edt(~highlights)
    # Beyond this distance from any highlight a pixel is certainly background.
    reach = max(3.0, 0.35 * float(depth.max()))
    trimap = np.full(highlights.shape, cv2.GC_PR_BGD, np.uint8)
    trimap[(distance > reach) | ~free] = cv2.GC_BGD
    trimap[highlights] = cv2.GC_PR_FGD
    trimap[depth > 2.0] = cv2.GC_FGD
    return trimap


def _grabcut(image: np.ndarray, trimap: np.ndarray, iterations: int) -> np.ndarray:
    """Return the foreground (h, w) bool; reproducible, since the seed of OpenCV's generator is fixed."""
    models = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.setRNGSeed(0)
    cv2.grabCut(image, trimap, None, *models, iterations, cv2.GC_INIT_WITH_MASK)
    return (trimap == cv2.GC_FGD) | (trimap == cv2.GC_PR_FGD)


def _closed(lit: np.ndarray, share: float = 0.08) -> np.ndarray:
    """Close gaps between lit pixels up to `share` of the edge of a square of their area."""
    radius = max(2, round(share * float(np.sqrt(lit.sum()))))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    padded = np.pad(lit.astype(np.uint8), 2 * radius)
    return cv2.morphologyEx(padded, cv2.MORPH_CLOSE, disc)[2 * radius : -2 * radius, 2 * radius : -2 * radius] > 0


def _large_components(mask: np.ndarray, min_area_ratio: float) -> np.ndarray:
    """Return the largest component and those whose area is at least `min_area_ratio` of its area."""
    components, count = ndimage.label(mask)
    if count == 0:
        return mask
    areas = np.bincount(components.ravel())[1:]
    return np.isin(components, 1 + np.flatnonzero(areas >= min_area_ratio * areas.max()))


def _without_pinholes(mask: np.ndarray, max_area_ratio: float = 0.015) -> np.ndarray:
    """Close holes of less than `max_area_ratio` of the object's area; that of a handle is larger and stays."""
    holes, count = ndimage.label(~mask)
    areas = np.bincount(holes.ravel(), minlength=count + 1)
    small = areas < max_area_ratio * mask.sum()
    small[0] = False
    return mask | small[holes]
