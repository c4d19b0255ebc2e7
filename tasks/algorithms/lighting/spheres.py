"""Chrome spheres in a static camera's frame, and their measurement near a known place.

Yeung et al. 2009 take the reference sphere as given (section 3).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glint.tasks.algorithms.geometry.perspective import VirtualCamera
from glint.tasks.algorithms.lighting.contour import ContourFit, fit_contour
from glint.tasks.algorithms.lighting.contour_refinement import refine_contour
from glint.tasks.algorithms.lighting.pyramid import log_frames, reduced_image

FINE_RADIUS_PX = 300.0
"""Radius in pixels to which the image of a larger sphere is reduced: beyond it, a contour is blurred or rough by more
than a pixel."""
MIN_CLEAR_CONTRAST = 0.12
"""Contrast of a contour from which it is trusted more than a circle that was given."""
MIN_CORRECTION_RATIO, MIN_CORRECTION_PX, MIN_CORRECTION_DEVIATIONS = 0.012, 0.75, 2.0
"""Difference from a given circle, in radii, in pixels and in standard deviations, from which the fit replaces it: the
rim of a small sphere is sampled too coarsely to contradict less."""
MIN_OBSERVABLE_NZ = float(np.cos(np.radians(45.0)))
"""n_z of the half vector of a light at a right angle to the view vector; farther ones are behind the object."""
LEAST_HALF_VECTOR_SD = 0.01
"""Standard deviation per axis, radians, below which a sphere's half vectors have no more weight beside another's."""
CROP_MARGIN_RATIO = 0.35
"""Distance beyond the contour, in radii, of the crop in which a sphere is measured."""
INNER_RATIOS = 0.6, 0.91
"""Radii between which a circle may be the edge of what the sphere mirrors, in those of a circle around it that is the
contour then, although its score is lower."""
MIN_OUTER_RATIO, MAX_INNER_REACH = 0.33, 0.97
MIN_TOUCHED_RATIO, MAX_TOUCHING_REACH = 0.8, 1.03
"""Least score of that contour, relative to the inner circle's, and how far the inner circle may reach, in radii of the
contour: where it lies well inside, and where both touch. The edge of a shadow may touch the contour too, but from
outside; its score is far lower."""


@dataclass(frozen=True, slots=True)
class Sphere:
    """Chrome sphere in an image.

    x, y, radius: in pixels (the centre of the top-left pixel is (0, 0), y down). Under a perspective camera the contour
    is an ellipse: its centre, and the radius of a circle of its area. score: quality of the detection, 0..1; 1 for a
    sphere that the user gave. centre_sd, radius_sd: standard deviations in pixels, of the centre per axis; 0 if
    nothing is known.
    """

    x: float
    y: float
    radius: float
    score: float = 1.0
    centre_sd: float = 0.0
    radius_sd: float = 0.0

    def in_crop(self, left: float, top: float) -> "Sphere":
        """Return the sphere in the pixels of a crop whose top-left pixel is (left, top)."""
        return replace(self, x=self.x - left, y=self.y - top)

    def distance(self, other_sphere: "Sphere") -> float:
        """Return the distance of the centres in pixels."""
        return float(np.hypot(self.x - other_sphere.x, self.y - other_sphere.y))

    def is_inside(self, width: int, height: int, share: float = 1.0) -> bool:
        """Return whether a frame of this size holds the circle, its radius taken as a share of itself."""
        reach = share * self.radius
        return reach <= self.x <= width - 1 - reach and reach <= self.y <= height - 1 - reach

    def half_vector_sd(self, nz: np.ndarray) -> np.ndarray:
        """Return the standard deviation per axis (...), radians, of the error that the fit leaves in half vectors.

        With the sphere's normal at the angle a from the view, an error of the centre turns it by dx / (r cos a) along
        the radius and dx / r across, one of the radius by tan a dr / r along the radius: it costs most at the rim.

        nz: (...) z components of the half vectors; those beyond 45 degrees show no light, and count as at 45.
        """
        cosine = np.clip(np.asarray(nz, float), MIN_OBSERVABLE_NZ, 1.0)
        centre = (self.centre_sd / self.radius) ** 2 * 0.5 * (1.0 + 1.0 / cosine**2)
        radius = (self.radius_sd / self.radius) ** 2 * 0.5 * (1.0 / cosine**2 - 1.0)
        return np.asarray(np.sqrt(centre + radius))


@dataclass(frozen=True, slots=True)
class SphereCrop:
    """Reduced frames around a sphere.

    frames: of `log_frames`, (h, w) each. reduction: full-frame pixels per pixel. left, top: first column and row.
    """

    frames: list[np.ndarray]
    reduction: int
    left: int
    top: int

    @classmethod
    def around(
        cls, frames: Sequence[np.ndarray] | np.ndarray, sphere: Sphere, reach_ratio: float, fine_radius: float
    ) -> "SphereCrop":
        """Cut frames (T, H, W) out up to a reach in radii from the centre, and halve them while the radius is larger.

        fine_radius: in pixels, that of the reduced sphere is less than twice as large.
        """
        reach = reach_ratio * sphere.radius
        reduction = 2 ** max(0, int(np.floor(np.log2(sphere.radius / fine_radius))))
        top, left = (max(int(position - reach) // reduction * reduction, 0) for position in (sphere.y, sphere.x))
        rows, columns = slice(top, int(sphere.y + reach) + 2), slice(left, int(sphere.x + reach) + 2)
        crops = log_frames([reduced_image(np.asarray(frame[rows, columns]), reduction) for frame in frames])
        return cls(crops, reduction, left, top)

    @property
    def shift(self) -> float:
        """Distance in full-frame pixels by which pixel centres of the reduced frames lie inside."""
        return 0.5 * (self.reduction - 1)

    def from_full_frame(self, sphere: Sphere) -> tuple[float, float, float]:
        """Return a sphere's circle (x, y, radius) in the crop's pixels."""
        x, y = sphere.x - self.left - self.shift, sphere.y - self.top - self.shift
        return x / self.reduction, y / self.reduction, sphere.radius / self.reduction

    def to_full_frame(self, fit: ContourFit, score: float) -> Sphere:
        """Return the sphere of a fit in the crop's pixels."""
        variance = np.diag(fit.covariance)
        return Sphere(
            fit.x * self.reduction + (self.left + self.shift),
            fit.y * self.reduction + (self.top + self.shift),
            fit.radius * self.reduction,
            score,
            float(np.sqrt(variance[:2].mean())) * self.reduction,
            float(np.sqrt(variance[2])) * self.reduction,
        )


def precision_weights(spheres: Sequence[Sphere], nz: np.ndarray) -> np.ndarray:
    """Return the shares (S, ...) that spheres have in their mean half vector, by what their fits leave uncertain.

    nz: (S, ...) z components of the half vectors that each shows.
    """
    deviations = np.stack([sphere.half_vector_sd(component) for sphere, component in zip(spheres, nz, strict=True)])
    precision = 1.0 / (deviations**2 + LEAST_HALF_VECTOR_SD**2)
    return np.asarray(precision / precision.sum(axis=0))


def measure_sphere(
    frames: Sequence[np.ndarray] | np.ndarray,
    sphere: Sphere,
    *,
    centre_reach: float = 0.03,
    radius_reach: float = 0.04,
    camera: np.ndarray | None = None,
    refined: bool = False,
) -> Sphere:
    """Measure a sphere near a known place; its score becomes the contrast of its contour.

    Args:
        frames: (T, H, W) in levels of 8 bits, under different lights.
        sphere: approximate, in the frames' pixels.
        centre_reach: distance searched along x and along y, in radii.
        radius_reach: distance searched in radius, in radii.
        camera: perspective camera's matrix (3, 3); the sphere is then measured by a virtual camera aimed at it, which
            sees its contour as a circle.
        refined: allow for shadows and mirrored objects, in three times the time.
    """
    return measured_with_start(frames, sphere, centre_reach, radius_reach, camera, refined)[0]


def is_radius_corrected(given: float, measured: Sphere) -> bool:
    """Return whether a measured radius differs from a given one, in pixels, by more than it is uncertain."""
    return abs(given - measured.radius) > least_correction(given, measured.radius_sd)


def least_correction(radius: float, deviation: float) -> float:
    """Return the difference, in pixels, from which a measured value contradicts a given circle of some radius."""
    return max(MIN_CORRECTION_RATIO * radius, MIN_CORRECTION_PX, MIN_CORRECTION_DEVIATIONS * deviation)


def measured_with_start(
    frames: Sequence[np.ndarray] | np.ndarray,
    sphere: Sphere,
    centre_reach: float,
    radius_reach: float,
    camera: np.ndarray | None,
    refined: bool,
) -> tuple[Sphere, float]:
    """Return the measured sphere and the contrast of the circle that it began with; see `measure_sphere`."""
    if camera is not None:
        virtual = VirtualCamera.aimed_at(sphere.x, sphere.y, sphere.radius, camera)
        centred = replace(sphere, x=virtual.centre, y=virtual.centre)
        warped = [virtual.warp(np.asarray(frame, np.float32)) for frame in frames]
        circle, start = measured_with_start(warped, centred, centre_reach, radius_reach, None, refined)
        x, y, radius = virtual.project_back(circle.x, circle.y, circle.radius)
        return replace(circle, x=x, y=y, radius=radius), start
    reach_ratio = 1.0 + CROP_MARGIN_RATIO + centre_reach + radius_reach
    crop = SphereCrop.around(frames, sphere, reach_ratio, FINE_RADIUS_PX)
    fit = fit_contour(crop.frames, *crop.from_full_frame(sphere), centre_reach=centre_reach, radius_reach=radius_reach)
    if refined:
        fit = refine_contour(crop.frames, fit)
    return crop.to_full_frame(fit, max(fit.contrast, 0.0)), fit.start_contrast


def crop_around(frames: np.ndarray, sphere: Sphere, margin: float) -> tuple[np.ndarray, int, int]:
    """Return the part of frames (T, H, W) up to `margin` pixels beyond a sphere's contour, its first column and row."""
    reach = sphere.radius + margin
    left, top = max(int(sphere.x - reach), 0), max(int(sphere.y - reach), 0)
    crop = frames[:, top : int(sphere.y + reach) + 2, left : int(sphere.x + reach) + 2]
    return np.ascontiguousarray(crop), left, top


def distinct(spheres: Sequence[Sphere], share: float) -> list[Sphere]:
    """Keep the best of spheres whose circles differ by less than `share` of a radius; best first."""
    kept: list[Sphere] = []
    for sphere in sorted(spheres, key=lambda sphere: -sphere.score):
        if all(
            max(sphere.distance(better), abs(sphere.radius - better.radius)) > share * better.radius for better in kept
        ):
            kept.append(sphere)
    return kept


def outermost(spheres: list[Sphere]) -> list[Sphere]:
    """Keep of overlapping circles the best, or a larger one around it that is not much weaker, in the bests' order."""
    kept: list[Sphere] = []
    remaining = sorted(spheres, key=lambda sphere: -sphere.score)
    while remaining:
        best = remaining[0]
        around = [sphere for sphere in remaining if is_contour_around(sphere, best)]
        kept.append(max(around, key=lambda sphere: sphere.score, default=best))
        remaining = [sphere for sphere in remaining if not overlap(sphere, kept[-1])]
    return kept


def overlap(sphere: Sphere, kept: Sphere) -> bool:
    """Return whether a circle shares so much with one that is kept that both cannot be spheres."""
    return sphere.distance(kept) <= max(0.9 * kept.radius, 0.5 * (sphere.radius + kept.radius))


def is_contour_around(outer: Sphere, better: Sphere) -> bool:
    """Return whether a circle is the contour of the sphere in which a better circle is the edge of what it mirrors."""
    reach = (outer.distance(better) + better.radius) / outer.radius
    ratio = outer.score / better.score
    return INNER_RATIOS[0] < better.radius / outer.radius < INNER_RATIOS[1] and (
        (reach < MAX_INNER_REACH and ratio >= MIN_OUTER_RATIO)
        or (reach < MAX_TOUCHING_REACH and ratio >= MIN_TOUCHED_RATIO)
    )
