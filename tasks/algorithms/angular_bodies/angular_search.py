"""Bodies whose sections are rounded squares or rectangles, found by the silhouette and the candidates.

Square tumblers, bottles and vases are what a surface of revolution is with other sections than circles: the silhouette
gives their profile once the axis, its tilt and the section are known (`sections`). Few of their normals are near those
of a smooth field, and through walls that show the light all others are seen: only candidates can tell which body it is.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from scipy import optimize

from glint.tasks.algorithms.angular_bodies.body_agreement import SampledCandidates
from glint.tasks.algorithms.facets.placements import Placement
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from glint.tasks.algorithms.sections.rounded_polygon import RoundedPolygon
from glint.tasks.algorithms.silhouettes.reflection_axes import reflection_axes

MIN_AXIS_IOU, MOST_AXES = 0.85, 3
"""Overlap of a silhouette with its mirror image from which an axis is tried, as a turned square is not seen symmetric,
and how many are."""
START_TILTS = np.radians([-40, -25, -12, 5, 10, 15, 20, 25, 30, 35, 42, 50])
START_TURNS = np.radians(np.arange(0.0, 90.0, 15.0))
START_ROUNDING = 0.35
"""Tilts of the axis and turns of the section, radians, and rounding of its corners that are tried first."""
UPRIGHT_WORTH = 0.06
"""Agreement by which an axis is preferred that is upright in the image, and whose upper end faces the camera: vessels
stand, cameras look down on them, and silhouette and faces of a block look alike about each of its axes."""
MIN_TRIED_AGREEMENT = -0.01
"""Agreement of the best of these from which it is refined."""
MOST_STARTS = (5, 2, 1)
"""Placements that are refined in each round of refinement."""
NEAR_TILT, NEAR_TURN = np.radians(11.0), np.radians(17.0)
"""Differences of tilt and turn up to which two starts lead to the same body."""
SIMPLEX_STEPS = np.array([np.radians(2.0), 0.04, np.radians(4.0), np.radians(9.0), 0.12, 0.12])
"""First steps of angle, offset in inradii, tilt, turn, rounding and width."""
MIN_ROUNDING, MIN_STRAIGHT = 0.02, 0.05
"""Least rounding, and least straight part of a side, relative to the apothem."""


@dataclass(frozen=True, slots=True)
class _Round:
    """A round of the search, in which bodies are compared by every `stride`-th pixel, see `SampledCandidates`.

    samples: of their profile. tolerance_deg: of the agreement. scale: of the first steps. evaluations: at most.
    """

    stride: int
    samples: int
    tolerance_deg: float
    scale: float = 0.0
    evaluations: int = 0


class RatedPlacement(NamedTuple):
    """Placement of a body, and how well candidates agree with that, from -1 to 1."""

    placement: Placement
    agreement: float

    @property
    def worth(self) -> float:
        """Agreement, and how usual the axis is, by which placements are compared."""
        upright = abs(float(np.cos(self.placement.angle))) if self.placement.tilt > 0.0 else 0.0
        return self.agreement + UPRIGHT_WORTH * upright


BY_WORTH = attrgetter("worth")
FIRST_ROUND = _Round(4, 40, 20.0)
SIMPLEX_ROUNDS = (_Round(2, 50, 14.0, 1.5, 90), _Round(2, 80, 8.0, 1.0, 120), _Round(1, 100, 6.0, 0.5, 120))
"""The round in which placements are tried, and those in which the best are refined."""
FINE_STEP_PX = 0.5
"""Step along the axis of the resulting body."""


@dataclass(frozen=True, eq=False)
class AngularSearch:
    """Search for a body of rounded squares or rectangles in a view, whose candidates agree with it most.

    mask: (H, W) bool, the silhouette. shown: candidates of the view. inverse_focal: 1 over the focal length in pixels
    of a camera aimed at the middle of the image, 0 for parallel rays.
    """

    mask: np.ndarray
    shown: SampledCandidates
    inverse_focal: float

    @cached_property
    def best(self) -> RatedPlacement | None:
        """Placement of the body with which candidates agree most; None if they agree with none."""
        tried = [RatedPlacement(placement, self._agreement(placement, FIRST_ROUND)) for placement in self._tried()]
        tried.sort(key=BY_WORTH, reverse=True)
        if not tried or tried[0].agreement < MIN_TRIED_AGREEMENT:
            return None
        starts: list[RatedPlacement] = []
        for rated in tried:
            if len(starts) < MOST_STARTS[0] and not any(_is_near(rated.placement, start.placement) for start in starts):
                starts.append(rated)
        for refinement, count in zip(SIMPLEX_ROUNDS, MOST_STARTS, strict=True):
            starts = [self._refined(start.placement, refinement) for start in starts[:count]]
            starts.sort(key=BY_WORTH, reverse=True)
        return starts[0]

    def body(self, placement: Placement, step: float = FINE_STEP_PX) -> SurfaceOfRevolution:
        """Return the largest body of a placement inside the silhouette; step: along the axis, pixels."""
        return SurfaceOfRevolution.from_silhouette(
            self.mask, placement.axis, placement.tilt, step, self.inverse_focal, placement.polygon
        )

    def _tried(self) -> list[Placement]:
        """Return the placements that are tried first, about the best symmetry axes of the silhouette, if it has any."""
        axes = reflection_axes(self.mask, MIN_AXIS_IOU)[:MOST_AXES]
        return [
            Placement.about(axis, float(tilt), RoundedPolygon(4, float(turn), START_ROUNDING))
            for axis, tilt, turn in product(axes, START_TILTS, START_TURNS)
        ]

    def _agreement(self, placement: Placement, comparison: _Round) -> float:
        body = self.body(placement, self._length / comparison.samples)
        return self.shown.agreement(body, comparison.tolerance_deg, comparison.stride)

    def _refined(self, start: Placement, refinement: _Round) -> RatedPlacement:
        """Return the best placement near a start, by the simplex of Nelder and Mead."""
        steps = refinement.scale * SIMPLEX_STEPS * [1.0, self._inradius, 1.0, 1.0, 1.0, 1.0]

        def contradiction(offsets: np.ndarray) -> float:
            placement = _moved(start, offsets * steps)
            return 2.0 if placement is None else -self._agreement(placement, refinement)

        simplex = np.vstack([np.zeros(len(steps)), np.eye(len(steps))])
        options = {"initial_simplex": simplex, "maxfev": refinement.evaluations, "xatol": 0.02, "fatol": 1e-4}
        optimum = optimize.minimize(contradiction, np.zeros(len(steps)), method="Nelder-Mead", options=options)
        return RatedPlacement(_moved(start, optimum.x * steps) or start, -float(optimum.fun))

    @cached_property
    def _inradius(self) -> float:
        return inradius_of(self.mask)

    @cached_property
    def _length(self) -> float:
        """Largest extent of the silhouette in pixels."""
        return float(np.ptp(np.argwhere(self.mask), axis=0).max())


def _moved(start: Placement, by: np.ndarray) -> Placement | None:
    """Return a placement with other angle, offset, tilt, turn, rounding and width, by (6,); None if there is none."""
    angle, offset, tilt, turn, rounding, width = map(float, by)
    section = start.polygon
    section = RoundedPolygon(section.sides, section.turn + turn, section.rounding + rounding, section.width + width)
    if not MIN_ROUNDING < section.rounding < min(section.width, 1.0) - MIN_STRAIGHT:
        return None
    return Placement(start.angle + angle, start.offset + offset, start.tilt + tilt, section)


def _is_near(first: Placement, second: Placement) -> bool:
    """Return whether refinement would lead from both starts to the same body."""
    return (
        first.angle == second.angle
        and abs(first.tilt - second.tilt) < NEAR_TILT
        and first.turn_from(second) < NEAR_TURN
    )
