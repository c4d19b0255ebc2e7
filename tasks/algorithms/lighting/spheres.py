"""Mirror balls in a static camera's frame: found from the temporal median and maximum, refined below a pixel.

Two things together tell a mirror ball from everything round. Its outline is a circle, edges along which point at one
centre. And in the temporal maximum the lamp's highlights lie within r sin 45 of the centre (lamps before the object)
while the ring inside the outline stays as it was: glass lights up to its rim and beyond.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.perspective import Turned
from glint.tasks.algorithms.lighting.circles import EdgePicture, edge_picture, fit_outline, outline, strongest_circles

MOST = 8
"""Spheres returned at most."""

SMALLEST, LARGEST = 18.0, 44.0
"""Radii looked for on a pyramid level, in its pixels; larger balls are found on coarser levels."""

FINE = 150.0
"""Radius in pixels that a ball has at least where it is measured, if the frame has so many."""

SEEDS = 25
"""Strongest circles of each picture and level that are examined as balls."""

EXAMINED = 12
"""Best candidates that are refined at the finest scale and judged again there."""

LEAST_SCORE = 0.14
"""Least product of outline and highlight evidence."""

REMEDY = (
    "put a chrome ball of at least 40 pixels across beside the object, wholly in the frame and against a plain "
    "background, or give its centre and radius as `spheres: [{x: .., y: .., radius: ..}]` in the catalogue"
)


@dataclass(frozen=True, slots=True)
class Sphere:
    """A mirror ball: centre x, y and radius in pixels (centre of the top-left pixel = (0, 0), y down).

    Under a perspective camera the outline is an ellipse: its centre, and the radius of a circle of its area.
    `score` in 0..1 says how well it was seen; a sphere that the user gave has 1.
    """

    x: float
    y: float
    radius: float
    score: float = 1.0

    def within(self, left: float, top: float) -> "Sphere":
        """The same sphere in the pixels of a crop whose top-left pixel is (left, top)."""
        return replace(self, x=self.x - left, y=self.y - top)


@dataclass(frozen=True, slots=True)
class Level:
    """A pyramid level: its pictures, their edges and the scale to full-frame pixels."""

    typical: np.ndarray
    excess: np.ndarray
    edges: list[EdgePicture]
    scale: float

    def full(self, x: float, y: float, radius: float, score: float) -> Sphere:
        """A circle of this level in full-frame pixels."""
        shift = 0.5 * (self.scale - 1.0)
        return Sphere(x * self.scale + shift, y * self.scale + shift, radius * self.scale, score)


def find_spheres(
    typical: np.ndarray,
    brightest: np.ndarray,
    *,
    smallest_radius: float = 20.0,
    least_score: float = LEAST_SCORE,
    camera: np.ndarray | None = None,
) -> list[Sphere]:
    """Mirror balls of at least `smallest_radius` pixels, best first.

    `typical` (H, W) is the static picture (temporal median), `brightest` (H, W) the temporal maximum, any real dtype.
    With a perspective camera's matrix (3, 3) candidates are judged and measured as a camera turned to them sees them.
    Raises UnusableCapture where there is none.
    """
    if typical.shape != brightest.shape or typical.ndim != 2:
        raise ValueError(f"pictures have shapes {typical.shape} and {brightest.shape}, expected two equal (H, W)")
    found: list[Sphere] = []
    for level in pyramid(typical, brightest):
        found += _balls(level, max(smallest_radius / level.scale, SMALLEST))
    found = _distinct(found, 0.03)[:EXAMINED]
    found = [_judged(typical, brightest, sphere, camera) for sphere in found if sphere.score > 0.25 * found[0].score]
    found.sort(key=lambda sphere: -sphere.score)
    kept = [sphere for sphere in _distinct(found, 1.0) if sphere.score >= least_score]
    if not kept:
        best = f"; the best candidate scores {found[0].score:.2f} of {least_score:.2f}" if found else ""
        raise UnusableCapture(
            f"no mirror ball found in a frame of {typical.shape[1]} x {typical.shape[0]}{best}", REMEDY
        )
    return kept[:MOST]


def refine_sphere(pictures: list[np.ndarray], sphere: Sphere, *, reach: float = 0.03) -> Sphere:
    """The sphere whose outline fits the pictures (H, W) best within `reach` of its radius, to a fraction of a pixel.

    From a scale where the radius is some 40 to 80 pixels down to the coarsest one where it is `FINE` or the full one:
    the outline of a larger ball is out of focus or rough by more than a pixel.
    """
    finest = 2 ** max(0, int(np.floor(np.log2(sphere.radius / FINE))))
    scale = 2 ** max(0, int(np.floor(np.log2(sphere.radius / 40.0))))
    x, y, radius, score = sphere.x, sphere.y, sphere.radius, sphere.score
    span = reach * radius
    while scale >= finest:
        shift = 0.5 * (scale - 1)
        edges = [edge_picture(_shrunk(picture, scale)) for picture in pictures]
        centre = ((x - shift) / scale, (y - shift) / scale)
        span = min(span, 8.0 * scale) / scale
        x, y, radius, _ = fit_outline(
            edges, *centre, radius / scale - span, radius / scale + span, reach=span, step=0.5
        )
        x, y, radius = x * scale + shift, y * scale + shift, radius * scale
        span, scale = 1.0 * scale, scale // 2
    return Sphere(x, y, radius, score)


def pyramid(typical: np.ndarray, brightest: np.ndarray) -> list[Level]:
    """Levels of halved pictures, down to where a ball of the frame's size has the largest radius looked for."""
    levels, scale = [], 1
    while min(typical.shape) / scale >= 2 * SMALLEST:
        levels.append(_level(typical, brightest, scale))
        if min(typical.shape) / scale < 2 * LARGEST:
            break
        scale *= 2
    return levels


def _level(typical: np.ndarray, brightest: np.ndarray, scale: int) -> Level:
    pair = [_shrunk(picture, scale) for picture in (typical, brightest)]
    return Level(pair[0], pair[1] - pair[0], [edge_picture(picture) for picture in pair], float(scale))


def highlight_evidence(excess: np.ndarray, x: float, y: float, radius: float) -> float:
    """How far, 0..1, the moving light kept to the inner disc of a ball in `excess` (H, W) = maximum - median."""
    top, left = max(int(y - radius), 0), max(int(x - radius), 0)
    window = excess[top : int(y + radius) + 2, left : int(x + radius) + 2]
    rows, columns = np.mgrid[: window.shape[0], : window.shape[1]]
    slope = np.hypot(columns + left - x, rows + top - y) / radius
    inner, ring = window[slope < 0.75], window[(slope > 0.85) & (slope < 0.97)]
    if inner.size == 0 or ring.size == 0:
        return 0.0
    bright = float(np.percentile(inner, 98.0))
    if bright <= 0.0:
        return 0.0
    dark = max(1.0 - float(np.median(ring)) / bright, 0.0)
    lit = float((ring > 0.35 * bright).mean())
    return dark * min(max(1.8 - 2.5 * lit, 0.0), 1.0) * min(bright / 100.0, 1.0)


def _balls(level: Level, smallest: float) -> list[Sphere]:
    radii = np.arange(0.6 * smallest, LARGEST + 1.0)
    seeds: list[tuple[float, float, float, float]] = []
    for edges, discs in zip(level.edges, (False, True), strict=True):
        for x, y, radius in strongest_circles(edges, radii, SEEDS):
            seeds.append((x, y, 0.94 * radius, 1.06 * radius))
            if discs:
                seeds.append((x, y, 1.25 * radius, 1.7 * radius))
    balls: list[Sphere] = []
    for x, y, least, largest in seeds:
        least, largest = max(least, smallest), min(largest, 1.05 * LARGEST)
        if least >= largest or highlight_evidence(level.excess, x, y, 0.5 * (least + largest)) < 0.1:
            continue
        u, v, radius, _ = fit_outline(level.edges, x, y, least, largest, reach=3.0, step=1.0, finest=0.25)
        evidence = highlight_evidence(level.excess, u, v, radius)
        balls.append(level.full(u, v, radius, evidence * outline(level.edges, u, v, radius)))
    return balls


def _shrunk(picture: np.ndarray, scale: int) -> np.ndarray:
    picture = picture.astype(np.float32)
    if scale == 1:
        return picture
    height, width = (side // scale * scale for side in picture.shape)
    return cv2.resize(picture[:height, :width], (width // scale, height // scale), interpolation=cv2.INTER_AREA)


def _judged(typical: np.ndarray, brightest: np.ndarray, sphere: Sphere, camera: np.ndarray | None) -> Sphere:
    if camera is not None:
        turned = Turned.to(sphere.x, sphere.y, sphere.radius, camera)
        there = Sphere(turned.middle, turned.middle, sphere.radius)
        seen = _judged(turned.picture(typical), turned.picture(brightest), there, None)
        return Sphere(*turned.back(seen.x, seen.y, seen.radius), seen.score)
    refined = refine_sphere([typical, brightest], sphere)
    scale = 2 ** max(0, int(np.floor(np.log2(refined.radius / 40.0))))
    level = _level(typical, brightest, scale)
    shift = 0.5 * (scale - 1)
    circle = (refined.x - shift) / scale, (refined.y - shift) / scale, refined.radius / scale
    return replace(refined, score=highlight_evidence(level.excess, *circle) * outline(level.edges, *circle))


def _distinct(spheres: list[Sphere], share: float) -> list[Sphere]:
    """The best of the spheres that lie within `share` of a radius of one another, best first."""
    kept: list[Sphere] = []
    for one in sorted(spheres, key=lambda sphere: -sphere.score):
        if all(_distance(one, other) > share * max(one.radius, other.radius) for other in kept):
            kept.append(one)
    return kept


def _distance(first: Sphere, second: Sphere) -> float:
    """Between centres where circles lie apart; at least the difference of the radii where they are concentric."""
    apart = float(np.hypot(first.x - second.x, first.y - second.y))
    return max(apart, abs(first.radius - second.radius)) if apart < 0.1 * first.radius else apart
