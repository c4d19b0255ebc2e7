"""Normals of a right prism with rounded edges, found by its silhouette and the candidates, under either camera.

Most faces of a block of glass never show the light, and through those that do its other faces are seen: hardly any
candidate is true, and no smooth field is near. But its silhouette leaves few prisms to choose from, and one number, the
slope of the axis, for each; the highlights of its edges choose among them.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter

import numpy as np

from glint.tasks.algorithms.geometry.distance import with_nearest
from glint.tasks.algorithms.geometry.perspective import rotate_to_view, to_camera_directions
from glint.tasks.algorithms.geometry.vectors import positions_at, unit
from glint.tasks.algorithms.prisms.polyhedron import PolyhedralNormals, PolyhedronSearch, sampled_middle
from glint.tasks.algorithms.prisms.prism_evidence import FLASHED_DEG
from glint.tasks.algorithms.prisms.right_prism import RightPrism, swept_contours
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
        RoundedPrism(RightPrism(contour, float(np.radians(slope)), inverse_focal), radius)
        for corners, radius in rounded_contours(mask)
        for contour in swept_contours(corners, inverse_focal)
        for slope in TRIED_SLOPES_DEG
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
    likeliest = [
        _climbed(prisms[number], fine.log_ratio, CLIMB_STEPS) for ratio, number in tried[:CLIMBED] if ratio > 0.0
    ]
    if not likeliest:
        return None
    best = max(likeliest, key=fine.log_ratio)
    largest = fine.log_ratio(best)
    return (_climbed(best, fine.closeness, LAST_STEPS), largest) if largest > 0.0 else None


def _climbed(
    prism: RoundedPrism, score: Callable[[RoundedPrism], float], steps: Sequence[tuple[float, float]]
) -> RoundedPrism:
    """Return the prism of the largest score, sought from this one by steps of the slope and the radius in turn."""
    largest = score(prism)
    for degrees, factor in steps:
        beside = [(score(other), other) for other in _beside(prism, np.radians(degrees), factor)]
        largest, prism = max((largest, prism), *beside, key=itemgetter(0))
    return prism


def _beside(prism: RoundedPrism, step: float, factor: float) -> Iterator[RoundedPrism]:
    """Yield the prisms whose slope differs by a step in radians, and those whose radius differs by a factor."""
    yield prism.with_slope(prism.core.slope - step)
    yield prism.with_slope(prism.core.slope + step)
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
    rows, columns = np.indices(mask.shape, dtype=float)
    x, y = positions_at(rows, columns, mask.shape)
    surface = solid.surface(x[mask], y[mask])
    normals, depths = np.full((*mask.shape, 3), np.nan), np.full(mask.shape, np.nan, np.float32)
    faces = np.full(mask.shape, -1)
    normals[mask], depths[mask], faces[mask] = surface.normals, surface.depths, solid.flat_faces(surface.normals)
    view = unit(to_camera_directions(x, y, solid.core.inverse_focal))
    filled = np.where(mask[..., None], with_nearest(normals, mask), np.nan)
    return PolyhedralNormals(rotate_to_view(filled, view), depths, faces, log_ratio)
