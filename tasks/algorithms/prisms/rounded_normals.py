"""Normals of a right prism with rounded edges, found by its silhouette and the candidates, under either camera.

Most faces of a block of glass never show the light, and through those that do its other faces are seen: hardly any
candidate is true, and no smooth field is near. But its silhouette leaves few prisms to choose from, and one number, the
slope of the axis, for each; the highlights of its edges choose among them.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter

import numpy as np

from glint.tasks.algorithms.geometry.distance import with_nearest
from glint.tasks.algorithms.geometry.perspective import centred_view_vectors, rotate_to_view
from glint.tasks.algorithms.geometry.vectors import pixel_positions
from glint.tasks.algorithms.prisms.polyhedron import PolyhedralNormals, PolyhedronSearch, climbed, sampled_middle
from glint.tasks.algorithms.prisms.prism_evidence import FLASHED_DEG
from glint.tasks.algorithms.prisms.right_prism import right_prisms
from glint.tasks.algorithms.prisms.rounded_contour import rounded_contours
from glint.tasks.algorithms.prisms.rounded_evidence import ShownCandidates, mean_deviation, rounded_log_ratio
from glint.tasks.algorithms.prisms.rounded_prism import RoundedPrism

TRIED_SLOPES_DEG = range(10, 79, 4)
"""Slopes of the axis in degrees that are tried first; an end seen at a smaller or larger angle hides what it bounds."""
CLIMB_STEPS, CLIMBED = ((2.0, 1.0), (1.0, 1.0)), 6
"""Steps of the slope in degrees, and factors of the radius, by which the best prisms are refined; how many of them."""
LAST_STEPS = ((3.0, 1.4), (2.0, 1.4), (1.0, 1.2), (1.0, 1.2), (0.5, 1.1), (0.5, 1.1), (0.25, 1.05), (0.25, 1.05))
"""Those by which the likeliest prism is refined at last, to bring its normals closest to candidates."""
COARSE_VIEW, FINE_VIEW = (3_500, 4.5), (12_000, FLASHED_DEG)
"""Pixels to which an object is sampled down, and degrees within which candidates have a prism's normals: to compare all
prisms, whose slopes are not exact, and to refine the best."""


class RoundedPrismSearch(PolyhedronSearch):
    """Search for a right prism with rounded edges in a view, on demand."""

    @cached_property
    def best(self) -> PolyhedralNormals | None:
        """The prism for which candidates speak most; None if they speak for none."""
        solid = likeliest_prism(possible_prisms(self._silhouette, self._inverse_focal), self._shown, self._silhouette)
        return None if solid is None else self._seen_back(rounded_normals(*solid, self._silhouette))


def possible_prisms(mask: np.ndarray, inverse_focal: float) -> list[RoundedPrism]:
    """Return the prisms with the silhouette of a mask (H, W) bool, at the slopes that are tried first.

    inverse_focal: 1 over the focal length in pixels of a camera aimed at the middle of the image, 0 for parallel rays.
    """
    return [
        RoundedPrism(core, radius)
        for corners, radius in rounded_contours(mask)
        for core in right_prisms(corners, inverse_focal, TRIED_SLOPES_DEG)
    ]


def likeliest_prism(
    prisms: list[RoundedPrism], candidates: np.ndarray, mask: np.ndarray
) -> tuple[RoundedPrism, float] | None:
    """Return the prism for which candidates speak most, refined, and how much, nats; None: for none.

    prisms: `possible_prisms`; for the rest see `PolyhedronSearch`.
    """
    coarse, fine = (
        _SampledView.of(candidates, mask, prisms[0].core.inverse_focal, *way) if prisms else None
        for way in (COARSE_VIEW, FINE_VIEW)
    )
    if coarse is None or fine is None:
        return None
    tried = sorted(((coarse.log_ratio(prism), number) for number, prism in enumerate(prisms)), reverse=True)
    starts = [prisms[number] for ratio, number in tried[:CLIMBED] if ratio > 0.0]
    likeliest = [climbed((fine.log_ratio(start), start), fine.log_ratio, _beside, CLIMB_STEPS) for start in starts]
    largest, best = max(likeliest, key=itemgetter(0), default=(0.0, None))
    if best is None or largest <= 0.0:
        return None
    _, closest = climbed((fine.closeness(best), best), fine.closeness, _beside, LAST_STEPS)
    return closest, largest


def _beside(prism: RoundedPrism, step: tuple[float, float]) -> Iterator[RoundedPrism]:
    """Yield the prisms whose slope differs by a step in degrees, and those whose radius differs by a factor."""
    degrees, factor = step
    yield prism.with_slope(prism.core.slope - np.radians(degrees))
    yield prism.with_slope(prism.core.slope + np.radians(degrees))
    radii = (prism.radius / factor, prism.radius * factor) if factor > 1.0 else ()
    yield from (other for other in map(prism.with_radius, radii) if other is not None)


@dataclass(frozen=True, slots=True)
class _SampledView:
    """View of every `stride`-th pixel in which prisms of the whole view are compared.

    middle: (2,), where its centre lies in the whole view. tolerance_deg: of `rounded_log_ratio`.
    """

    shown: ShownCandidates
    middle: np.ndarray
    stride: int
    tolerance_deg: float

    @classmethod
    def of(
        cls, candidates: np.ndarray, mask: np.ndarray, inverse_focal: float, pixels: int, tolerance_deg: float
    ) -> "_SampledView | None":
        """Return that in which the object has about so many pixels; None without candidates."""
        stride = max(1, round(np.sqrt(mask.sum() / pixels)))
        sampled = mask[::stride, ::stride]
        shown = ShownCandidates.of(candidates[:, ::stride, ::stride], sampled, inverse_focal * stride)
        return None if shown is None else cls(shown, sampled_middle(mask.shape, stride), stride, tolerance_deg)

    def log_ratio(self, prism: RoundedPrism) -> float:
        """Return how much candidates speak for a prism, nats."""
        return rounded_log_ratio(prism.seen_from(self.middle, self.stride), self.shown, self.tolerance_deg)

    def closeness(self, prism: RoundedPrism) -> float:
        """Return how close candidates are to a prism's normals."""
        return -mean_deviation(prism.seen_from(self.middle, self.stride), self.shown)


def rounded_normals(solid: RoundedPrism, log_ratio: float, mask: np.ndarray) -> PolyhedralNormals:
    """Return what a mask (H, W) bool shows of a prism; log_ratio: how much candidates speak for it, nats."""
    surface = solid.surface(*pixel_positions(mask))
    normals, depths = np.full((*mask.shape, 3), np.nan), np.full(mask.shape, np.nan, np.float32)
    faces = np.full(mask.shape, -1)
    normals[mask], depths[mask], faces[mask] = surface.normals, surface.depths, solid.flat_faces(surface.normals)
    view = centred_view_vectors(mask.shape, solid.core.inverse_focal)
    filled = np.where(mask[..., None], with_nearest(normals, mask), np.nan)
    return PolyhedralNormals(rotate_to_view(filled, view), depths, faces, log_ratio)
