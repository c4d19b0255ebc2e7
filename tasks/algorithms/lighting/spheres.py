"""Chrome spheres in a static camera's frame: detection in the temporal median and maximum, and subpixel refinement.

Yeung et al. 2009 take the reference sphere as given (section 3). Two cues together distinguish a chrome sphere. Its
contour is a circle, whose edge gradients point at one centre (Kimme, Ballard and Sklansky 1975). And in the temporal
maximum the light's highlights lie within r sin 45 of the centre (lights before the object), while the ring inside the
contour stays as it was; glass lights up to its contour and beyond.
"""

from dataclasses import dataclass, replace

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.perspective import VirtualCamera
from glint.tasks.algorithms.lighting.circles import contour_score, fit_circle, log_gradient, strongest_circles
from glint.tasks.algorithms.lighting.pyramid import (
    MAX_LEVEL_RADIUS_PX,
    MIN_LEVEL_RADIUS_PX,
    PyramidLevel,
    pyramid,
    pyramid_level,
    reduced_image,
)

MAX_SPHERES = 8

COARSE_RADIUS_PX, FINE_RADIUS_PX = 40.0, 150.0
"""Radius, in pixels of the reduced images, at least kept where refinement begins, and where it ends if the frame has as
many: the contour of a larger sphere is out of focus or rough by more than a pixel."""

SEEDS_PER_IMAGE = 25
"""Strongest circles of each image and level that are examined as spheres."""
DISC_RADIUS_RATIOS = 1.25, 1.7
"""Radius of a sphere relative to that of the disc of highlights inside it, which the maximum shows: lowest, highest."""
MIN_SEED_EVIDENCE = 0.1
"""Highlight evidence below which a seed is not fitted."""

MAX_REFINED = 12
"""Best candidates that are refined and scored again at full resolution."""
MIN_REFINED_RATIO = 0.25
"""Score relative to the best candidate's below which a candidate is not refined."""

MIN_SPHERE_SCORE = 0.14
"""Lower bound of the product of contour score and highlight evidence."""

SPHERE_REMEDY = (
    "put a chrome sphere of at least 40 pixels across beside the object, wholly in the frame and against a plain "
    "background, or give its centre and radius as `spheres: [{x: .., y: .., radius: ..}]` in the catalogue"
)


@dataclass(frozen=True, slots=True)
class Sphere:
    """Chrome sphere in an image.

    x, y, radius: in pixels (the centre of the top-left pixel is (0, 0), y down). Under a perspective camera the contour
    is an ellipse: its centre, and the radius of a circle of its area. score: quality of the detection, 0..1; 1 for a
    sphere that the user gave.
    """

    x: float
    y: float
    radius: float
    score: float = 1.0

    def in_crop(self, left: float, top: float) -> "Sphere":
        """Return the sphere in the pixels of a crop whose top-left pixel is (left, top)."""
        return replace(self, x=self.x - left, y=self.y - top)


def find_spheres(
    median: np.ndarray,
    maximum: np.ndarray,
    *,
    min_radius: float = 20.0,
    min_score: float = MIN_SPHERE_SCORE,
    camera: np.ndarray | None = None,
) -> list[Sphere]:
    """Find chrome spheres, best first.

    Args:
        median: temporal median (H, W), any real dtype, in levels of 8 bits.
        maximum: temporal maximum (H, W).
        min_radius: smallest radius in pixels.
        min_score: smallest product of contour score and highlight evidence.
        camera: perspective camera's matrix (3, 3); candidates are then scored and measured by virtual cameras aimed
            at them.

    Raises:
        UnusableCapture: there is no sphere.
        ValueError: the images differ in shape.
    """
    if median.shape != maximum.shape or median.ndim != 2:
        raise ValueError(f"images have shapes {median.shape} and {maximum.shape}, expected two equal (H, W)")
    candidates: list[Sphere] = []
    for level in pyramid(median, maximum):
        candidates += _candidates(level, max(min_radius / level.scale, MIN_LEVEL_RADIUS_PX))
    candidates = _distinct(candidates, 0.03)[:MAX_REFINED]
    candidates = [
        _refined_and_scored(median, maximum, sphere, camera)
        for sphere in candidates
        if sphere.score > MIN_REFINED_RATIO * candidates[0].score
    ]
    candidates.sort(key=lambda sphere: -sphere.score)
    accepted = [sphere for sphere in _distinct(candidates, 1.0) if sphere.score >= min_score]
    if not accepted:
        best = f"; the best candidate scores {candidates[0].score:.2f} of {min_score:.2f}" if candidates else ""
        raise UnusableCapture(
            f"no chrome sphere found in a frame of {median.shape[1]} x {median.shape[0]}{best}", SPHERE_REMEDY
        )
    return accepted[:MAX_SPHERES]


def refine_sphere(images: list[np.ndarray], sphere: Sphere, *, reach: float = 0.03) -> Sphere:
    """Refine a sphere to subpixel accuracy, coarse to fine; its score stays.

    The images are reduced until the radius is 40 to 80 pixels, then less and less, down to `FINE_RADIUS_PX`.

    Args:
        images: (H, W) each, the most reliable first.
        sphere: approximate, in the images' pixels.
        reach: distance searched in x, y and radius, in radii.
    """
    final_scale = 2 ** max(0, int(np.floor(np.log2(sphere.radius / FINE_RADIUS_PX))))
    scale = 2 ** max(0, int(np.floor(np.log2(sphere.radius / COARSE_RADIUS_PX))))
    x, y, radius, score = sphere.x, sphere.y, sphere.radius, sphere.score
    span = reach * radius
    while scale >= final_scale:
        # Pixel centres of a reduced image lie `shift` full pixels inside.
        shift = 0.5 * (scale - 1)
        edges = [log_gradient(reduced_image(image, scale)) for image in images]
        centre = ((x - shift) / scale, (y - shift) / scale)
        span = min(span, 8.0 * scale) / scale
        x, y, radius, _ = fit_circle(edges, *centre, radius / scale - span, radius / scale + span, reach=span, step=0.5)
        x, y, radius = x * scale + shift, y * scale + shift, radius * scale
        # The finer scale searches within one pixel of this one.
        span, scale = 1.0 * scale, scale // 2
    return Sphere(x, y, radius, score)


def highlight_evidence(residual: np.ndarray, x: float, y: float, radius: float) -> float:
    """Return how well, 0..1, the moving light stays within the inner disc of a sphere.

    residual: maximum - median, (H, W); x, y, radius: of the sphere, in its pixels.
    """
    top, left = max(int(y - radius), 0), max(int(x - radius), 0)
    window = residual[top : int(y + radius) + 2, left : int(x + radius) + 2]
    rows, columns = np.mgrid[: window.shape[0], : window.shape[1]]
    distance = np.hypot(columns + left - x, rows + top - y) / radius
    inner, ring = window[distance < 0.75], window[(distance > 0.85) & (distance < 0.97)]
    if inner.size == 0 or ring.size == 0:
        return 0.0
    peak = float(np.percentile(inner, 98.0))
    if peak <= 0.0:
        return 0.0
    # The ring is darker than the disc, hardly any of it is lit, and the disc is bright at all.
    contrast = max(1.0 - float(np.median(ring)) / peak, 0.0)
    lit = float((ring > 0.35 * peak).mean())
    return contrast * min(max(1.8 - 2.5 * lit, 0.0), 1.0) * min(peak / 100.0, 1.0)


def _candidates(level: PyramidLevel, min_radius: float) -> list[Sphere]:
    """Return scored spheres of a level, in full-frame pixels, from the strongest circles of both images."""
    radii = np.arange(0.6 * min_radius, MAX_LEVEL_RADIUS_PX + 1.0)
    # Seeds: centre, smallest and largest radius. A circle of the maximum may also be the disc of highlights inside.
    seeds: list[tuple[float, float, float, float]] = []
    for edges, has_discs in zip(level.edges, (False, True), strict=True):
        for x, y, radius in strongest_circles(edges, radii, SEEDS_PER_IMAGE):
            seeds.append((x, y, 0.94 * radius, 1.06 * radius))
            if has_discs:
                seeds.append((x, y, DISC_RADIUS_RATIOS[0] * radius, DISC_RADIUS_RATIOS[1] * radius))
    spheres: list[Sphere] = []
    for x, y, low, high in seeds:
        low, high = max(low, min_radius), min(high, 1.05 * MAX_LEVEL_RADIUS_PX)
        if low >= high or highlight_evidence(level.residual, x, y, 0.5 * (low + high)) < MIN_SEED_EVIDENCE:
            continue
        u, v, radius, _ = fit_circle(level.edges, x, y, low, high, reach=3.0, step=1.0, final_step=0.25)
        evidence = highlight_evidence(level.residual, u, v, radius)
        spheres.append(Sphere(*level.to_full_frame(u, v, radius), evidence * contour_score(level.edges, u, v, radius)))
    return spheres


def _refined_and_scored(median: np.ndarray, maximum: np.ndarray, sphere: Sphere, camera: np.ndarray | None) -> Sphere:
    if camera is not None:
        # Seen by a virtual camera aimed at it, the contour is a circle, as under an orthographic camera.
        virtual = VirtualCamera.aimed_at(sphere.x, sphere.y, sphere.radius, camera)
        centred = Sphere(virtual.centre, virtual.centre, sphere.radius)
        circle = _refined_and_scored(virtual.warp(median), virtual.warp(maximum), centred, None)
        return Sphere(*virtual.project_back(circle.x, circle.y, circle.radius), circle.score)
    refined = refine_sphere([median, maximum], sphere)
    scale = 2 ** max(0, int(np.floor(np.log2(refined.radius / COARSE_RADIUS_PX))))
    level = pyramid_level(median, maximum, scale)
    shift = 0.5 * (scale - 1)
    reduced = (refined.x - shift) / scale, (refined.y - shift) / scale, refined.radius / scale
    score = highlight_evidence(level.residual, *reduced) * contour_score(level.edges, *reduced)
    return replace(refined, score=score)


def _distinct(spheres: list[Sphere], share: float) -> list[Sphere]:
    """Keep the best of spheres that lie within `share` of a radius of one another; best first."""
    kept: list[Sphere] = []
    for sphere in sorted(spheres, key=lambda sphere: -sphere.score):
        if all(_distance(sphere, better) > share * max(sphere.radius, better.radius) for better in kept):
            kept.append(sphere)
    return kept


def _distance(first: Sphere, second: Sphere) -> float:
    """Return the distance of the centres; of concentric circles at least the difference of the radii."""
    distance = float(np.hypot(first.x - second.x, first.y - second.y))
    return max(distance, abs(first.radius - second.radius)) if distance < 0.1 * first.radius else distance
