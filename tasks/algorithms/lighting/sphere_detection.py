"""Detection of chrome spheres in a capture's frames.

Edge gradients that point at one centre (Kimme, Ballard and Sklansky 1975) give seeds: a sphere's contour, the edge
inside it where the mirrored table ends, or the disc that the light's highlights fill. Around each seed the contour is
the outermost circle with evidence of its own over the frames: beyond it there is nothing that is round. A chrome sphere
shows one moving highlight within r sin 45 of its centre (lights before the object), while the ring inside the contour
stays as it was; glass lights up to its contour and beyond.
"""

from dataclasses import replace

import numpy as np

from glint.tasks.algorithms.errors import UnusableSphere
from glint.tasks.algorithms.lighting.circles import sample_rays, strongest_circles
from glint.tasks.algorithms.lighting.contour import (
    OUTSIDE_RATIOS,
    fit_contour,
    level_evidence,
    radius_profile,
)
from glint.tasks.algorithms.lighting.pyramid import (
    MAX_LEVEL_RADIUS_PX,
    MIN_LEVEL_RADIUS_PX,
    PyramidLevel,
    pyramid,
    pyramid_level,
    spread,
)
from glint.tasks.algorithms.lighting.sphere_tests import highlight_evidence, reason_against_chrome
from glint.tasks.algorithms.lighting.spheres import (
    Sphere,
    distinct,
    is_contour_around,
    measure_sphere,
    outermost,
    overlap,
)

MAX_SPHERES = 8
"""Most spheres of a capture."""
SEED_FRAMES, CANDIDATE_FRAMES, FIT_FRAMES = 12, 32, 128
"""Frames, spread over the capture, in which spheres are sought, and by which candidates and then spheres are
measured."""
SEEDS_PER_IMAGE = 25
"""Strongest circles of each image and level that are examined as spheres."""
SEED_RADIUS_RATIOS = 0.92, 1.75
"""Radius of a sphere relative to that of a seed: lowest, highest (the disc of highlights)."""
SEED_CENTRE_RATIO = 0.12
"""Distance of a sphere's centre from that of a seed along x and y, in radii: seen obliquely, what ends inside the
contour is not concentric."""
SEED_STEP_RATIO, SEED_CENTRE_STEP_RATIO = 0.02, 0.04
"""Steps of the radii and of the centres that are searched about a seed, in radii."""
PROBE_RATIOS = 1.0, 1.2, 1.45, 1.7
"""Radii about a seed, in its radii, of which one must show highlights as a sphere does for contours to be sought."""
SEED_RAYS = 32
"""Rays from a seed along which contours are sought."""
DISTINCT_SEEDS, DISTINCT_CANDIDATES, DISTINCT_CIRCLES = 0.08, 0.04, 0.06
"""Differences of centre or radius, in radii, from which two seeds, candidates and measured circles are not one."""
MIN_HIGHLIGHT_EVIDENCE = 0.1
"""Highlight evidence below which a circle is no sphere."""
MIN_CONTOUR_CONTRAST = 0.08
"""Evidence of a contour beyond that outside it, below which it is none."""
WHOLE_RATIO = 0.99
"""Share of a circle's radius that the frame must hold around its centre for the circle to count as whole."""
MAX_HIDDEN_RATIO = 0.5
"""Largest radius of circles that are still examined inside a circle that is no chrome sphere, relative to its own: such
a circle may go round a sphere and the glass beside it, but larger ones may be a part of that glass."""
MAX_REFINED = 12
"""Best candidates that are measured at full resolution."""
MIN_SPHERE_RADIUS_PX = 20.0
"""Radius of the smallest sphere that is looked for."""
MIN_SPHERE_SCORE = 0.06
"""Lower bound of the product of contour contrast and highlight evidence."""
MAX_MOVES, MOVED_RATIO = 3, 0.015
"""Most measurements from the result of the one before, and the difference of the two, in radii, from which there is
another one."""
LEVEL_RADIUS_PX, LEVEL_REACH_RATIO = 40.0, 1.45
"""Radius to which a measured sphere's image is reduced at most for its score, and the reach of that image, in radii."""

SPHERE_REMEDY = (
    "put a chrome sphere of at least 40 pixels across beside the object, wholly in the frame and against a plain "
    "background, or give its centre and radius as `spheres: [{x: .., y: .., radius: ..}]` in the catalogue, "
    "or known lights as `lights`"
)
CUT_OFF_REMEDY = (
    "record again with all of the sphere in the frame, or crop the video less; if there is a whole sphere too, give "
    "its centre and radius as `spheres: [{x: .., y: .., radius: ..}]` in the catalogue"
)


def find_spheres(
    frames: np.ndarray,
    maximum: np.ndarray,
    camera: np.ndarray | None = None,
) -> list[Sphere]:
    """Find chrome spheres and measure them, whether their lights agree or not; those inside other circles come last.

    Args:
        frames: (T, H, W) in levels of 8 bits, spread evenly over the capture.
        maximum: temporal maximum (H, W) of the whole capture.
        camera: perspective camera's matrix (3, 3); spheres are then measured by virtual cameras aimed at them.

    Raises:
        UnusableSphere: there is no sphere, or the frame cuts it off.
        ValueError: the images differ in shape.
    """
    if frames.ndim != 3 or frames.shape[1:] != maximum.shape:
        raise ValueError(f"images have shapes {frames.shape} and {maximum.shape}, expected (T, H, W) and (H, W)")
    refined, cut_off = clear_circles(frames, maximum, camera)
    clear = [sphere for sphere in refined if sphere.score >= MIN_SPHERE_SCORE]
    accepted, rejected = _chrome_spheres(frames, clear, camera)
    cut_off = _cut_off_spheres(frames, cut_off, camera)
    # Of a sphere that is cut off, what it mirrors may end wholly in the frame.
    accepted = [sphere for sphere in accepted if not any(is_contour_around(contour, sphere) for contour in cut_off)]
    if not accepted and cut_off:
        contour = cut_off[0]
        raise UnusableSphere(
            f"the chrome sphere at ({contour.x:.0f}, {contour.y:.0f}) with radius {contour.radius:.0f} is cut off by"
            f" the frame of {maximum.shape[1]} x {maximum.shape[0]} pixels",
            CUT_OFF_REMEDY,
        )
    if not accepted:
        best = max((sphere.score for sphere in refined), default=None)
        reasons = "".join(f"; {reason}" for reason in rejected) or (
            "" if best is None else f"; the best candidate scores {best:.3f}, less than {MIN_SPHERE_SCORE:.3f}"
        )
        raise UnusableSphere(
            f"no chrome sphere found in a frame of {maximum.shape[1]} x {maximum.shape[0]}{reasons}", SPHERE_REMEDY
        )
    accepted, all_frames = accepted[:MAX_SPHERES], spread(frames, FIT_FRAMES)
    measured = [measure_sphere(all_frames, sphere, camera=camera, refined=True) for sphere in accepted]
    return [replace(after, score=before.score) for before, after in zip(accepted, measured, strict=True)]


def clear_circles(
    frames: np.ndarray, maximum: np.ndarray, camera: np.ndarray | None
) -> tuple[list[Sphere], list[Sphere]]:
    """Return the circles with contour and highlights of a sphere, chrome or glass, best first; see `find_spheres`.

    The second list is of those that the frame cuts off.
    """
    candidates: list[Sphere] = []
    few = spread(frames, SEED_FRAMES)
    for level in pyramid(few, maximum):
        candidates += _candidates(level, max(MIN_SPHERE_RADIUS_PX / level.reduction, MIN_LEVEL_RADIUS_PX))
    candidates = distinct(candidates, DISTINCT_CANDIDATES)[:MAX_REFINED]
    many = spread(frames, CANDIDATE_FRAMES)
    circles = [_refined(many, few, maximum, sphere, camera) for sphere in candidates]
    height, width = maximum.shape
    whole = [circle for circle in circles if circle.is_inside(width, height, WHOLE_RATIO)]
    cut_off = [circle for circle in circles if circle not in whole]
    return distinct(whole, DISTINCT_CIRCLES), distinct(cut_off, DISTINCT_CIRCLES)


def _candidates(level: PyramidLevel, min_radius: float) -> list[Sphere]:
    """Return scored spheres of a level, in full-frame pixels, from the strongest circles of its images."""
    radii = np.arange(0.6 * min_radius, MAX_LEVEL_RADIUS_PX + 1.0)
    seeds = [
        Sphere(*circle, score=1.0 / (1 + order))
        for edges in level.edges
        for order, circle in enumerate(strongest_circles(edges, radii, SEEDS_PER_IMAGE))
    ]
    seeds += [Sphere(*disc) for disc in level.lit_discs()]
    spheres: list[Sphere] = []
    for seed in distinct(seeds, DISTINCT_SEEDS):
        largest = min(SEED_RADIUS_RATIOS[1] * seed.radius, 1.1 * MAX_LEVEL_RADIUS_PX)
        grid = np.arange(max(SEED_RADIUS_RATIOS[0] * seed.radius, min_radius), largest, SEED_STEP_RATIO * seed.radius)
        probes = seed.radius * np.array(PROBE_RATIOS)
        if len(grid) < 3 or not any(
            highlight_evidence(level.residual, seed.x, seed.y, radius) > MIN_HIGHLIGHT_EVIDENCE for radius in probes
        ):
            continue
        for x, y, radius, contrast in _contours(level, seed, grid):
            fit = fit_contour(level.frames, x, y, radius, centre_reach=0.02, radius_reach=0.03)
            score = contrast * highlight_evidence(level.residual, fit.x, fit.y, fit.radius)
            spheres.append(Sphere(*level.to_full_frame(fit.x, fit.y, fit.radius), score))
    return [sphere for sphere in spheres if sphere.score > 0.0]


def _contours(level: PyramidLevel, seed: Sphere, radii: np.ndarray) -> list[tuple[float, float, float, float]]:
    """Return the circles (x, y, radius, contrast) about a seed that may be contours: peaks over the radius."""
    step = SEED_STEP_RATIO * seed.radius
    beyond = np.append(radii, np.arange(radii[-1], OUTSIDE_RATIOS[1] * radii[-1], step)[1:])
    samples = sample_rays(level.frames, seed.x, seed.y, 0.8 * radii[0], 1.15 * beyond[-1], SEED_RAYS)
    evidence = level_evidence(samples)
    reach, centre_step = SEED_CENTRE_RATIO * seed.radius, SEED_CENTRE_STEP_RATIO * seed.radius
    profile = radius_profile(evidence, reach, beyond, centre_step)
    scores = profile[:, 2]
    circles = []
    for k, radius in enumerate(radii):
        outside = (beyond > OUTSIDE_RATIOS[0] * radius) & (beyond <= OUTSIDE_RATIOS[1] * radius)
        contrast = float(scores[k] - scores[outside].mean())
        if scores[k] >= scores[max(k - 2, 0) : k + 3].max() and contrast > MIN_CONTOUR_CONTRAST:
            circles.append((seed.x + profile[k, 0], seed.y + profile[k, 1], float(radius), contrast))
    return circles


def _refined(
    frames: np.ndarray, few: np.ndarray, maximum: np.ndarray, sphere: Sphere, camera: np.ndarray | None
) -> Sphere:
    """Measure a candidate at full resolution; its score is the product of contour contrast and highlight evidence."""
    measured = measure_sphere(frames, sphere, camera=camera)
    for _ in range(MAX_MOVES):
        if max(measured.distance(sphere), abs(measured.radius - sphere.radius)) < MOVED_RATIO * sphere.radius:
            break
        # The best circle may lie beyond the ones that were searched.
        sphere, measured = measured, measure_sphere(frames, measured, camera=camera)
    reach = LEVEL_REACH_RATIO * measured.radius
    top, left = max(int(measured.y - reach), 0), max(int(measured.x - reach), 0)
    window = slice(top, int(measured.y + reach) + 2), slice(left, int(measured.x + reach) + 2)
    reduction = 2 ** max(0, int(np.floor(np.log2(measured.radius / LEVEL_RADIUS_PX))))
    level = pyramid_level([frame[window] for frame in few], maximum[window], reduction)
    x, y, radius = level.from_full_frame(measured.x - left, measured.y - top, measured.radius)
    return replace(measured, score=measured.score * highlight_evidence(level.residual, x, y, radius))


def _chrome_spheres(
    frames: np.ndarray, circles: list[Sphere], camera: np.ndarray | None
) -> tuple[list[Sphere], list[str]]:
    """Return the circles that are chrome spheres, and of the others a sentence on why they are none."""
    accepted, rejected = list[Sphere](), list[str]()
    while circles:
        refused = []
        for circle in outermost(circles):
            reason = reason_against_chrome(frames, circle, camera)
            if reason is None:
                accepted.append(circle)
            else:
                refused.append(circle)
                rejected.append(f"the circle at ({circle.x:.0f}, {circle.y:.0f}) is no chrome sphere: {reason}")
        circles = [circle for circle in circles if _is_left(circle, accepted, refused)]
    return accepted, rejected


def _cut_off_spheres(frames: np.ndarray, circles: list[Sphere], camera: np.ndarray | None) -> list[Sphere]:
    """Return the chrome spheres, best first, of circles that the frame cuts off."""
    height, width = frames.shape[1:]
    clear = [
        circle
        for circle in circles
        if circle.score >= MIN_SPHERE_SCORE and 0 <= circle.x < width and 0 <= circle.y < height
    ]
    return [circle for circle in outermost(clear) if reason_against_chrome(frames, circle, camera) is None]


def _is_left(circle: Sphere, accepted: list[Sphere], refused: list[Sphere]) -> bool:
    """Return whether a circle is left to be judged: it overlaps none accepted, and of those refused only far larger."""
    is_smaller = all(circle.radius < MAX_HIDDEN_RATIO * other.radius for other in refused if overlap(circle, other))
    return is_smaller and not any(overlap(circle, other) for other in accepted)
