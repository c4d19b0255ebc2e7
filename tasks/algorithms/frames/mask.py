"""The object's mask from where things glint: GrabCut seeded by the highlights (METHOD 4).

Glass lights up all over in the temporal maximum; the table round it takes at most the lamp's soft shading and a few
caustics. Highlights seed the object, what lies far from them seeds the background, and GrabCut draws the outline
between them in the pictures that one never sees at once: the typical and the brightest level of every pixel.
"""

from collections.abc import Sequence

import cv2
import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.lighting.spheres import Sphere

LARGEST = 700
"""Longest edge in pixels at which GrabCut works; larger pictures are reduced to it."""
REMEDY = "paint a mask (white object on black) and name it as `mask: mask.png`, or give the object's `region`"


def estimate_mask(
    typical: np.ndarray,
    brightest: np.ndarray,
    *,
    spheres: Sequence[Sphere] = (),
    rise: float = 0.85,
    rounds: int = 4,
    least: float = 0.15,
) -> np.ndarray:
    """Mask (H, W) bool of what glints.

    typical, brightest (H, W): temporal median and maximum, any real dtype; spheres: mirror balls in these pixels, left
    out with what they mirror of the object; rise: of the brightest level above the typical one, as a share of the
    largest, that makes a highlight; least: area of a further piece relative to the largest.

    Raises UnusableCapture where nothing glints, or everything does.
    """
    if typical.shape != brightest.shape or typical.ndim != 2:
        raise ValueError(f"pictures have shapes {typical.shape} and {brightest.shape}, expected two equal (H, W)")
    height, width = typical.shape
    scale = min(1.0, LARGEST / max(height, width))
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    low, high = (
        cv2.resize(picture.astype(np.float32), size, interpolation=cv2.INTER_AREA) for picture in (typical, brightest)
    )
    free = np.ones(low.shape, bool)
    rows, columns = np.mgrid[: size[1], : size[0]]
    for sphere in spheres:
        free &= np.hypot(columns - sphere.x * scale, rows - sphere.y * scale) > 1.2 * sphere.radius * scale
    excess = np.where(free, high - low, 0.0)
    top = float(np.percentile(excess, 99.5))
    if top < 0.1 * max(float(high.max()), 1.0):
        raise UnusableCapture(f"nothing in {width} x {height} pixels glints (by {top:.0f} levels at most)", REMEDY)
    seed = _pieces(_closed(excess > rise * top) & free, least)
    if seed.mean() > 0.9:
        raise UnusableCapture(f"{seed.mean():.0%} of {width} x {height} pixels glint", REMEDY)
    inside = ndimage.distance_transform_edt(seed)
    outside = ndimage.distance_transform_edt(~seed)
    reach = max(3.0, 0.35 * float(inside.max()))
    trimap = np.full(low.shape, cv2.GC_PR_BGD, np.uint8)
    trimap[(outside > reach) | ~free] = cv2.GC_BGD
    trimap[seed] = cv2.GC_PR_FGD
    trimap[inside > 2.0] = cv2.GC_FGD
    pictures = [low * (255.0 / max(float(low.max()), 1.0)), high * (255.0 / float(high.max())), excess * (255.0 / top)]
    image = np.clip(np.stack(pictures, axis=-1), 0, 255).astype(np.uint8)
    models = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.setRNGSeed(0)
    cv2.grabCut(image, trimap, None, *models, rounds, cv2.GC_INIT_WITH_MASK)
    found = (trimap == cv2.GC_FGD) | (trimap == cv2.GC_PR_FGD)
    found = _pieces(_without_pinholes(ndimage.binary_opening(found, iterations=1) | (inside > 2.0)), least)
    smooth = cv2.resize(found.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR)
    return cv2.GaussianBlur(smooth, (0, 0), max(0.8, 0.5 / scale)) > 0.5


def _closed(lit: np.ndarray, share: float = 0.08) -> np.ndarray:
    """What was lit with the gaps between closed, up to a share of the edge of a square of that area."""
    radius = max(2, round(share * float(np.sqrt(lit.sum()))))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    padded = np.pad(lit.astype(np.uint8), 2 * radius)
    return cv2.morphologyEx(padded, cv2.MORPH_CLOSE, disc)[2 * radius : -2 * radius, 2 * radius : -2 * radius] > 0


def _pieces(mask: np.ndarray, least: float) -> np.ndarray:
    """The largest component and those of at least so much of its area."""
    names, count = ndimage.label(mask)
    if count == 0:
        return mask
    areas = np.bincount(names.ravel())[1:]
    return np.isin(names, 1 + np.flatnonzero(areas >= least * areas.max()))


def _without_pinholes(mask: np.ndarray, largest: float = 0.015) -> np.ndarray:
    """Close holes that are small beside the object; a handle's stays."""
    names, count = ndimage.label(~mask)
    areas = np.bincount(names.ravel(), minlength=count + 1)
    small = areas < largest * mask.sum()
    small[0] = False
    return mask | small[names]
