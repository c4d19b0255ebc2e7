"""Tests of what looks like a chrome sphere, by its highlight in single frames.

A chrome sphere shows one highlight of constant area in nearly all frames: the directions that its pixels reflect cover
the surroundings evenly, wherever the light is. Small highlights that it mirrors from the glass beside it lie on one
side of it alone. Glass shows highlights of several surfaces, which grow, merge and divide; coins and clock faces show
them in few frames. A glossy sphere shows one too, but its body is lit: its levels follow Lambert's law over pixels and
frames.
"""

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.perspective import camera_in_crop
from glint.tasks.algorithms.geometry.vectors import half_vectors_of
from glint.tasks.algorithms.lighting.highlights import Highlights, measure_highlights, static_background
from glint.tasks.algorithms.lighting.lights import (
    TWO_LIGHTS,
    Lights,
    classify_frames,
)
from glint.tasks.algorithms.lighting.spheres import MIN_OBSERVABLE_NZ, Sphere, crop_around

MIN_ACCEPTED_SHARE = 0.5
"""Share of the frames that must show one highlight: an arm may hide it for a while, and windows may cover it."""
MAX_TWO_LIGHTS_SHARE, MIN_TWO_LIGHTS = 0.02, 2
"""Share and number of frames with two lights from which it is glass, whose inside shows further highlights: glass shows
them in 3 to 28% of the frames, chrome spheres in none."""
IRREGULAR_AREA_RATIO, IRREGULAR_AREA_PX = 3.0, 1.0
"""Factor, and pixels beside, beyond which a highlight's area is irregular: the light's distance may vary by 1.7."""
MAX_OCCLUDED_SHARE = 0.05
"""Share of a highlight that is hidden by a static reflection, beyond which its area shows nothing."""
MAX_IRREGULAR_SHARE, MIN_IRREGULAR = 0.05, 1
"""Share and number of the frames with a highlight before the object from which irregular ones (of another area, or two
lights) show glass: at most 2% on 38 chrome spheres, 8 to 62% on glass that is as round."""
MAX_BESIDE_NZ = 0.85
"""n_z of the sphere's normal below which it mirrors what stands beside it, up to 26 degrees nearer to the camera."""
MIN_BESIDE_RESULTANT = 0.6
"""Length of the mean of unit vectors, from the sphere's centre to highlights mirrored from an object beside it: 0.64 if
they are spread over half a circle, 0.78 to 1.00 on 29 chrome spheres with three or more of them."""
MAX_BESIDE_SHARE = 0.2
"""Share of the frames with a highlight before the object beyond which they are not mirrored: up to 16% on chrome."""
MIN_TESTED_FRAMES = 4
"""Frames below which a circle is not tested."""
HIGHLIGHT_REACH_DEG = 25.0
"""Angle about the half vector within which a highlight and its glare are left out of the test of shading."""
SHADED_RATIOS = 0.3, 0.9
"""Radii, in radii of the sphere, between which its body is tested for shading."""
MAX_SHADING_CORRELATION = 0.85
"""Correlation of a body's levels with Lambert's law from which it is shaded: a glossy sphere has 0.91, chrome 0.79."""
CROP_MARGIN_PX = 4
"""Distance beyond the contour of the crop in which a circle is tested."""
INNER_DISC_RATIO, RING_RATIOS = 0.75, (0.85, 0.97)
"""Radius, in radii of the sphere, of the disc in which highlights of lights before the object lie, and the radii of a
ring inside the contour that they leave dark."""
PEAK_PERCENTILE, FULL_PEAK_LEVELS = 98.0, 100.0
"""Percentile of the disc's levels that counts as its peak, and the peak, in levels, from which it is full evidence."""
LIT_PEAK_SHARE = 0.35
"""Share of the peak above which a pixel of the ring is lit."""
LIT_RING_OFFSET, LIT_RING_SLOPE = 1.8, 2.5
"""The evidence falls linearly from 1 where 32% of the ring is lit to 0 at 72%: offset, and slope by the lit share."""


def highlight_evidence(residual: np.ndarray, x: float, y: float, radius: float) -> float:
    """Return how well, 0..1, the moving light stays within the inner disc of a sphere.

    residual: maximum above the usual level, (H, W); x, y, radius: of the sphere, in its pixels.
    """
    top, left = max(int(y - radius), 0), max(int(x - radius), 0)
    window = residual[top : max(int(y + radius) + 2, 0), left : max(int(x + radius) + 2, 0)]
    rows, columns = np.mgrid[: window.shape[0], : window.shape[1]]
    distance = np.hypot(columns + left - x, rows + top - y) / radius
    inner, ring = window[distance < INNER_DISC_RATIO], window[(distance > RING_RATIOS[0]) & (distance < RING_RATIOS[1])]
    if inner.size == 0 or ring.size == 0:
        return 0.0
    peak = float(np.percentile(inner, PEAK_PERCENTILE))
    if peak <= 0.0:
        return 0.0
    # The ring is darker than the disc, hardly any of it is lit, and the disc is bright at all.
    contrast = max(1.0 - float(np.median(ring)) / peak, 0.0)
    lit = float((ring > LIT_PEAK_SHARE * peak).mean())
    darkness = min(max(LIT_RING_OFFSET - LIT_RING_SLOPE * lit, 0.0), 1.0)
    return contrast * darkness * min(peak / FULL_PEAK_LEVELS, 1.0)


def reason_against_chrome(frames: np.ndarray, sphere: Sphere, camera: np.ndarray | None = None) -> str | None:
    """Return why a circle is no chrome sphere; None if nothing speaks against it.

    Args:
        frames: (T, H, W), spread over the capture.
        sphere: in the frames' pixels.
        camera: perspective camera's matrix (3, 3).
    """
    if len(frames) < MIN_TESTED_FRAMES:
        return None
    crop, inside, matrix = crop_of_circle(frames, sphere, camera)
    try:
        static = static_background(crop, inside, camera=matrix)
        highlights = measure_highlights(crop, inside, static, camera=matrix)
        lights = classify_frames([highlights], static, inside)
    except UnusableCapture:
        return "no light moves on it"
    share = float(lights.accepted.mean())
    if share < MIN_ACCEPTED_SHARE:
        return f"{share:.0%} of the frames show one light on it"
    shown, differs, divided = irregular_highlights(highlights, lights)
    several = int(divided.sum())
    if several > max(MIN_TWO_LIGHTS, MAX_TWO_LIGHTS_SHARE * len(frames)):
        return f"{several} of {len(frames)} frames show two lights on it, as glass does"
    irregular = int((differs | (divided & shown)).sum())
    if irregular > max(MIN_IRREGULAR, MAX_IRREGULAR_SHARE * shown.sum()):
        return f"its highlight has another size in {irregular} of {shown.sum()} frames, as that of glass has"
    if lights.accepted.sum() >= MIN_TESTED_FRAMES:
        correlation = shading_correlation(crop, inside, lights)
        if correlation > MAX_SHADING_CORRELATION:
            return f"its body is shaded like a matte or glossy one (correlation {correlation:.2f})"
    return None


def irregular_highlights(highlights: Highlights, lights: Lights) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return, by frame (T,) bool, whether there is a highlight before the object, whether its area is not the usual
    one, and whether there are two lights; the last two only where the object beside the sphere does not explain it.

    highlights: of the frames (T,); lights: what they were classified as.
    """
    area = highlights.area
    half_vectors = half_vectors_of(highlights.directions.astype(float))
    shown = (half_vectors[:, 0, 2] >= MIN_OBSERVABLE_NZ) & (area[:, 0] > 0)
    whole = shown & (highlights.occluded_fraction[:, 0] <= MAX_OCCLUDED_SHARE)
    divided = lights.reason == TWO_LIGHTS
    if not whole.any():
        return shown, whole, divided
    usual = float(np.median(area[whole, 0]))
    larger = whole & (area[:, 0] > IRREGULAR_AREA_RATIO * usual + IRREGULAR_AREA_PX)
    smaller = whole & (area[:, 0] < (usual - IRREGULAR_AREA_PX) / IRREGULAR_AREA_RATIO)
    # The sphere mirrors the object's highlights too, alone where the light is behind, else as a second, smaller one.
    beside = half_vectors[..., 2] < MAX_BESIDE_NZ
    smaller_beside, second_beside = smaller & beside[:, 0], divided & beside[:, 1] & (area[:, 1] < area[:, 0])
    mirrored = np.concatenate([half_vectors[smaller_beside, 0], half_vectors[second_beside, 1]])
    if len(mirrored) <= MAX_BESIDE_SHARE * shown.sum() and _is_one_side(mirrored):
        smaller, divided = smaller & ~smaller_beside, divided & ~second_beside
    return shown, larger | smaller, divided


def _is_one_side(normals: np.ndarray) -> bool:
    """Return whether normals (N, 3), none of which is the view vector, are turned to one side."""
    sideways = normals[:, :2] / np.linalg.norm(normals[:, :2], axis=1, keepdims=True)
    return len(sideways) > 0 and float(np.linalg.norm(sideways.mean(axis=0))) >= MIN_BESIDE_RESULTANT


def shading_correlation(crop: np.ndarray, sphere: Sphere, lights: Lights) -> float:
    """Return the correlation, over pixels and accepted frames, of levels (T, h, w) with Lambert's law n.l.

    Per pixel and per frame the mean is subtracted first: static reflections, and the light's overall brightness.
    """
    directions = lights.lights[lights.accepted].astype(float)
    rows, columns = np.mgrid[: crop.shape[1], : crop.shape[2]]
    nx, ny = (columns - sphere.x) / sphere.radius, (sphere.y - rows) / sphere.radius
    body = (np.hypot(nx, ny) > SHADED_RATIOS[0]) & (np.hypot(nx, ny) < SHADED_RATIOS[1])
    normals = np.stack([nx[body], ny[body], np.sqrt(1.0 - nx[body] ** 2 - ny[body] ** 2)], axis=1)
    kept = half_vectors_of(directions) @ normals.T < np.cos(np.radians(HIGHLIGHT_REACH_DEG))
    levels = _centred(crop[lights.accepted][:, body].astype(float), kept)
    shading = _centred(np.maximum(directions @ normals.T, 0.0), kept)
    return float((levels * shading).sum() / np.sqrt((levels**2).sum() * (shading**2).sum() + 1e-12))


def _centred(values: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Return values (T, P) without the means of pixels and of frames over the kept ones; 0 where not kept."""
    for axis in (0, 1):
        mean = (values * kept).sum(axis=axis, keepdims=True) / np.maximum(kept.sum(axis=axis, keepdims=True), 1)
        values = np.where(kept, values - mean, 0.0)
    return values


def crop_of_circle(
    frames: np.ndarray, sphere: Sphere, camera: np.ndarray | None
) -> tuple[np.ndarray, Sphere, np.ndarray | None]:
    """Return the frames, the sphere and the camera's matrix in the pixels of a crop around the sphere."""
    crop, left, top = crop_around(frames, sphere, CROP_MARGIN_PX)
    matrix = None if camera is None else camera_in_crop(camera, left, top)
    return crop, sphere.in_crop(left, top), matrix
