"""Normals of a right prism, found by its silhouette and the candidates, under either camera.

Most faces of a block of glass never show the light, and through those that do its other faces are seen: hardly any
candidate is true, and no smooth field is near. But its silhouette leaves few prisms to choose from, and one number, the
slope of the axis, for each; the highlights of its edges choose among them.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from operator import itemgetter

import numpy as np

from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.prisms.contour_polygon import contour_polygons
from glint.tasks.algorithms.prisms.polyhedron import (
    PolyhedralNormals,
    PolyhedronSearch,
    climbed,
    polyhedral_normals,
    sampled_middle,
)
from glint.tasks.algorithms.prisms.prism_evidence import ShownNormals, prism_log_ratio
from glint.tasks.algorithms.prisms.right_prism import RightPrism, right_prisms

SLOPES_DEG = range(10, 79, 8)
"""Slopes of the axis in degrees that are tried first; an end seen at a smaller or larger angle hides what it bounds."""
SLOPE_STEPS_DEG, REFINED = (4.0, 2.0, 1.0), 4
"""Steps by which the slopes of the best prisms are refined in turn, and how many prisms."""
SCORED_INRADIUS_PX = 60.0
"""Inradius in pixels to which an object is sampled down to compare prisms."""


class PrismSearch(PolyhedronSearch):
    """Search for a right prism in a view, on demand."""

    @cached_property
    def best(self) -> PolyhedralNormals | None:
        """The prism for which candidates speak most; None if they speak for none."""
        prisms = possible_prisms(self._silhouette, self._inverse_focal)
        prism = likeliest_prism(prisms, self._shown, self._silhouette) if prisms else None
        return None if prism is None else self._seen_back(polyhedral_normals(*prism, self._silhouette))


def possible_prisms(mask: np.ndarray, inverse_focal: float) -> list[RightPrism]:
    """Return the right prisms with the silhouette of a mask (H, W) bool, at the slopes that are tried first.

    inverse_focal: 1 over the focal length in pixels of a camera aimed at the middle of the image, 0 for parallel rays.
    """
    return [prism for corners in contour_polygons(mask) for prism in right_prisms(corners, inverse_focal, SLOPES_DEG)]


def likeliest_prism(
    prisms: list[RightPrism], candidates: np.ndarray, mask: np.ndarray
) -> tuple[RightPrism, float] | None:
    """Return the prism for which candidates speak most, its slope refined, and how much, nats; None: for none.

    prisms: `possible_prisms`; for the rest see `PrismSearch`.
    """
    if not prisms:
        return None
    stride = max(1, int(inradius_of(mask) / SCORED_INRADIUS_PX))
    sampled = mask[::stride, ::stride]
    shown = ShownNormals.of(candidates[:, ::stride, ::stride], sampled, prisms[0].inverse_focal * stride)
    if shown is None:
        return None
    middle = sampled_middle(mask.shape, stride)

    def log_ratio(prism: RightPrism) -> float:
        return prism_log_ratio(prism.seen_from(middle, stride), shown)

    scored = sorted(((log_ratio(prism), number) for number, prism in enumerate(prisms)), reverse=True)
    likeliest = [
        climbed((ratio, prisms[number]), log_ratio, _beside, SLOPE_STEPS_DEG) for ratio, number in scored[:REFINED]
    ]
    largest, best = max(likeliest, key=itemgetter(0))
    return (best, largest) if largest > 0.0 else None


def _beside(prism: RightPrism, step: float) -> Iterator[RightPrism]:
    """Yield the prisms with slopes a step in degrees to either side."""
    for slope in (prism.slope - np.radians(step), prism.slope + np.radians(step)):
        yield replace(prism, slope=float(slope))
