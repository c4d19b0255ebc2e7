"""Views whose pose nobody gave: found by how their outline and their normals fit a model of the other views.

On a turntable the angle is searched, else the rotation in all directions and the place across the line of sight. The
size of a body along a direction in the image (its support function) is what all rotations are first compared by: it is
had from the mask and from the model's vertices at once, turning in the image shifts it, and a displacement is its first
harmonic.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from glint.tasks.algorithms.multiview.epipolar_tangency import rim_points
from glint.tasks.algorithms.multiview.normal_fusion import scene_of, visible
from glint.tasks.algorithms.multiview.reconstruction import Model
from glint.tasks.algorithms.multiview.view import View, sample
from glint.tasks.algorithms.multiview.visual_hull import Outline, outline_of

DIRECTIONS, BINS = 1500, 72
"""Directions from which a body is looked at, evenly over the sphere, and turns in the image at each."""
DISTINCT = 25.0
"""Degrees between two poses from which they are different ones."""
LOOKED_AT, BETWEEN, FOLLOWED = 150, 7.5, 12
"""Rotations whose fit is looked at, degrees between them, and the best that are followed to where they fit best."""
NOWHERE = 1.0
"""Mean pixels between the outlines beyond which a view does not fit."""
CLEARLY = 1.5
"""How many times as much another pose must cost, for the best to be believed."""
RIM = 120
"""Pixels of the outline that are compared."""
PIXELS, DEGREES = 0.2, 10.0
"""Errors of an outline and of a normal that are expected of a rough model; a normal further off counts as mistaken."""
SURE = 0.5
"""Confidence from which a view's normals are compared."""
GRAZING = 0.3
"""Most cosine between normal and line of sight of a vertex that may be on the outline."""
TYPICAL, UNKNOWN, MISTAKEN = 5.0, 10.0, 30.0
"""Degrees that the median of normals is off at a true pose, that it counts if it is not known, and that it counts at
most: then it is the labels that are mistaken."""
FEWEST = 30
"""Vertices that a view must see for its normals to be compared."""
DIFFERENCE = 0.1
"""Degrees or pixels over which residuals are differentiated."""
EVALUATIONS = 12

Poses = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, slots=True)
class Fit:
    """A pose, rotation (3, 3) and translation (3,), and how a view fits a model there: `outline`, mean pixels between
    the outlines; `normals`, median degrees between the normals, NaN if too few are known; both as one cost. `angle`: on
    a turntable, its degrees."""

    rotation: np.ndarray
    translation: np.ndarray
    outline: float
    normals: float
    cost: float
    angle: float | None = None

    def apart(self, other: "Fit") -> float:
        """Degrees between two poses."""
        return float(np.degrees(Rotation.from_matrix(self.rotation @ other.rotation.T).magnitude()))


class Fitting:
    """One view against one model, from wherever it is looked at."""

    def __init__(self, view: View, model: Model) -> None:
        self.view, self.model = view, model
        self.outline: Outline = outline_of(view.mask)
        self.scene = scene_of(model.vertices, model.triangles)
        self.rim = np.column_stack(rim_points(view.mask, RIM))
        slope = self.outline.slope(*self.rim.T)[:, :2] * [1.0, -1.0]
        self.outwards = slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9)

    def at(self, rotation: np.ndarray, translation: np.ndarray) -> Fit:
        """How the view fits at a pose."""
        placed = self.view.placed(rotation, translation)
        outer, inner, off = self._parts(placed, *self._comparable(placed))
        degrees = DEGREES * float(np.median(off)) if len(off) >= FEWEST else np.nan
        outlines = sum(float((part**2).mean()) for part in _tamed(outer, inner, off)[:2])
        normals = min(degrees, MISTAKEN) if np.isfinite(degrees) else UNKNOWN
        cost = outlines + (normals / TYPICAL) ** 2
        return Fit(rotation, translation, PIXELS * float(outer.mean() + inner.mean()) / 2, degrees, cost)

    def followed(self, poses: Poses, start: np.ndarray) -> np.ndarray:
        """Where near the start (K,) the view fits best, of the poses that follow from K degrees and pixels."""
        compared = self._comparable(self.view.placed(*poses(start)))

        def residuals(unknowns: np.ndarray) -> np.ndarray:
            parts = _tamed(*self._parts(self.view.placed(*poses(unknowns)), *compared))
            return np.concatenate([part / np.sqrt(max(len(part), 1)) for part in parts])

        def jacobian(unknowns: np.ndarray) -> np.ndarray:
            steps = DIFFERENCE * np.eye(len(unknowns))
            columns = [residuals(unknowns + step) - residuals(unknowns - step) for step in steps]
            return np.stack(columns, axis=1) / (2 * DIFFERENCE)

        found = least_squares(residuals, start, jac=jacobian, max_nfev=EVALUATIONS, xtol=1e-4, ftol=1e-4)
        return np.asarray(found.x)

    def _comparable(self, placed: View) -> tuple[np.ndarray, np.ndarray]:
        """Indices of the vertices that may be on the outline, and of those whose normals the view can tell."""
        model = self.model
        grazing = np.flatnonzero(np.abs((model.normals * placed.towards(model.vertices)).sum(axis=1)) < GRAZING)
        seen = np.flatnonzero(visible(self.scene, model.vertices, model.normals, placed))
        columns, rows = placed.project(model.vertices[seen])
        return grazing, seen[sample(np.nan_to_num(placed.confidence), columns, rows) > SURE]

    def _parts(self, placed: View, grazing: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """In expected errors: how far the model's rim (G,) lies outside the outline, how far the outline's rim (R,)
        lies outside the model, how far the normals of vertices seen (S,) are off."""
        columns, rows = placed.project(self.model.vertices)
        outer = np.maximum(self.outline.at(columns[grazing], rows[grazing]), 0.0)
        shown = np.column_stack([columns, rows])
        nearest = shown[cKDTree(shown).query(self.rim)[1]]
        inner = np.maximum(((self.rim - nearest) * self.outwards).sum(axis=1), 0.0)
        normals = placed.to_world(placed.normals_at(columns[seen], rows[seen]))
        off = np.linalg.norm(normals - self.model.normals[seen], axis=1)
        return outer / PIXELS, inner / PIXELS, off / np.radians(DEGREES)


def _tamed(outer: np.ndarray, inner: np.ndarray, off: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Residuals whose squares grow but linearly: outlines beyond five expected errors; those of normals end at 1."""

    def linear(residuals: np.ndarray) -> np.ndarray:
        return 5.0 * np.sqrt(2.0 * (np.sqrt(1.0 + (residuals / 5.0) ** 2) - 1.0))

    return linear(outer), linear(inner), off / np.sqrt(1.0 + off**2)


def best_angles(view: View, model: Model, pose: Callable[[float], tuple[np.ndarray, np.ndarray]]) -> list[Fit]:
    """Fits of a view on a turntable, the best first, then others at least DISTINCT degrees from those before."""
    fitting = Fitting(view, model)
    tried = np.arange(0.0, 360.0, 5.0)
    costs = np.array([fitting.at(*pose(angle)).cost for angle in tried])
    lowest = np.flatnonzero((costs <= np.roll(costs, 1)) & (costs <= np.roll(costs, -1)))
    fits = []
    for start in lowest[np.argsort(costs[lowest])][:FOLLOWED]:
        angle = float(fitting.followed(lambda unknown: pose(float(unknown[0])), tried[[start]])[0])
        fits.append(replace(fitting.at(*pose(angle)), angle=angle % 360.0))
    return _distinct(fits)


def best_rotations(view: View, model: Model) -> list[Fit]:
    """Fits of a view of parallel rays from anywhere, the best first, then others DISTINCT from those before."""
    fitting = Fitting(view, model)
    looked_at = [fitting.at(*start) for start in _starts(view, model)]
    promising = sorted(looked_at, key=lambda fit: fit.cost)[:FOLLOWED]
    return _distinct([_refined(fitting, fit.rotation, fit.translation) for fit in promising])


def refitted(view: View, model: Model) -> View:
    """A view of parallel rays where it fits a model best, near where it is."""
    fit = _refined(Fitting(view, model), view.rotation, view.translation)
    return view.placed(fit.rotation, fit.translation)


def doubt(fits: Sequence[Fit]) -> str | None:
    """Why the first of a view's fits is not to be trusted, None if it is."""
    best = fits[0]
    if best.outline > NOWHERE:
        return f"its pose is not given, and nowhere does its outline fit by less than {best.outline:.1f} pixels"
    if len(fits) > 1 and fits[1].cost < CLEARLY * best.cost:
        other = f"turned by {best.apart(fits[1]):.0f} degrees"
        if best.angle is not None and fits[1].angle is not None:
            other = f"at {fits[1].angle:.0f} degrees of the turntable as at {best.angle:.0f}"
        return f"its pose is not given, and it fits hardly less well {other}"
    return None


def _refined(fitting: Fitting, rotation: np.ndarray, translation: np.ndarray) -> Fit:
    """The best fit near a pose, the place along the line of sight left as it is."""
    pixel = fitting.view.pixel_size
    middle = fitting.model.vertices.mean(axis=0)

    def pose(unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turned = Rotation.from_rotvec(unknowns[:3], degrees=True).as_matrix() @ rotation
        # The body turns about its own middle.
        return turned, translation + (rotation - turned) @ middle + pixel * np.array([*unknowns[3:], 0.0])

    return fitting.at(*pose(fitting.followed(pose, np.zeros(5))))


def _distinct(fits: Sequence[Fit]) -> list[Fit]:
    kept: list[Fit] = []
    for fit in sorted(fits, key=lambda fit: fit.cost):
        if all(fit.apart(other) > DISTINCT for other in kept):
            kept.append(fit)
    return kept


def _starts(view: View, model: Model) -> list[tuple[np.ndarray, np.ndarray]]:
    """Poses from which the model is as wide in all directions as the mask."""
    around = 2 * np.pi * np.arange(BINS) / BINS
    along = np.stack([np.cos(around), np.sin(around)])
    columns, rows = rim_points(view.mask, 4 * RIM)
    starts, _ = view.placed(np.eye(3), np.zeros(3)).rays(columns, rows)
    wanted = (starts[:, :2] @ along).max(axis=0)
    bases = _looking()
    widths = np.stack([((model.vertices @ basis[:2].T) @ along).max(axis=0) for basis in bases])
    plain, target = _undisplaced(widths, along), _undisplaced(wanted, along)
    alike = np.fft.irfft(np.fft.rfft(target) * np.conj(np.fft.rfft(plain, axis=1)), BINS, axis=1)
    misfit = (plain**2).sum(axis=1)[:, None] - 2 * alike
    chosen: list[np.ndarray] = []
    poses = []
    for best in np.argsort(misfit, axis=None)[: 40 * LOOKED_AT]:
        number, turn = np.unravel_index(best, misfit.shape)
        spin = Rotation.from_euler("z", around[turn]).as_matrix()
        rotation = spin @ bases[number]
        # The trace of a rotation is 1 + 2 cos of its angle.
        if chosen and np.tensordot(np.array(chosen), rotation).max() > 1 + 2 * np.cos(np.radians(BETWEEN)):
            continue
        chosen.append(rotation)
        place = 2 / BINS * along @ (wanted - np.roll(widths[number], turn))
        poses.append((rotation, np.array([*place, 0.0])))
        if len(poses) == LOOKED_AT:
            break
    return poses


def _undisplaced(widths: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Support functions (..., BINS) of bodies whose displacement is taken out."""
    return np.asarray(widths - 2 / BINS * (widths @ along.T) @ along)


def _looking() -> np.ndarray:
    """Rotations (DIRECTIONS, 3, 3), world to camera, of cameras evenly around."""
    number = np.arange(DIRECTIONS) + 0.5
    height, turn = 1 - 2 * number / DIRECTIONS, np.pi * (1 + 5**0.5) * number
    back = np.stack([np.sqrt(1 - height**2) * np.sin(turn), height, np.sqrt(1 - height**2) * np.cos(turn)], axis=1)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    return np.stack([right, np.cross(back, right), back], axis=1)
