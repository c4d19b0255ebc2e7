"""Poses solved from silhouettes and normals: where cameras must have stood to see one body.

The ray through each pixel of an outline touches the body, so it must meet the hull of all other views. How far it
passes by is a residual; it is zero for consistent poses whatever the body's shape. It tells where a turntable's axis
stands and how it leans. Errors of its angles are told by the normals instead, once there is a model to compare them on.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from tasks.algorithms.merging.fusion import Fused
from tasks.algorithms.merging.hull import Outline, ball_around, hull_field, outline_of
from tasks.algorithms.merging.views import View, sample, turned

RAYS = 48
"""Rays taken of each outline."""
COARSE, FINE = 40, 9
"""Points looked at along a ray, first from end to end, then round the best."""
SOFT = 1.0
"""Pixels of residual beyond which a ray counts as an outlier."""
ANGLE_ERROR, LEAN_ERROR = 1.0, 4.0
"""Degrees expected of a turntable's angles and of its axis, which hold what the outlines leave open."""
DIFFERENCE = 0.1
"""Degrees, or per cent of the object's size, over which residuals are differentiated."""
SURE = 0.8
"""Confidence from which normals are compared: the smooth field's guesses lean with the view that made them."""
NORMAL_ERROR = 0.25
"""Degrees by which the confident normals of a view may be wrong all alike."""
FEWEST = 30
"""Vertices that two views must see for their normals to be compared."""
DIFFERENT = 8.0
"""Degrees between the normals of two views beyond which one of them is taken to be mistaken."""


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


def misses(views: Sequence[View], outlines: Sequence[Outline], rays: int = RAYS) -> np.ndarray:
    """By how much (V, rays), in pixels, the rays through each view's outline pass by the hull of the other views."""
    centre, reach = ball_around(views)
    found = np.zeros((len(views), rays))
    for number, view in enumerate(views):
        others = [each for each in range(len(views)) if each != number]
        field = hull_field([views[each] for each in others], [outlines[each] for each in others])
        starts, directions = view.rays(*rim_points(view.mask, rays))
        middle = ((centre - starts) * directions).sum(axis=1)
        found[number] = _nearest(field, starts, directions, middle, reach) / view.footprint(centre[None])
    return found


def rim_points(mask: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows (count,) of pixels of a mask's rim, evenly taken around it; the region's border is none."""
    rim = mask & ~ndimage.binary_erosion(np.pad(mask, 1, mode="edge"))[1:-1, 1:-1]
    rows, columns = np.nonzero(rim)
    around = np.argsort(np.arctan2(rows - rows.mean(), columns - columns.mean()), kind="stable")
    taken = around[np.linspace(0, len(around) - 1, count).round().astype(int)]
    return columns[taken].astype(float), rows[taken].astype(float)


def _nearest(
    field: Callable[[np.ndarray], np.ndarray],
    starts: np.ndarray,
    directions: np.ndarray,
    middle: np.ndarray,
    reach: float,
) -> np.ndarray:
    """Least positive value (N,) of the field along each ray, 0 where a ray meets the hull."""
    along = middle[:, None] + np.linspace(-reach, reach, COARSE)
    step = 2 * reach / (COARSE - 1)
    for _ in range(2):
        points = starts[:, None] + along[..., None] * directions[:, None]
        values = field(points.reshape(-1, 3)).reshape(along.shape)
        best = np.take_along_axis(along, values.argmin(axis=1)[:, None], axis=1)
        along = best + np.linspace(-step, step, FINE)
        step *= 2 / (FINE - 1)
    return np.maximum(values.min(axis=1), 0.0)


def solve_turntable(views: Sequence[View], start: Turntable) -> Turntable:
    """The axis on which the views' outlines agree best; the angles stay, as outlines hardly tell small errors of them.

    They tell the axis to a tenth of a degree and of a pixel.
    """
    outlines = [outline_of(view.mask) for view in views]
    size = _size(views)

    def turntable(unknowns: np.ndarray) -> Turntable:
        offset, towards, sideways = unknowns.tolist()
        return Turntable(offset * size / 100, towards, sideways, start.angles)

    def residuals(unknowns: np.ndarray) -> np.ndarray:
        missed = misses(on_turntable(views, turntable(unknowns)), outlines)
        return np.concatenate([_softened(missed), unknowns[1:] / LEAN_ERROR])

    first = np.array([100 * start.offset / size, start.towards, start.sideways])
    found = least_squares(residuals, first, jac=_differences(residuals), max_nfev=8, xtol=1e-3, ftol=1e-3)
    return turntable(found.x)


def turned_by_normals(
    views: Sequence[View], table: Turntable, given: np.ndarray, vertices: np.ndarray, fused: Fused
) -> Turntable:
    """The turntable whose angles make each view's normals agree best with what the other views say of the surface.

    views: as they are on `table`; given (V,): the angles, degrees, that are expected to be true within ANGLE_ERROR;
    vertices (N, 3) of the model and what the views say of them. Turning a view changes which pixel shows a vertex as
    well as how its normal lies in the world; on a body that is round about the axis the two cancel and the normals
    tell nothing. Only normals that two views are sure of are compared.
    """
    weights = np.where(fused.sure >= SURE, fused.sure, 0.0)
    everyone = (weights[..., None] * fused.each).sum(axis=0)
    ahead, behind = (on_turntable(views, replace(table, angles=table.angles + way * DIFFERENCE)) for way in (1.0, -1.0))
    turns = np.zeros(len(views))
    for number in range(len(views)):
        own = fused.each[number]
        others = everyone - weights[number][:, None] * own
        length = np.linalg.norm(others, axis=1)
        both = np.flatnonzero((weights[number] > 0) & (length > SURE))
        if len(both) < FEWEST:
            continue
        change = (_normals_at(ahead[number], vertices[both]) - _normals_at(behind[number], vertices[both])) / (
            2 * np.radians(DIFFERENCE)
        )
        left = own[both] - others[both] / length[both, None]
        apart = np.degrees(np.linalg.norm(left, axis=1))
        weight = np.minimum(weights[number], length)[both] / (1.0 + (apart / DIFFERENT) ** 2) ** 2
        slope, square = ((weight * (change * each).sum(axis=1)).sum() / weight.sum() for each in (left, change))
        held = (NORMAL_ERROR / ANGLE_ERROR) ** 2
        so_far = np.radians(table.angles[number] - given[number])
        turns[number] = -np.degrees((slope + held * so_far) / (square + held))
    return replace(table, angles=table.angles + turns - turns.mean())


def _normals_at(view: View, points: np.ndarray) -> np.ndarray:
    """Normals (N, 3) of the world that a view shows at points (N, 3)."""
    normals = sample(np.nan_to_num(view.normals), *view.project(points))
    return view.to_world(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9))


def _differences(function: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
    """The function's Jacobian by central differences that are wide against the outlines' staircase."""

    def jacobian(unknowns: np.ndarray) -> np.ndarray:
        steps = DIFFERENCE * np.eye(len(unknowns))
        return np.stack(
            [(function(unknowns + step) - function(unknowns - step)) / (2 * DIFFERENCE) for step in steps], axis=1
        )

    return jacobian


def _softened(misses: np.ndarray) -> np.ndarray:
    """Residuals (V * rays,) whose squares grow but linearly beyond SOFT."""
    flat = misses.ravel()
    return np.sqrt(2.0 * SOFT**2 * (np.sqrt(1.0 + (flat / SOFT) ** 2) - 1.0))


def _size(views: Sequence[View]) -> float:
    return max(float(np.hypot(*view.mask.shape)) * view.pixel_size for view in views)


def on_turntable(views: Sequence[View], table: Turntable) -> list[View]:
    """Views where a turntable puts them; a perspective camera keeps its distance from the axis."""
    placed = []
    for number, view in enumerate(views):
        rotation, translation = table.pose(number)
        placed.append(view.placed(rotation, translation + np.array([0.0, 0.0, view.translation[2]])))
    return placed
