"""Highlights of a moving light on a chrome sphere, frame by frame, despite the sphere's static reflections.

Source: the chrome sphere as reference geometry for orientation consistency (section 3 of Yeung et al. 2009, after
Hertzmann and Seitz 2005). Blobs are segmented by hysteresis thresholding (Canny 1986) above the temporal background.
"""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.perspective import Cone, lights_for_view, view_vectors
from glint.tasks.algorithms.geometry.robust import robust_deviation
from glint.tasks.algorithms.geometry.vectors import unit
from glint.tasks.algorithms.lighting.blobs import measure_blobs
from glint.tasks.algorithms.lighting.spheres import Sphere

BACKGROUND_RADIUS_RATIO = 0.75
"""Radius, as a share of the sphere's, within which the light's highlight and noise are measured."""
BACKGROUND_PERCENTILE, MIN_FRAMES_FOR_PERCENTILE = 30.0, 6
"""Percentile of a pixel's levels that is its background, below the median since a hand-held light lingers, and the
least number of frames for it; of fewer, the minimum is taken."""
MIN_HEADROOM_RATIO = 0.15
"""Share of the saturation level by which the background must stay below it, or the pixel counts as occluded."""
CONTOUR_TOLERANCE = 1.05
"""Radius, as a share of the sphere's, up to which pixels are read: highlights at the contour extend beyond it."""
TRIM_RATIO = 1.3
"""Radius about a blob's centre, in radii of a disc of its area, beyond which pixels are glare."""
MIN_OBLIQUE_SINE, MIN_OBLIQUE_FRAMES = 0.4, 8
"""Sine of the angle between view and normal from which a highlight's axes differ enough to tell the light's size, and
number of such frames without which it stays unknown."""
MIN_UNBLURRED_NZ = 0.6
"""n_z of the sphere's normal below which highlights are too near the contour for their axes to be compared."""
PIXEL_VARIANCE = 1.0 / 12.0
"""Variance of the positions within a pixel."""

LIGHT_REMEDY = "keep the light on and its reflection visible on the sphere, expose so that only the highlights clip"


@dataclass(frozen=True, slots=True)
class StaticBackground:
    """Static reflections of a sphere.

    background: (h, w) float32, level of each pixel without the light. saturation: level of the light's highlight.
    noise: standard deviation of the residuals. All are levels of the frames. level_of_8_bits: how many of these are
    one level of 8 bits.
    """

    background: np.ndarray
    saturation: float
    noise: float
    level_of_8_bits: float = 1.0


@dataclass(frozen=True, slots=True)
class BlobLevels:
    """Levels of a blob between the background (0) and saturation (1).

    peak: it exceeds this level somewhere (upper hysteresis threshold). edge: it is connected above this level (lower
    hysteresis threshold). full: a pixel's weight rises from 0 at `edge` to 1 here, which makes the boundary subpixel.
    """

    peak: float = 0.6
    edge: float = 0.25
    full: float = 0.75


DEFAULT_LEVELS = BlobLevels()


@dataclass(frozen=True, slots=True)
class Highlights:
    """Bright blobs of T frames, B per frame.

    directions: (T, B, 3) float32, unit vectors to the light, camera frame, NaN where there is none. area: (T, B) in
    pixels. occluded_fraction: (T, B), share of the blob that a bright background or the image's edge hides. spread:
    (T, B, 3), covariance of its columns and rows, xx, xy, yy, in square pixels.
    """

    directions: np.ndarray
    area: np.ndarray
    occluded_fraction: np.ndarray
    spread: np.ndarray


def static_background(sample: np.ndarray, sphere: Sphere, *, camera: np.ndarray | None = None) -> StaticBackground:
    """Estimate the static reflections of a sphere.

    Args:
        sample: frames (S, h, w) uint8 or uint16, spread evenly over the capture. One frame has no static part, fewer
            than six give their minimum.
        sphere: in the frames' pixels.
        camera: see `measure_highlights`.

    Raises:
        ValueError: the sample has another shape or no frame.
        UnusableCapture: the sphere lies outside its frames.
    """
    frames = np.asarray(sample)
    if frames.ndim != 3 or len(frames) == 0:
        raise ValueError(f"sample has shape {frames.shape}, expected (frames, rows, columns) with at least one frame")
    if len(frames) == 1:
        background = np.zeros(frames.shape[1:], np.float32)
    elif len(frames) < MIN_FRAMES_FOR_PERCENTILE:
        background = frames.min(axis=0).astype(np.float32)
    else:
        background = np.percentile(frames, BACKGROUND_PERCENTILE, axis=0).astype(np.float32)
    inside = _reflections(sphere, frames.shape[1:], camera)[0] < BACKGROUND_RADIUS_RATIO
    if not inside.any():
        raise UnusableCapture("the sphere lies outside its frames", LIGHT_REMEDY)
    peaks = frames[:, inside].max(axis=1)
    residual = frames[:, inside].astype(np.float32) - background[inside]
    has_noise = len(frames) >= MIN_FRAMES_FOR_PERCENTILE
    noise = robust_deviation(residual - np.median(residual)) if has_noise else 0.0
    level_of_8_bits = np.iinfo(frames.dtype).max / 255.0
    return StaticBackground(background, float(np.percentile(peaks, 75.0)), noise, level_of_8_bits)


def measure_highlights(
    frames: np.ndarray,
    sphere: Sphere,
    static: StaticBackground,
    levels: BlobLevels = DEFAULT_LEVELS,
    *,
    camera: np.ndarray | None = None,
) -> Highlights:
    """Measure the bright blobs on a sphere in a block of frames.

    Under an orthographic camera every pixel of a chrome sphere reflects the same solid angle of the surroundings
    (4 / radius^2 steradians). The weighted mean of the directions that the pixels reflect is therefore the light's
    centre, without bias from the sphere's distortion, and the light covers the same area wherever it is. Under a
    perspective camera this holds approximately. Blur adds a bias, see `without_blur`.

    Args:
        frames: (T, h, w) uint8 or uint16.
        sphere: in the frames' pixels.
        static: from `static_background`.
        levels: by which blobs are segmented and their pixels weighted.
        camera: perspective camera's matrix (3, 3) in the frames' pixels, whose every pixel has its own view vector.

    Raises:
        ValueError: frames and background differ in shape.
    """
    frames = np.ascontiguousarray(frames)
    if frames.ndim != 3 or frames.shape[1:] != static.background.shape:
        raise ValueError(f"frames have shape {frames.shape}, the static background {static.background.shape}")
    sine, directions = _reflections(sphere, frames.shape[1:], camera)
    headroom = static.saturation - static.background
    occluded = headroom < MIN_HEADROOM_RATIO * static.saturation
    unread = occluded | (sine > CONTOUR_TOLERANCE)
    gain = np.where(unread, 0.0, 1.0 / np.maximum(headroom, 1e-6)).astype(np.float32)
    peaks = np.where(unread, np.float32(np.inf), static.background + levels.peak * headroom).astype(np.float32)
    total, area, hidden, spread = measure_blobs(
        frames,
        static.background,
        gain,
        peaks,
        occluded & (sine <= CONTOUR_TOLERANCE),
        directions,
        levels.edge,
        levels.full,
        TRIM_RATIO,
    )
    return Highlights(unit(total).astype(np.float32), area, hidden / np.maximum(area, 1.0), spread)


def without_blur(half_vectors: np.ndarray, area: np.ndarray, spread: np.ndarray, radius: float) -> np.ndarray:
    """Return half vectors without the bias that blur and glare add to the mean direction of a highlight's pixels.

    A distant light whose image is a disc of radius k at the sphere's centre shows an ellipse where the normal's cosine
    is c, of semi-axes k c along the radius and k / c across: its mean direction is the light's. Blur widens both axes
    alike by d, and the pixels added on the outer side reflect directions farther off than those on the inner side. The
    difference of the axes, k (1/c - c), is not changed by blur and tells k. To second order in the axes over the
    radius r, with the normal's sine s, a mean over an ellipse of semi-axes u and v lies
    s (u^2 / c^3 + (3 - 2 s^2) v^2 / c) / (4 r^2) beyond the direction that its centre reflects.

    Args:
        half_vectors: (T, 3), of the mean directions, unit; NaN where there is none.
        area: (T,), of the highlights, in pixels.
        spread: (T, 3), see `Highlights`.
        radius: of the sphere, in pixels.
    """
    sine = np.hypot(half_vectors[:, 0], half_vectors[:, 1])
    cosine = np.clip(half_vectors[:, 2], MIN_UNBLURRED_NZ, 1.0)
    size = np.sqrt(area / np.pi)
    light_radius = _light_radius(half_vectors, area, spread)
    if light_radius is None:
        return half_vectors
    light = np.minimum(light_radius, size)

    def bias(along: np.ndarray, across: np.ndarray) -> np.ndarray:
        terms = along**2 / cosine**3 + (3.0 - 2.0 * sine**2) * across**2 / cosine
        return np.asarray(sine * terms / (4.0 * radius**2))

    along, across = light * cosine, light / cosine
    excess = bias(along + size - light, across + size - light) - bias(along, across)
    # The half vector turns by half the angle of the light.
    angle = np.arctan2(sine, half_vectors[:, 2]) - 0.5 * np.maximum(excess, 0.0)
    scale = np.sin(angle) / np.maximum(sine, 1e-9)
    return np.column_stack([half_vectors[:, :2] * scale[:, None], np.cos(angle)])


def _light_radius(half_vectors: np.ndarray, area: np.ndarray, spread: np.ndarray) -> float | None:
    """Return the radius in pixels of the light's image at the sphere's centre, without blur; None: too few frames."""
    sine, cosine = np.hypot(half_vectors[:, 0], half_vectors[:, 1]), half_vectors[:, 2]
    used = (sine > MIN_OBLIQUE_SINE) & (cosine > MIN_UNBLURRED_NZ) & (area > 0.0)
    if used.sum() < MIN_OBLIQUE_FRAMES:
        return None
    # Rows run downward, against y.
    x, y = half_vectors[used, 0] / sine[used], -half_vectors[used, 1] / sine[used]
    xx, xy, yy = spread[used].T
    along, across = (
        2.0 * np.sqrt(np.maximum(variance - PIXEL_VARIANCE, 0.0))
        for variance in (xx * x**2 + 2.0 * xy * x * y + yy * y**2, xx * y**2 - 2.0 * xy * x * y + yy * x**2)
    )
    return max(float(np.median((across - along) / (1.0 / cosine[used] - cosine[used]))), 0.0)


def _reflections(sphere: Sphere, shape: tuple[int, ...], camera: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Return the sine (h, w) of the angle between view and normal, and the direction (h, w, 3) each pixel reflects.

    The sine exceeds 1 beside the sphere.
    """
    if camera is not None:
        cone = Cone.from_ellipse(sphere.x, sphere.y, sphere.radius, camera)
        view = view_vectors(camera, shape, 0, 0)
        normals = cone.normals(view)
        return cone.sines(view), lights_for_view(normals, view)
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    nx, ny = (columns - sphere.x) / sphere.radius, (sphere.y - rows) / sphere.radius
    nz = np.sqrt(np.maximum(1.0 - nx**2 - ny**2, 0.0))
    return np.hypot(nx, ny), np.stack([2 * nz * nx, 2 * nz * ny, 2 * nz * nz - 1.0], axis=-1)
