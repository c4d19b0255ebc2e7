"""Surfaces of revolution: the largest one inside a silhouette, its normals along view rays, and the fit of its profile.

Source: reconstruction from a single view (Wong, Mendonca and Cipolla 2004). The contour gives the profile once axis and
tilt are known: each circle is as wide as its ellipse fits inside the silhouette.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.blur import blurred_sums
from glint.tasks.algorithms.geometry.contours import smooth_contour
from glint.tasks.algorithms.geometry.perspective import rotate_to_view
from glint.tasks.algorithms.geometry.vectors import to_camera, unit
from glint.tasks.algorithms.revolution.inscribed_sections import inscribed_sections
from glint.tasks.algorithms.revolution.profile import Plate, profile_of_contour, with_risen_plate
from glint.tasks.algorithms.revolution.view_rays import AxisFrame, RayHits, entry_depths
from glint.tasks.algorithms.sections.rounded_polygon import CIRCLE, RoundedPolygon
from glint.tasks.algorithms.silhouettes.reflection_axes import ReflectionAxis

MAX_WALL_SLOPE_DEG = 60.0
"""Angle of a normal from the circle's plane up to which it belongs to a wall, not to a flat end."""
MAX_SLOPE_CORRECTION_DEG = 30.0
"""Angle from the contour's slope beyond which a normal is not that of the wall."""
SLOPE_SIGMA_PX = 1.0
"""Standard deviation along the axis of the smoothing of slope corrections."""
MAX_SLOPE_ANGLE = 1.4
"""Bound in radians of a wall's normal from the circle's plane, which keeps its slope finite."""
CONTOUR_SLOPE_WEIGHT = 5.0
"""Weight of the contour's slope at a height, in normals."""
END_CONE_DEG, END_PX = 25.0, 2.0
"""Angle from the axis, and distance along it from the end of the wall, up to which normals belong to a flat end; the
distance is at least a step of the profile."""


@dataclass(frozen=True, slots=True)
class SurfaceOfRevolution:
    """Surface of revolution before a camera, or one with another section than a circle; lengths in pixels.

    Normals are relative to the view rays, which are parallel unless `inverse_focal` is given. The apothems of other
    sections take the place of radii.

    axis: its image. tilt: of its upper end towards the camera, radians. heights: (N,), samples along the axis.
    squared_radii: (N,) at these heights. half_slopes: (N,), half the slopes of the squared radii, that is radius times
    its slope. plates: that face the camera, drawn flat at the height of their edge. inverse_focal: see `AxisFrame`.
    section: the same at each height, but for its size.
    """

    axis: ReflectionAxis
    tilt: float
    heights: np.ndarray
    squared_radii: np.ndarray
    half_slopes: np.ndarray
    plates: tuple[Plate, ...] = ()
    inverse_focal: float = 0.0
    section: RoundedPolygon = CIRCLE

    @classmethod
    def from_silhouette(
        cls,
        mask: np.ndarray,
        axis: ReflectionAxis,
        tilt: float,
        step: float = 0.5,
        inverse_focal: float = 0.0,
        section: RoundedPolygon = CIRCLE,
    ) -> "SurfaceOfRevolution":
        """Return the largest surface with that axis and tilt (radians) inside a silhouette (H, W) bool.

        step: distance of the samples along the axis in pixels, and about twice that of the contour's points.
        """
        contour = smooth_contour(mask)[:: max(1, int(step / 2))]
        frame = AxisFrame.of(axis, tilt, inverse_focal)
        rays = frame.rays(*to_camera(contour[:, 0], contour[:, 1], mask.shape[1], mask.shape[0]))
        heights, radii = inscribed_sections(rays, step, section)
        squared, slopes, plates = profile_of_contour(radii, heights, section.edge_on_tilts(frame.tilts(heights)))
        return cls(axis, tilt, heights, squared, slopes / 2.0, plates, inverse_focal, section)

    def tilted(self, mask: np.ndarray, tilt: float, step: float = 0.5) -> "SurfaceOfRevolution":
        """Return the largest surface inside the silhouette (H, W) bool with another tilt, see `from_silhouette`."""
        return SurfaceOfRevolution.from_silhouette(mask, self.axis, tilt, step, self.inverse_focal, self.section)

    @property
    def frame(self) -> AxisFrame:
        """Frame of the axis."""
        return AxisFrame.of(self.axis, self.tilt, self.inverse_focal)

    @property
    def facing(self) -> int:
        """Which end faces the camera: 1 the upper one, -1 the lower one, 0 neither."""
        body = self.heights[self.squared_radii > 0.0]
        if len(body) == 0:
            return 0
        lower, upper = self.frame.tilts(body[[0, -1]])
        return int(upper > 0.0) - int(lower < 0.0)

    @property
    def end_tilt(self) -> float:
        """Tilt of the axis as the camera sees it at the end that faces it, radians."""
        return float(self.frame.tilts(np.array(self.end_height)))

    def normals(self, x: np.ndarray, y: np.ndarray, far: bool = False) -> np.ndarray:
        """Return the unit normals (N, 3) where the rays of x, y (N,) enter the body, NaN for rays that miss it.

        far: instead those of the wall's inner side, where the rays leave the body.
        """
        return self.normals_at(self.intersect(x, y, far)) * (-1.0 if far else 1.0)

    @property
    def end_radius(self) -> float:
        """Radius of the end that faces the camera."""
        return float(np.sqrt(self.squared_radii[self._end]))

    @property
    def end_height(self) -> float:
        """Height along the axis of the end that faces the camera."""
        return float(self.heights[self._end])

    def is_end(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return whether rays at x, y (N,), camera frame, enter the body through the flat end that faces the camera."""
        return self.is_end_at(self.intersect(x, y))

    def is_end_at(self, hits: RayHits) -> np.ndarray:
        """Return whether N rays enter the body through the flat end that faces the camera."""
        axial = (self.normals_at(hits) * hits.upward).sum(axis=1) * self.facing
        is_flat = axial > np.cos(np.radians(END_CONE_DEG))
        # Radii fall to 0 over one step beyond the wall, which is longer on large objects.
        reach = max(END_PX, float(self.heights[1] - self.heights[0]))
        return np.asarray(is_flat & (np.abs(hits.heights - self.end_height) < reach))

    @property
    def slope_angles(self) -> np.ndarray:
        """Angles (N,) in radians of the profile's normals from the circles' planes, positive upward."""
        return np.asarray(np.arctan2(-self.half_slopes, np.sqrt(self.squared_radii)))

    @property
    def is_wall(self) -> np.ndarray:
        """Whether the profile is that of a wall, not of a flat end, at each sample (N,)."""
        return np.asarray(np.abs(self.slope_angles) < np.radians(MAX_WALL_SLOPE_DEG))

    def with_slope_angles(self, slope_angles: np.ndarray) -> "SurfaceOfRevolution":
        """Return the surface with its wall's normals at these angles (N,) in radians; flat ends are left unchanged."""
        slopes = np.tan(slope_angles.clip(-MAX_SLOPE_ANGLE, MAX_SLOPE_ANGLE))
        half_slopes = np.where(self.is_wall, -np.sqrt(self.squared_radii) * slopes, self.half_slopes)
        return replace(self, half_slopes=half_slopes)

    def shrunk(self, thickness: float) -> "SurfaceOfRevolution":
        """Return the surface with its radii smaller by a thickness in pixels: the inner side of the wall."""
        radii = np.sqrt(self.squared_radii)
        inner = np.maximum(radii - thickness, 0.0)
        share = inner / np.where(radii > 0.0, radii, 1.0)
        return replace(self, squared_radii=inner**2, half_slopes=self.half_slopes * share)

    def cut_off(self, length: float) -> "SurfaceOfRevolution":
        """Return the surface without so many pixels of its length at the end that faces the camera, which is flat then.

        Where neither end faces the camera nothing is cut off.
        """
        body = np.flatnonzero(self.squared_radii > 0.0)
        count = min(round(length / (self.heights[1] - self.heights[0])), len(body) - 1)
        if not self.facing or count == 0:
            return self
        squared, half_slopes = self.squared_radii.copy(), self.half_slopes.copy()
        beyond = slice(int(body[-count]), None) if self.facing > 0 else slice(None, int(body[count - 1]) + 1)
        end = slice(beyond.start - 1, None) if self.facing > 0 else slice(None, beyond.stop + 1)
        squared[beyond] = 0.0
        half_slopes[end] = np.gradient(squared, self.heights)[end] / 2.0
        return replace(self, squared_radii=squared, half_slopes=half_slopes)

    def intersect(self, x: np.ndarray, y: np.ndarray, far: bool = False) -> RayHits:
        """Intersect the rays of x, y (N,), camera frame, where they enter the body; far: where they leave it."""
        frame = self.frame
        rays = frame.rays(x, y)
        spans = float(np.sqrt(self.squared_radii.max())), float(np.abs(self.heights).max())
        reach = (
            spans[0] * self.section.circumradius * abs(frame.vectors[1, 2]) + spans[1] * abs(frame.vectors[2, 2]) + 1.0
        )
        depths = entry_depths(rays, self.heights, self.squared_radii, reach, far, self.section)
        points = rays.at(depths)
        around, apothems = points[:, :2], self.section.apothems(points[:, :2])
        if not self.section.is_circle:
            around = apothems[:, None] * self.section.gradients(around)
        outward, upward = around @ frame.vectors[:2], np.broadcast_to(frame.upward, points.shape)
        view = frame.view_vectors(x, y)
        if view is not None:
            outward, upward = rotate_to_view(outward, view), rotate_to_view(upward, view)
        return RayHits(points[:, 2], depths, points[:, 0], points[:, 1], apothems, outward, upward)

    def with_risen_plates(self, x: np.ndarray, y: np.ndarray, normals: np.ndarray) -> "SurfaceOfRevolution":
        """Return the surface with plates that rise to their stems, as far as normals (N, 3) at x, y (N,) show these."""
        surface, step = self, self.heights[1] - self.heights[0]
        # Rays hit a wider stem higher up: the second time, each normal is placed better.
        for _ in range(2 if self.plates else 0):
            hits = surface.intersect(x, y)
            slope = -np.tan(surface._measured_angles(hits, normals))
            sample = np.rint((hits.heights - self.heights[0]) / step)
            used = np.isfinite(sample) & (np.abs(slope) < np.tan(np.radians(MAX_WALL_SLOPE_DEG)))
            place, length = sample[used].astype(int), len(self.heights)
            count, total = (
                ndimage.uniform_filter1d(np.bincount(place, values, minlength=length)[:length].astype(float), 3)
                for values in (np.ones(len(place)), slope[used])
            )
            slopes = np.where(count >= 1.0, total / np.maximum(count, 1.0), np.nan)
            squared = self.squared_radii
            for plate in self.plates:
                squared = with_risen_plate(squared, self.heights, plate, slopes)
            changed = squared != self.squared_radii
            half_slopes = np.where(changed, np.gradient(squared, self.heights) / 2.0, self.half_slopes)
            surface = replace(self, squared_radii=squared, half_slopes=half_slopes)
        return surface

    def with_fitted_slopes(self, x: np.ndarray, y: np.ndarray, normals: np.ndarray) -> "SurfaceOfRevolution":
        """Return the surface with its profile's slopes corrected by measured normals.

        The silhouette gives radii to subpixel accuracy but slopes only to several degrees; a normal gives the slope to
        one degree, for its whole circle. The slope at each height is corrected by the mean residual, smoothed along
        the axis and applied twice (Tukey's twicing). Flat ends are left unchanged.

        x, y: (N,), camera frame. normals: (N, 3), measured there.
        """
        hits, step = self.intersect(x, y), self.heights[1] - self.heights[0]
        angle, measured = self.slope_angles, self._measured_angles(hits, normals)
        for _ in range(2):
            residual = measured - np.interp(hits.heights, self.heights, angle)
            used = np.isfinite(residual) & (np.abs(residual) < np.radians(MAX_SLOPE_CORRECTION_DEG))
            sample = np.rint((hits.heights[used] - self.heights[0]) / step).astype(int).clip(0, len(angle) - 1)
            total, sums = blurred_sums(sample, np.ones(len(sample)), residual[used], len(angle), SLOPE_SIGMA_PX / step)
            angle = angle + np.where(self.is_wall, sums / (total + CONTOUR_SLOPE_WEIGHT), 0.0)
        return self.with_slope_angles(angle)

    @property
    def _end(self) -> int:
        """Number of the last sample of the wall before the end that faces the camera."""
        body = np.flatnonzero(self.squared_radii > 0.0)
        return 0 if len(body) == 0 else int(body[-1] if self.facing > 0 else body[0])

    def normals_at(self, hits: RayHits) -> np.ndarray:
        """Return the unit normals (N, 3) that point out of the body."""
        axial = -np.interp(hits.heights, self.heights, self.half_slopes)
        return np.asarray(unit(hits.outward + axial[:, None] * hits.upward))

    def _measured_angles(self, hits: RayHits, normals: np.ndarray) -> np.ndarray:
        """Return the angles (N,) of normals (N, 3) from their circles' planes, positive upward."""
        radius = (hits.outward**2).sum(axis=1) / hits.apothems
        axial, radial = ((normals * directions).sum(axis=1) for directions in (hits.upward, hits.outward))
        return np.asarray(np.arctan2(radius * axial, radial))
