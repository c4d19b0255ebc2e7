"""A turntable solved: its axis and its angles, from outlines and, once there is a model, from normals.

Outlines tell the axis to a tenth of a degree and of a pixel, and how the outlines of slim bodies change with the angle;
normals tell the angles of the rest. Both hold each other and the angles as they were given.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.special import expit

from glint.tasks.algorithms.multiview.epipolar_tangency import Tangents, tangents
from glint.tasks.algorithms.multiview.normal_consistency import Agreement, agreement
from glint.tasks.algorithms.multiview.normal_fusion import Fused
from glint.tasks.algorithms.multiview.view import View, turned
from glint.tasks.algorithms.multiview.visual_hull import ball_around, outline_of

SOLVED_RAYS = 120
"""Rays taken of each outline to solve poses: their pixels' staircases must average out."""
OUTLINE_ERROR, SOFT, CORNER = 0.15, 1.0, 0.05
"""Pixels of residual that are expected, beyond which a ray counts as an outlier, and over which rays begin to count."""
ANGLE_ERROR, LEAN_ERROR = 1.0, 4.0
"""Degrees expected of a turntable's angles and of its axis."""
DIFFERENCE = 0.1
"""Degrees, or per cent of the object's size, over which residuals are differentiated."""
EVALUATIONS = 12


@dataclass(frozen=True, slots=True)
class Turntable:
    """A turntable's axis against the camera.

    offset: world units that it stands to the right of the frame's centre; towards, sideways: degrees that its upper end
    leans to the camera and to the right; angles: (V,) degrees of the views.
    """

    offset: float
    towards: float
    sideways: float
    angles: np.ndarray

    def pose(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (3, 3) and translation (3,) of a view."""
        lean = Rotation.from_euler("zx", [-self.sideways, self.towards], degrees=True).as_matrix()
        return lean @ turned(float(self.angles[number])), np.array([self.offset, 0.0, 0.0])


def turntable_of(views: Sequence[View], angles: Sequence[float]) -> Turntable:
    """An upright turntable whose axis is where the silhouettes' middles say.

    The middle of the silhouette seen from an angle is the axis plus the odd harmonics of the body's width, which cancel
    over a full turn and are fitted else.
    """
    middles, turns = [], np.radians(np.asarray(angles, float))
    for view in views:
        columns = np.flatnonzero(view.mask.any(axis=0)) + view.origin[0]
        middles.append(((columns[0] + columns[-1]) / 2 - (view.frame[0] - 1) / 2) * view.pixel_size)
    terms = [np.ones(len(turns))]
    for harmonic in (1, 3):
        if len(turns) >= len(terms) + 3:
            terms += [np.cos(harmonic * turns), np.sin(harmonic * turns)]
    found = np.linalg.lstsq(np.stack(terms, axis=1), np.array(middles), rcond=None)[0]
    return Turntable(float(found[0]), 0.0, 0.0, np.asarray(angles, float))


def on_turntable(views: Sequence[View], table: Turntable) -> list[View]:
    """Views where a turntable puts them; a perspective camera keeps its distance from the axis."""
    placed = []
    for number, view in enumerate(views):
        rotation, translation = table.pose(number)
        placed.append(view.placed(rotation, translation + np.array([0.0, 0.0, view.translation[2]])))
    return placed


def solve_axis(views: Sequence[View], start: Turntable) -> Turntable:
    """The axis on which the views' outlines agree best; the angles stay."""
    return _solved(views, start, start.angles, None, np.zeros((0, len(views))), np.zeros(0))


def solve_turntable(
    views: Sequence[View],
    start: Turntable,
    given: np.ndarray,
    normals: Agreement | None = None,
    errors: np.ndarray | None = None,
) -> Turntable:
    """The axis and the angles on which the views' outlines agree best, and their normals as seen from the start.

    given (V,): the angles, degrees, that are expected to be true within `errors` (V,), by default ANGLE_ERROR; their
    mean, weighed by that, stays.
    """
    sure = np.full(len(views), 1.0 / ANGLE_ERROR) if errors is None else 1.0 / errors
    solved = _solved(views, start, given, normals, np.eye(len(views)), sure)
    return replace(solved, angles=solved.angles - np.average(solved.angles - given, weights=sure**2))


def agreement_of(views: Sequence[View], table: Turntable, vertices: np.ndarray, fused: Fused) -> Agreement:
    """How the normals of views, as they are on a turntable, agree on the vertices (N, 3) of a model."""
    ahead, behind = (on_turntable(views, replace(table, angles=table.angles + way * DIFFERENCE)) for way in (1.0, -1.0))
    pairs = [(one, other, 2.0 * DIFFERENCE) for one, other in zip(ahead, behind, strict=True)]
    return agreement(views, pairs, vertices, fused)


def _solved(
    views: Sequence[View],
    start: Turntable,
    given: np.ndarray,
    normals: Agreement | None,
    free: np.ndarray,
    sure: np.ndarray,
) -> Turntable:
    """The turntable with least squares; free (F, V): the directions in which the angles may change, sure (F,): the
    inverse of the degrees by which they are expected to.

    Unknown are the changes of offset, leans and angles from the start.
    """
    outlines = [outline_of(view.mask) for view in views]
    hundredth = max(float(np.hypot(*view.mask.shape)) * view.pixel_size for view in views) / 100
    middle = ball_around(views)[0][None]
    size = np.array([view.footprint(middle)[0] for view in views])
    matrix, vector = (np.zeros((0, len(views))), np.zeros(0)) if normals is None else normals.residuals()
    # The offset has no prior.
    held = np.concatenate([[0.0], np.full(2, 1.0 / LEAN_ERROR), sure])
    expected = np.concatenate([[0.0, -start.towards, -start.sideways], free @ (given - start.angles)])

    def turntable(unknowns: np.ndarray) -> Turntable:
        offset, towards, sideways = unknowns[:3].tolist()
        return Turntable(
            start.offset + offset * hundredth,
            start.towards + towards,
            start.sideways + sideways,
            start.angles + unknowns[3:] @ free,
        )

    @lru_cache(maxsize=1)
    def touching_at(*unknowns: float) -> Tangents:
        return tangents(on_turntable(views, turntable(np.array(unknowns))), outlines, SOLVED_RAYS)

    def residuals(unknowns: np.ndarray) -> np.ndarray:
        turns = unknowns[3:] @ free
        missed = touching_at(*unknowns.tolist()).distance
        return np.concatenate([_counted(missed)[0], held * (unknowns - expected), matrix @ turns + vector])

    def jacobian(unknowns: np.ndarray) -> np.ndarray:
        touching = touching_at(*unknowns.tolist())
        grade = _counted(touching.distance)[1]
        columns = []
        for step in DIFFERENCE * np.eye(len(unknowns)):
            ahead, behind = (
                touching.distances(on_turntable(views, turntable(unknowns + way * step)), outlines, size)
                for way in (1.0, -1.0)
            )
            columns.append(grade * (ahead - behind).ravel() / (2 * DIFFERENCE))
        turning = np.hstack([np.zeros((len(matrix), 3)), matrix @ free.T])
        return np.vstack([np.stack(columns, axis=1), np.diag(held), turning])

    found = least_squares(residuals, np.zeros(len(held)), jac=jacobian, max_nfev=EVALUATIONS, xtol=1e-4, ftol=1e-4)
    return turntable(found.x)


def _counted(distances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (N,) of rays at signed distances (V, R) in pixels, and their derivatives (N,): rays that run inside the
    hull count nothing, squares grow but linearly beyond SOFT."""
    flat = distances.ravel()
    missed = CORNER * np.logaddexp(0.0, flat / CORNER)
    root = np.sqrt(1.0 + (missed / SOFT) ** 2)
    share = np.sqrt(2.0 / (root + 1.0))
    return missed * share / OUTLINE_ERROR, expit(flat / CORNER) / (root * share) / OUTLINE_ERROR
