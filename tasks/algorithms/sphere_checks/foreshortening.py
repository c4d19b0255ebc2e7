"""The centre of a chrome sphere by the shape of the light's image on it, into which no edge of the picture enters.

A mirror sphere shows a distant round light as an ellipse. Where the normal's cosine is c, an image of radius k at the
centre has the semi-axes k c along the radius and k / c across. So the ellipses of a whole sweep are round at one place,
and elsewhere their short axes point to it. This follows from the law of reflection: by da, the angle of the normal, the
light's direction turns by 2 da along the radius, and by 2 c times as much as the normal across. An edge inside the
sphere that is fitted in place of the contour has another centre, and the ellipses contradict it. How fast they lengthen
outward gives the radius; blur makes them rounder, so that it is an upper bound.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.perspective import VirtualCamera
from glint.tasks.algorithms.geometry.robust import robust_deviation
from glint.tasks.algorithms.lighting.highlights import PIXEL_VARIANCE, measure_highlights, static_background
from glint.tasks.algorithms.lighting.lights import classify_frames
from glint.tasks.algorithms.lighting.spheres import Sphere, crop_around

MAX_RADIUS_RATIO = 0.62
"""Distance from the circle's centre, in radii, up to which highlights count: farther out they are so long that their
ends are cut off as glare."""
MAX_OCCLUDED_SHARE = 0.05
"""Share of a highlight that is hidden by a static reflection, beyond which its shape shows nothing."""
MIN_SHAPES, MIN_OTHER_SHAPES = 24, 12
"""Frames, and frames outside any one sector, below which nothing is concluded."""
SECTORS = 6
"""Sectors about the centre that are left out in turn."""
RADIUS_RATIO_SD = 0.3
"""Standard deviation of the logarithm of the radius, relative to the circle's, before anything is measured: in half a
sweep any radius fits."""
MAX_LOG_RATIO = 0.7
"""Largest logarithm of the ratio of the two radii."""
MAX_SKEW_RATIO, MAX_MISFIT_RATIO = 0.12, 0.07
"""How far shapes may be from round at the centre, and how oblong without an explanation, in variances of the image
there. Of 90 spheres under round lights all have at most 0.06 and 0.05; lights of 1.3 times their height that are held
in seven ways have more of one or the other, unless they always point to the line of sight or lie across it."""
NOISE_RATIO = 1.5
"""Noise of how oblong shapes are, in that of their sizes: 0.3 to 1.6 under round lights."""
MIN_NOISE = 0.01
"""Lower bound of the noise of second moments, in square pixels."""
MARGIN_PX = 6
"""Pixels around the circle that are measured."""
AIMS_PX = (-1 / 3, 0.0, 1 / 3)
"""Steps right and down, in pixels, by which the virtual cameras that measure a sphere are aimed beside it: bilinear
interpolation blurs an image by f (1 - f) square pixels along each axis, f being the part of a pixel by which it moves,
which makes round highlights oblong. Over these nine the blur is the same along all axes, to 0.03 square pixels."""
AIMED_VARIANCE = 1 / 6
"""Its mean, in square pixels."""


@dataclass(frozen=True, slots=True)
class HighlightShapes:
    """Shapes of the highlights in N frames, NaN where a frame shows none.

    x, y: (N,), centres in pixels, y down. moments: (N, 3), covariances xx, xy, yy of their pixels, in square pixels.
    """

    x: np.ndarray
    y: np.ndarray
    moments: np.ndarray

    def only(self, used: np.ndarray) -> "HighlightShapes":
        """Return some of the shapes, by (N,) bool."""
        return HighlightShapes(self.x[used], self.y[used], self.moments[used])


@dataclass(frozen=True, slots=True)
class ShapeCircle:
    """What the shapes of highlights say of a sphere: its centre x, y in pixels, and an upper bound of its radius.

    sd: standard deviation of the centre per axis, in pixels. max_radius: in pixels; log_radius_sd: standard deviation
    of its logarithm.
    """

    x: float
    y: float
    sd: float
    max_radius: float
    log_radius_sd: float


def circle_of_highlights(frames: np.ndarray, sphere: Sphere, *, camera: np.ndarray | None = None) -> ShapeCircle | None:
    """Measure a sphere's centre and the largest radius it may have by the shapes of its highlights.

    None where too few show, or those of a light that is not round.

    Args:
        frames: (T, H, W) uint8, spread over the capture.
        sphere: a circle near that of the sphere, in the frames' pixels; up to a fifth of the radius beside it will do.
        camera: perspective camera's matrix (3, 3); the highlights are then measured by virtual cameras aimed at the
            sphere.
    """
    if len(frames) < MIN_SHAPES:
        return None
    try:
        if camera is None:
            return circle_of_shapes(highlight_shapes(frames, sphere), sphere)
        shapes = _aimed_shapes(frames, sphere, camera)
    except UnusableCapture:
        return None
    centre = circle_of_shapes(shapes, replace(sphere, x=0.0, y=0.0))
    if centre is None:
        return None
    virtual = VirtualCamera.aimed_at(sphere.x, sphere.y, sphere.radius, camera)
    x, y, _ = virtual.project_back(virtual.centre + centre.x, virtual.centre + centre.y, sphere.radius)
    return replace(centre, x=x, y=y)


def _aimed_shapes(frames: np.ndarray, sphere: Sphere, camera: np.ndarray) -> HighlightShapes:
    """Measure the shapes of the highlights on a sphere by virtual cameras aimed at it; relative to the circle's centre.

    For arguments and errors see `circle_of_highlights` and `highlight_shapes`.
    """
    aimed = []
    for right in AIMS_PX:
        for down in AIMS_PX:
            virtual = VirtualCamera.aimed_at(sphere.x + right, sphere.y + down, sphere.radius, camera)
            warped = np.stack([virtual.warp(frame) for frame in frames]).clip(0.0, 255.0).round().astype(np.uint8)
            shapes = highlight_shapes(warped, Sphere(virtual.centre, virtual.centre, sphere.radius))
            place = shapes.x - virtual.centre + right, shapes.y - virtual.centre + down
            aimed.append(np.column_stack([*place, shapes.moments]))
    # A frame that only some of them accept is doubtful.
    x, y, *moments = np.mean(aimed, axis=0).T
    return HighlightShapes(x, y, np.stack(moments, axis=1) - AIMED_VARIANCE * np.array([1.0, 0.0, 1.0]))


def circle_of_shapes(shapes: HighlightShapes, sphere: Sphere) -> ShapeCircle | None:
    """Return the centre at which shapes are those that a mirror sphere shows of a round light.

    None where there are too few, or where they are not those of a round light: how an oblong one is held can shift the
    centre without a trace. Its standard deviation is that of the jackknife over sectors about the circle's centre
    (Quenouille 1956): an object that the sphere mirrors misleads all shapes of one side.
    """
    distance = np.hypot(shapes.x - sphere.x, shapes.y - sphere.y)
    shapes = shapes.only(distance < MAX_RADIUS_RATIO * sphere.radius)
    if len(shapes.x) < MIN_SHAPES:
        return None
    turn = np.arctan2(shapes.y - sphere.y, shapes.x - sphere.x) / (2.0 * np.pi) % 1.0
    sector = np.minimum((SECTORS * turn).astype(int), SECTORS - 1)
    if len(sector) - np.bincount(sector).max() < MIN_OTHER_SHAPES:
        return None
    whole = fit_shapes(shapes, sphere)
    if whole.skew > MAX_SKEW_RATIO or whole.misfit > MAX_MISFIT_RATIO:
        return None
    fits = [fit_shapes(shapes.only(sector != left), sphere) for left in range(SECTORS)]
    variances = (SECTORS - 1) * np.var([(fit.x, fit.y, fit.log_ratio) for fit in fits], axis=0)
    return ShapeCircle(
        whole.x,
        whole.y,
        float(np.sqrt(variances[:2].mean())),
        sphere.radius * float(np.exp(whole.log_ratio)),
        float(np.sqrt(variances[2])),
    )


def expected_moments(
    x: np.ndarray, y: np.ndarray, sphere: Sphere, size: float, skew: tuple[float, float] = (0.0, 0.0)
) -> np.ndarray:
    """Return the covariances xx, xy, yy (N, 3) of highlights centred at x, y (N,) on a sphere, in square pixels.

    Args:
        x: columns.
        y: rows.
        sphere: centre and radius, in pixels.
        size: variance along an axis of the light's image at the sphere's centre, in square pixels.
        skew: (xx - yy) / 2 and xy of a light that is not round, or of an ellipse that is taken for a circle.
    """
    right, down = x - sphere.x, y - sphere.y
    square = right**2 + down**2
    cosine_squared = 1.0 - np.minimum(square / sphere.radius**2, 0.95)
    along, across = size * cosine_squared, size / cosine_squared
    square = square + 1e-9
    xx, xy, yy = right**2 / square, right * down / square, down**2 / square
    return np.stack(
        [
            along * xx + across * yy + PIXEL_VARIANCE + skew[0],
            (along - across) * xy + skew[1],
            along * yy + across * xx + PIXEL_VARIANCE - skew[0],
        ],
        axis=1,
    )


@dataclass(frozen=True, slots=True)
class ShapeFit:
    """Sphere and light by the shapes of highlights.

    x, y: centre, in pixels; log_ratio: logarithm of the radius in radii of the circle; skew: of the image at the
    centre, and misfit: deviation of how oblong shapes are that neither the fit nor their noise explains, both in
    variances of that image.
    """

    x: float
    y: float
    log_ratio: float
    skew: float
    misfit: float


def fit_shapes(shapes: HighlightShapes, sphere: Sphere) -> ShapeFit:
    """Fit the sphere and the light whose highlights have the given shapes, by robust least squares.

    sphere: a circle near that of the sphere, in pixels.
    """
    trace = shapes.moments[:, 0] + shapes.moments[:, 2]
    usual = float(np.median(trace))
    # A trace has twice the noise of a moment.
    noise = max(0.5 * robust_deviation(trace - usual), MIN_NOISE)
    weights = np.array([1.0, np.sqrt(2.0), 1.0]) / noise

    def residuals(unknown: np.ndarray) -> np.ndarray:
        x, y, log_ratio, size, *skew = unknown
        circle = Sphere(x, y, sphere.radius * np.exp(log_ratio))
        moments = expected_moments(shapes.x, shapes.y, circle, size, (skew[0], skew[1]))
        return np.append(((moments - shapes.moments) * weights).ravel(), log_ratio / RADIUS_RATIO_SD)

    reach, most = sphere.radius, usual + 1.0
    lower = [sphere.x - reach, sphere.y - reach, -MAX_LOG_RATIO, 0.0, -most, -most]
    upper = [sphere.x + reach, sphere.y + reach, MAX_LOG_RATIO, most, most, most]
    start = [sphere.x, sphere.y, 0.0, 0.4 * usual, 0.0, 0.0]
    fit = least_squares(residuals, start, bounds=(lower, upper), loss="soft_l1")
    x, y, log_ratio, size, level_skew, cross_skew = (float(value) for value in fit.x)
    xx, xy, yy = (fit.fun[:-1].reshape(shapes.moments.shape) / weights).T
    oblong = robust_deviation(np.concatenate([(xx - yy) / 2.0, xy]))
    scatter = NOISE_RATIO * robust_deviation((xx + yy) / 2.0)
    size, unexplained = max(size, MIN_NOISE), float(np.sqrt(max(oblong**2 - scatter**2, 0.0)))
    return ShapeFit(x, y, log_ratio, float(np.hypot(level_skew, cross_skew)) / size, unexplained / size)


def highlight_shapes(frames: np.ndarray, sphere: Sphere) -> HighlightShapes:
    """Measure the shapes of the highlights on a sphere in frames (T, H, W) uint8, in their pixels.

    Raises:
        UnusableCapture: no moving light shows on it.
    """
    crop, left, top = crop_around(frames, sphere, MARGIN_PX)
    inside = sphere.in_crop(left, top)
    static = static_background(crop, inside)
    highlights = measure_highlights(crop, inside, static)
    lights = classify_frames([highlights], static, inside)
    used = lights.accepted & (highlights.occluded_fraction[:, 0] < MAX_OCCLUDED_SHARE)
    # Half vectors are the normals that the circle has at the highlights' centres.
    normals = np.where(used[:, None], lights.half_vectors.astype(float), np.nan)
    x, y = sphere.x + sphere.radius * normals[:, 0], sphere.y - sphere.radius * normals[:, 1]
    return HighlightShapes(x, y, np.where(used[:, None], highlights.spread[:, 0].astype(float), np.nan))
