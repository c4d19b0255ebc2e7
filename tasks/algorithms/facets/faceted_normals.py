"""Normals of a faceted body, found by its silhouette and the candidates, under either camera.

Most facets never show the light, and through those that do the others are seen, so that few candidates are true and no
smooth field is near. But few bodies fill the silhouette; facets that flash as a whole and the highlights of their
rounded creases choose among these.
"""

from functools import cached_property
from operator import itemgetter

import numpy as np

from glint.tasks.algorithms.faces.proven_faces import apparent_faces
from glint.tasks.algorithms.facets.facet_evidence import facet_log_ratio
from glint.tasks.algorithms.facets.facet_view import FacetView, silhouette_contour
from glint.tasks.algorithms.facets.faceted_body import FacetedBody
from glint.tasks.algorithms.facets.hollows import with_hollow
from glint.tasks.algorithms.facets.placements import Placement, placements_about_axis, placements_of_ends
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.prisms.polyhedron import PolyhedralNormals, PolyhedronSearch, polyhedral_normals

COARSE_INRADIUS_PX, FINE_INRADIUS_PX = 30.0, 60.0
"""Inradii in pixels to which an object is sampled down to find bodies and to refine them."""
STARTS, STARTS_PER_POLYGON, REFINED = 16, 3, 4
"""Placements that are refined, those of one number of sides among them, and how many of these are refined further."""
COARSE_STEPS, FINE_STEPS = (3.0, 0.04, 4.0, 0.12), (1.0, 0.02, 1.0, 0.05)
"""Steps at which a refinement begins: of angle in degrees, offset in inradii, tilt in degrees, and part of a side."""
COARSE_HALVINGS, FINE_HALVINGS = 2, 2
"""How often they are halved."""
HOPELESS_NATS = -120.0
"""Log-likelihood ratio of a placement that is tried from which it is not refined."""


class FacetSearch(PolyhedronSearch):
    """Search for faceted bodies in a view, on demand."""

    @cached_property
    def likeliest(self) -> list[PolyhedralNormals]:
        """The bodies for which candidates speak most, best first; none if they speak for none."""
        mask, shown, inverse_focal = self._silhouette, self._shown, self._inverse_focal
        strides = [max(1, round(inradius_of(mask) / pixels)) for pixels in (COARSE_INRADIUS_PX, FINE_INRADIUS_PX)]
        views = {stride: FacetView.of(shown, mask, inverse_focal, stride) for stride in strides}
        coarse, fine = (views[stride] for stride in strides)
        if coarse is None or fine is None:
            return []
        results, contour = [], silhouette_contour(mask)
        for log_ratio, placement in likeliest_placements(mask, inverse_focal, coarse, fine):
            frame = placement.frame(inverse_focal, np.zeros(2), 1)
            body = FacetedBody.inside(contour, frame, placement.polygon)
            solid = polyhedral_normals(body, log_ratio, mask)
            results.append(self._seen_back(with_hollow(solid, body, placement, mask, shown)))
        return results


def likeliest_placements(
    mask: np.ndarray, inverse_focal: float, coarse: FacetView, fine: FacetView
) -> list[tuple[float, Placement]]:
    """Return the placements for which a view speaks, and how much, nats, best first.

    mask: (H, W) bool. inverse_focal: 1 over the focal length in pixels of a camera aimed at the middle of the image, 0
    for parallel rays. coarse, fine: the view, in which placements are tried and refined.
    """

    def scored(placements: list[Placement]) -> list[tuple[float, Placement]]:
        values = ((facet_log_ratio(coarse.body(placement), coarse), placement) for placement in placements)
        return sorted((value for value in values if value[0] > HOPELESS_NATS), key=itemgetter(0), reverse=True)

    faces = [face.normal for face in apparent_faces(np.moveaxis(coarse.normals, 2, 0), coarse.mask)]
    starts: list[tuple[Placement, float]] = []
    for placements in (placements_of_ends(mask, inverse_focal), placements_about_axis(mask, faces, inverse_focal)):
        # Of many that are tried, one fits by chance: each is as likely beforehand as they are few.
        chance = float(np.log(max(len(placements), 1)))
        for _, placement in scored(placements):
            alike = sum(start.polygon.sides == placement.polygon.sides for start, _ in starts)
            if alike < STARTS_PER_POLYGON and not any(start.is_near(placement) for start, _ in starts):
                starts.append((placement, chance))
    # Those of ends come first, as they are few and nearly exact already, then those about the axis, each best first.
    refined = [(*_refined(start, coarse, COARSE_STEPS, COARSE_HALVINGS), chance) for start, chance in starts[:STARTS]]
    result = []
    for _, placement, chance in sorted(refined, key=itemgetter(0), reverse=True)[:REFINED]:
        ratio, best = _refined(placement, fine, FINE_STEPS, FINE_HALVINGS)
        result.append((ratio - chance, best))
    return sorted((value for value in result if value[0] > 0.0), key=itemgetter(0), reverse=True)


def _refined(
    start: Placement, view: FacetView, steps: tuple[float, float, float, float], halvings: int
) -> tuple[float, Placement]:
    """Return the best placement near a start, and how much the view speaks for it, nats.

    Steps are halved where no neighbour is better.
    """

    def log_ratio(placement: Placement) -> float:
        return facet_log_ratio(view.body(placement), view)

    turn, shift, tilt, share = steps
    best, placement = log_ratio(start), start
    for halving in range(halvings + 1):
        factor = 0.5**halving
        beside = np.radians(turn), shift * view.inradius * view.stride, np.radians(tilt), share
        while True:
            neighbours = [(log_ratio(near), near) for near in placement.beside(*(factor * step for step in beside))]
            ratio, neighbour = max(neighbours, key=itemgetter(0))
            if ratio <= best:
                break
            best, placement = ratio, neighbour
    return best, placement
