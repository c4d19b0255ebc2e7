"""Normals of a square or rectangular vessel, found by its silhouette and the candidates, under either camera."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from glint.tasks.algorithms.angular_bodies.angular_search import FINE_STEP_PX, AngularSearch
from glint.tasks.algorithms.angular_bodies.body_agreement import SampledCandidates
from glint.tasks.algorithms.geometry.vectors import nearest_angles, pixel_positions
from glint.tasks.algorithms.revolution.hollowness import hollow_opening
from glint.tasks.algorithms.revolution.opening import AGREES_DEG, MIN_OBSERVED_NZ, Opening, find_opening
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from glint.tasks.algorithms.revolution.symmetry import RotationalNormals, shown_normals
from glint.tasks.algorithms.silhouettes.aimed_search import AimedSearch

MIN_VESSEL_AGREEMENT, MAX_ROUNDING = 0.06, 0.75
"""Agreement of candidates from which there is such a vessel: 0.08 to 0.5 on square tumblers and bottles, up to 0.03 on
other objects; and the rounding from which its section may as well be a circle."""
EXACT_FAR_DEG, MIN_EXACT_SHARE = 2.0, 0.45
"""Angle from the far wall's normal within which a candidate is exact, and the share of exact ones among those that
agree from which an end is open: 0.6 to 0.9 on open vessels. Through the flat top of a solid block the far wall is seen
as well, but mostly 2.4 degrees beside its place: 0.2 to 0.25, and on one of four 0.8."""
MAX_NECK_SHARE, MIN_NECK_PX = 0.65, 3.0
"""Apothem relative to the largest below which the rest of a body is its neck, and the least length of one."""


@dataclass(frozen=True, eq=False)
class AngularVesselSearch(AimedSearch):
    """Search for a square or rectangular vessel in a view, on demand."""

    @cached_property
    def best(self) -> RotationalNormals | None:
        """What the view shows of the vessel with which candidates agree most; None if they show none."""
        shown = SampledCandidates.of(self._shown, self._silhouette)
        search = None if shown is None else AngularSearch(self._silhouette, shown, self._inverse_focal)
        if search is None or search.best is None:
            return None
        placement, agreement = search.best
        if agreement < MIN_VESSEL_AGREEMENT or placement.polygon.rounding > MAX_ROUNDING:
            return None
        vessel = vessel_normals(search.body(placement), self._silhouette, self._shown)
        return vessel if vessel is None or self._aimed is None else vessel.seen_back(self._aimed)


def vessel_normals(body: SurfaceOfRevolution, mask: np.ndarray, candidates: np.ndarray) -> RotationalNormals | None:
    """Return what a mask (H, W) bool shows of a vessel, whose neck is round; None if all rays miss it.

    Without tangents: turn and rounding of its section follow from the candidates, as the light's distance would.

    body: the largest inside the mask. candidates: (K, H, W, 3), relative to the view rays, NaN where there is none.
    """
    length = _neck_length(body)
    if length < MIN_NECK_PX:
        vessel = shown_normals(body, _exact_opening(body, mask, candidates), mask, candidates)
    else:
        neck = _round_neck(body, length, mask)
        trunk = shown_normals(body.cut_off(length), None, mask, candidates)
        above = shown_normals(neck, hollow_opening(neck, mask, candidates), mask, candidates)
        vessel = trunk if trunk is None or above is None else trunk.behind(above)
    return None if vessel is None else vessel._replace(tangents=None)


def _exact_opening(body: SurfaceOfRevolution, mask: np.ndarray, candidates: np.ndarray) -> Opening | None:
    """Return the opening of a body's end that faces the camera; None if it may be the flat top of a solid."""
    opening = find_opening(body, mask, candidates)
    if opening is None:
        return None
    normals, _, is_far = opening.entries(*pixel_positions(opening.around))
    is_observed = is_far & (normals[:, 2] > MIN_OBSERVED_NZ)
    nearest = nearest_angles(candidates[:, opening.around][:, is_observed], normals[is_observed])
    exact, agreeing = (np.count_nonzero(nearest < limit) for limit in (EXACT_FAR_DEG, AGREES_DEG))
    return opening if exact > MIN_EXACT_SHARE * agreeing else None


def _neck_length(body: SurfaceOfRevolution) -> float:
    """Return the length in pixels of a body's neck at the end that faces the camera, 0 if it has none."""
    apothems = np.sqrt(body.squared_radii)
    inside = np.flatnonzero(apothems > 0.0)
    inward = inside[:: -body.facing] if body.facing else inside[:0]
    is_wide = apothems[inward] > MAX_NECK_SHARE * apothems.max(initial=0.0)
    return float(is_wide.argmax() * (body.heights[1] - body.heights[0])) if is_wide.any() else 0.0


def _round_neck(body: SurfaceOfRevolution, length: float, mask: np.ndarray) -> SurfaceOfRevolution:
    """Return the surface of revolution that so many pixels of a body's length are, at the end that faces the camera."""
    neck = SurfaceOfRevolution.from_silhouette(mask, body.axis, body.tilt, FINE_STEP_PX, body.inverse_focal)
    is_neck = body.facing * (neck.heights - body.end_height) > -length
    return replace(neck, squared_radii=np.where(is_neck, neck.squared_radii, 0.0))
