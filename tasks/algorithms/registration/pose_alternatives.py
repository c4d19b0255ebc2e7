"""Alternatives to stated poses that contradict the views: the usual mistakes in stating them, one by one.

Angles may run the other way or have another step, or two views have each other's. Matrices may have the camera axes of
OpenCV, lead from the world to the camera, be transposed, or have translations in another unit, whose ratio follows from
the rays through the masks' centres: they all pass near the object's.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.multiview.reconstruction import coarse_model
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.epipolar_tangency import silhouette_residuals
from glint.tasks.algorithms.registration.turntable import (
    LEANS_TO_CAMERA_DEG,
    Turntable,
    calibrate_axis,
    initial_turntable,
    views_on_turntable,
)
from glint.tasks.algorithms.registration.view_agreement import MIN_CONSISTENT_SHARE, view_agreement
from glint.tasks.algorithms.registration.view_rejection import CLEAR_RESIDUAL_PX, FITTING_RESIDUAL_PX, MAX_RESIDUAL_PX

FACTORS = np.geomspace(0.5, 2.0, 95)
"""Factors of a turntable's angles that are tried: within 1%, three degrees in a full turn."""
FACTOR_RAYS = 24
"""Rays per silhouette by which factors, and pairs of views, are compared."""
MIN_FACTOR_CHANGE = 0.01
"""Change of a factor, or of a unit, from which it is one."""
MAX_UNIT_ERROR = 0.1
"""Decades by which the ratio of two units may differ from a power of ten: centres of masks are not quite one point."""
SAME_ROTATION = 0.02
"""Largest difference of two rotation matrices' entries that are the same: a degree."""
MIN_VIEWS = 5
"""Views from which an alternative proves anything: fewer agree at many poses."""

DIRECTION = "the turntable turned clockwise (negate all angles), or if the videos are mirrored (mirror them back)"

Alternative = tuple[str, list[View]]
"""What is different, to follow `all agree if`, and the views with these poses."""


def alternative_poses(views: Sequence[View], table: Turntable | None) -> str | None:
    """Return what would make all views agree in silhouettes and normals, to follow `all agree if`; None: nothing known.

    table: the turntable with the stated angles, on which all views stand; None: they have matrices.
    """
    if len(views) < MIN_VIEWS:
        return None
    candidates = _matrices(views) if table is None else _turntables(views, table)
    agreeing = {description: _largest_residual(posed) for description, posed in candidates if _agree(posed)}
    # Wrong poses may agree within the limit; right ones agree as well as any.
    limit = max(FITTING_RESIDUAL_PX, 2.0 * min(agreeing.values(), default=0.0))
    return ", or if ".join(text for text, residual in agreeing.items() if residual <= limit) or None


def silhouette_alternatives(views: Sequence[View], table: Turntable | None) -> list[Alternative]:
    """Return the usual mistakes in stating poses under which the silhouettes agree too, so that normals must decide.

    table: as of `alternative_poses`. Another step is not tried: few silhouettes agree at many.
    """
    if table is not None:
        return [(DIRECTION, _calibrated(views, -table.angles))]
    return [
        (description, posed)
        for description, posed in _matrices(views)
        if not _is_same(views, posed) and _largest_residual(posed) <= MAX_RESIDUAL_PX
    ]


def _is_same(views: Sequence[View], posed: Sequence[View]) -> bool:
    """Return whether the views stand to each other as before: another world alone is no other arrangement."""
    before, after = (
        np.array([view.rotation @ arrangement[0].rotation.T for view in arrangement]) for arrangement in (views, posed)
    )
    return bool(np.abs(before - after).max() < SAME_ROTATION)


def _largest_residual(views: Sequence[View]) -> float:
    """Return the largest mean silhouette residual of a view, in pixels."""
    return float(silhouette_residuals(views).mean(axis=1).max())


def _agree(views: Sequence[View]) -> bool:
    """Return whether silhouettes agree clearly, and normals as far as they can be compared."""
    if _largest_residual(views) > CLEAR_RESIDUAL_PX:
        return False
    try:
        agreement = view_agreement(views, coarse_model(views))
    except UnusableCapture:
        return False
    return not agreement.is_known or agreement.share >= MIN_CONSISTENT_SHARE


def _turntables(views: Sequence[View], table: Turntable) -> Iterator[Alternative]:
    """Yield the turntable turned the other way, with two views taken for each other, and with another step."""
    yield DIRECTION, _calibrated(views, -table.angles)
    first, second = _taken_for_each_other(views, table.angles)
    description = f"{views[first].name} and {views[second].name} have each other's angles (exchange these)"
    yield description, _calibrated(views, _exchanged(table.angles, first, second))
    factor = _angle_factor(views, table.angles)
    if abs(factor - 1.0) > MIN_FACTOR_CHANGE:
        step = float(np.median(np.diff(np.sort(table.angles))))
        description = f"all angles are multiplied by {factor:.2f} (steps of {factor * step:.0f} rather than {step:.0f})"
        yield description, _calibrated(views, factor * table.angles)


def _calibrated(views: Sequence[View], angles: np.ndarray) -> list[View]:
    """Return views on a turntable at given angles (V,), its axis fitted to them."""
    start = initial_turntable(views, angles.tolist())
    return views_on_turntable(views, calibrate_axis(views, start, LEANS_TO_CAMERA_DEG))


def _exchanged(angles: np.ndarray, first: int, second: int) -> np.ndarray:
    """Return angles (V,) of which two are exchanged."""
    result = angles.copy()
    result[[first, second]] = angles[[second, first]]
    return result


def _taken_for_each_other(views: Sequence[View], angles: np.ndarray) -> tuple[int, int]:
    """Return the two views with which the silhouettes agree best if their angles, of all (V,), are exchanged."""
    pairs = combinations(range(len(views)), 2)
    return min(pairs, key=lambda pair: _residual_at(views, _exchanged(angles, *pair)))


def _residual_at(views: Sequence[View], angles: np.ndarray) -> float:
    """Return the mean silhouette residual, pixels, at given angles (V,): about the best of a few axes, by few rays."""
    upright = initial_turntable(views, angles.tolist())
    tables = [replace(upright, lean_to_camera=lean) for lean in LEANS_TO_CAMERA_DEG]
    return min(float(silhouette_residuals(views_on_turntable(views, table), FACTOR_RAYS).mean()) for table in tables)


def _angle_factor(views: Sequence[View], angles: np.ndarray) -> float:
    """Return the factor of the angles (V,) at which the silhouettes agree best."""

    def residual(factor: float) -> float:
        return _residual_at(views, factor * angles)

    best = float(FACTORS[np.argmin([residual(factor) for factor in FACTORS])])
    for step in (0.004, 0.001):
        nearby = best * (1.0 + step * np.arange(-3, 4))
        best = float(nearby[np.argmin([residual(factor) for factor in nearby])])
    return best


def _matrices(views: Sequence[View]) -> Iterator[Alternative]:
    """Yield the matrices read by other conventions."""
    flipped = np.diag([1.0, -1.0, -1.0, 1.0])
    forms: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "": lambda matrix: matrix,
        "lead from the world to the camera (invert them)": np.linalg.inv,
        "have transposed rotations": _transposed,
    }
    axes = "have the camera's axes of OpenCV (negate the second and third columns)"
    for form, read in forms.items():
        for is_flipped in (False, True):
            parts = [part for part in (form, axes if is_flipped else "") if part]
            posed = [
                view.with_camera_to_world(read(view.camera_to_world) @ (flipped if is_flipped else np.eye(4)))
                for view in views
            ]
            if parts:
                yield f"the matrices {', and then '.join(parts)}", posed
            ratio = _translation_ratio(posed)
            if ratio is not None and abs(np.log(ratio)) > MIN_FACTOR_CHANGE:
                parts.append(f"have translations in another unit (multiply them by {ratio:.4g})")
                scaled = [view.with_pose(view.rotation, ratio * view.translation) for view in posed]
                yield f"the matrices {', and then '.join(parts)}", scaled


def _translation_ratio(views: Sequence[View]) -> float | None:
    """Return the factor of all translations at which the rays through the masks' centres meet best, None if unknown.

    Only parallel rays give it: with a camera matrix, the whole world scales with the translations.
    """
    if any(view.matrix is not None for view in views):
        return None
    rows, right_side = [], []
    for view in views:
        down, across = np.nonzero(view.mask)
        middle = np.array([(across.min() + across.max()) / 2]), np.array([(down.min() + down.max()) / 2])
        (start,), _ = view.with_pose(np.eye(3), np.zeros(3)).rays(*middle)
        rows.append(np.column_stack([view.rotation[:2], view.translation[:2]]))
        right_side.append(start[:2])
    # A factor is known only where the translations move the views against each other.
    solution, _, rank, _ = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right_side), rcond=1e-9)
    if rank < 4 or solution[3] <= 0.0:
        return None
    decades = np.log10(solution[3])
    return float(10.0 ** (np.round(decades) if abs(decades - np.round(decades)) < MAX_UNIT_ERROR else decades))


def _transposed(matrix: np.ndarray) -> np.ndarray:
    """Return a matrix (4, 4) with its rotation transposed."""
    result = matrix.copy()
    result[:3, :3] = matrix[:3, :3].T
    return result
