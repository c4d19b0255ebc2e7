"""Pose search: the pose of a view on a model of the other views, by the fit of silhouette and normals.

On a turntable the angle is searched, otherwise the rotation in all directions and the translation across the line of
sight. Rotations are first ranked by the silhouette's support function (its extent along each image direction): it
follows at once from the mask and from the model's vertices, a rotation in the image shifts it, and a translation is its
first harmonic (Schneider, Convex Bodies: The Brunn-Minkowski Theory, 1993). The shift is found by Fourier correlation.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.pose_fit import SILHOUETTE_PIXELS, PoseFit, PoseFitter

N_VIEW_DIRECTIONS, N_IMAGE_ROTATIONS = 1500, 72
"""Directions of the camera, evenly over the sphere, and rotations in the image for each, that are ranked."""
MIN_SEPARATION_DEG = 25.0
"""Degrees between two poses from which they count as different."""
N_STARTS, START_SPACING_DEG, N_REFINED = 150, 7.5, 12
"""Rotations whose fit is evaluated, the least degrees between them, and the number of the best that are refined."""
CANDIDATES_PER_START = 40
"""Ranked rotations that are looked through for each start: most lie too near to a better one."""
ANGLE_STEP_DEG = 5.0
"""Step of the search over a turntable's angles."""
MAX_MISMATCH_PX = 1.0
"""Mean pixels between the silhouettes beyond which a view does not fit."""
AMBIGUITY_RATIO = 1.5
"""The second best pose must cost this many times as much as the best for the best to be accepted."""


def search_angles(view: View, model: Model, pose: Callable[[float], tuple[np.ndarray, np.ndarray]]) -> list[PoseFit]:
    """Return the fits of a view on a turntable, at least MIN_SEPARATION_DEG from each other, the best first.

    pose: rotation (3, 3) and translation (3,), world to camera, as a function of the angle in degrees.
    """
    fitter = PoseFitter(view, model)
    candidates = np.arange(0.0, 360.0, ANGLE_STEP_DEG)
    costs = np.array([fitter.evaluate(*pose(angle)).cost for angle in candidates])
    minima = np.flatnonzero((costs <= np.roll(costs, 1)) & (costs <= np.roll(costs, -1)))
    fits = []
    for start in minima[np.argsort(costs[minima])][:N_REFINED]:
        angle = float(fitter.refine(lambda unknown: pose(float(unknown[0])), candidates[[start]])[0])
        fits.append(replace(fitter.evaluate(*pose(angle)), angle=angle % 360.0))
    return _distinct(fits)


def search_rotations(view: View, model: Model) -> list[PoseFit]:
    """Return the fits of an orthographic view at any rotation, MIN_SEPARATION_DEG from each other, the best first."""
    fitter = PoseFitter(view, model)
    evaluated = [fitter.evaluate(*start) for start in _initial_poses(view, model)]
    promising = sorted(evaluated, key=lambda fit: fit.cost)[:N_REFINED]
    return _distinct([_refine_fit(fitter, fit.rotation, fit.translation) for fit in promising])


def refine_pose(view: View, model: Model) -> View:
    """Return an orthographic view at the pose near its own at which it fits the model best."""
    fit = _refine_fit(PoseFitter(view, model), view.rotation, view.translation)
    return view.with_pose(fit.rotation, fit.translation)


def ambiguity(fits: Sequence[PoseFit]) -> str | None:
    """Return the reason why the first of a view's fits is not acceptable, None if it is."""
    best = fits[0]
    if best.silhouette_px > MAX_MISMATCH_PX:
        return f"its pose is not given, and its silhouette fits nowhere by less than {best.silhouette_px:.1f} pixels"
    if len(fits) > 1 and fits[1].cost < AMBIGUITY_RATIO * best.cost:
        alternative = f"turned by {best.angle_to(fits[1]):.0f} degrees"
        if best.angle is not None and fits[1].angle is not None:
            alternative = f"at {fits[1].angle:.0f} degrees of the turntable as at {best.angle:.0f}"
        return f"its pose is not given, and it fits almost as well {alternative}"
    return None


def _refine_fit(fitter: PoseFitter, rotation: np.ndarray, translation: np.ndarray) -> PoseFit:
    """Return the best fit near a pose; the translation along the line of sight is kept, as it changes nothing."""
    pixel = fitter.view.pixel_size
    centre = fitter.model.vertices.mean(axis=0)

    def pose(unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turned = Rotation.from_rotvec(unknowns[:3], degrees=True).as_matrix() @ rotation
        # Rotate about the model's centre, so that rotation and translation are nearly independent.
        return turned, translation + (rotation - turned) @ centre + pixel * np.array([*unknowns[3:], 0.0])

    return fitter.evaluate(*pose(fitter.refine(pose, np.zeros(5))))


def _distinct(fits: Sequence[PoseFit]) -> list[PoseFit]:
    """Return the fits by cost, without those within MIN_SEPARATION_DEG of a better one."""
    kept: list[PoseFit] = []
    for fit in sorted(fits, key=lambda fit: fit.cost):
        if all(fit.angle_to(better) > MIN_SEPARATION_DEG for better in kept):
            kept.append(fit)
    return kept


def _initial_poses(view: View, model: Model) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return up to N_STARTS poses at which the model's support function is most similar to the mask's."""
    azimuth = 2 * np.pi * np.arange(N_IMAGE_ROTATIONS) / N_IMAGE_ROTATIONS
    directions = np.stack([np.cos(azimuth), np.sin(azimuth)])
    columns, rows = view.silhouette_pixels(4 * SILHOUETTE_PIXELS)
    starts, _ = view.with_pose(np.eye(3), np.zeros(3)).rays(columns, rows)
    mask_support = (starts[:, :2] @ directions).max(axis=0)
    bases = _fibonacci_rotations(N_VIEW_DIRECTIONS)
    supports = np.stack([((model.vertices @ basis[:2].T) @ directions).max(axis=0) for basis in bases])
    # Squared differences for all rotations in the image at once: a circular correlation.
    centred, target = _centred(supports, directions), _centred(mask_support, directions)
    spectrum = np.fft.rfft(target) * np.conj(np.fft.rfft(centred, axis=1))
    correlation = np.fft.irfft(spectrum, N_IMAGE_ROTATIONS, axis=1)
    mismatch = (centred**2).sum(axis=1)[:, None] - 2 * correlation
    chosen: list[np.ndarray] = []
    poses = []
    for best in np.argsort(mismatch, axis=None)[: CANDIDATES_PER_START * N_STARTS]:
        number, shift = np.unravel_index(best, mismatch.shape)
        spin = Rotation.from_euler("z", azimuth[shift]).as_matrix()
        rotation = spin @ bases[number]
        # The trace of a rotation is 1 + 2 cos of its angle.
        max_trace = 1 + 2 * np.cos(np.radians(START_SPACING_DEG))
        if chosen and np.tensordot(np.array(chosen), rotation).max() > max_trace:
            continue
        chosen.append(rotation)
        # The first harmonic of the difference of the support functions is the translation.
        translation = 2 / N_IMAGE_ROTATIONS * directions @ (mask_support - np.roll(supports[number], shift))
        poses.append((rotation, np.array([*translation, 0.0])))
        if len(poses) == N_STARTS:
            break
    return poses


def _centred(supports: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return support functions (..., N_IMAGE_ROTATIONS) without their first harmonic: bodies moved to the origin."""
    harmonic = 2 / N_IMAGE_ROTATIONS * (supports @ directions.T) @ directions
    return np.asarray(supports - harmonic)


def _fibonacci_rotations(count: int) -> np.ndarray:
    """Return rotations (count, 3, 3), world to camera, of cameras on a Fibonacci sphere (Gonzalez 2010)."""
    number = np.arange(count) + 0.5
    height, azimuth = 1 - 2 * number / count, np.pi * (1 + 5**0.5) * number
    radius = np.sqrt(1 - height**2)
    backward = np.stack([radius * np.sin(azimuth), height, radius * np.cos(azimuth)], axis=1)
    right = np.cross([0.0, 1.0, 0.0], backward)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    return np.stack([right, np.cross(backward, right), backward], axis=1)
