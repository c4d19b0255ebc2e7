"""The objects: closed glass surfaces in their own frame, y up, scaled to fill a region seen by the camera."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.ndimage import gaussian_filter1d

from glint.tasks.algorithms.meshing.implicit import Field, capsule, ellipsoid, union
from glint.tasks.algorithms.simulation.solids import MATTE, Solid, bubble, moulded, turned

MARGIN = 8.0
"""Pixels between the object and the region's border."""
TILTS = {"hemisphere": 62.0, "cylinder": 6.0, "wine-glass": 14.0, "water-glass": 14.0}
"""Degrees by which the camera looks down on an object that stands; level where none is given."""


def build(shape: str, width: int, height: int, turn: float = 0.0, level: bool = False) -> list[Solid]:
    """The solids of a shape in the camera frame (x right, y up, z to the camera; pixels), its outline's centre at 0.

    turn: degrees about the upward axis, counter-clockwise from above; level: no tilt, and neither scale nor place
    depend on the turn, so that views of a turntable agree.
    """
    solids = _made(shape)
    tilt = 0.0 if level else TILTS.get(shape, 0.0)
    turned_by = _about_y(turn)
    rotation = _about_x(tilt) @ turned_by
    points = np.concatenate([solid.vertices for solid in solids if not solid.inner])
    if level:
        reach = np.hypot(points[:, 0], points[:, 2]).max()
        low, high = np.array([-reach, points[:, 1].min(), -reach]), np.array([reach, points[:, 1].max(), reach])
    else:
        points = points @ rotation.T
        low, high = points.min(axis=0), points.max(axis=0)
    factor = float(min((width - 2 * MARGIN) / (high[0] - low[0]), (height - 2 * MARGIN) / (high[1] - low[1])))
    offset = -factor * (low + high) / 2.0
    return [solid.scaled(factor).moved(rotation, offset) for solid in solids]


@cache
def _made(shape: str) -> tuple[Solid, ...]:
    return tuple(_MAKERS[shape]())


def _about_x(degrees: float) -> np.ndarray:
    """The camera looks down: the object's top comes towards it."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def _about_y(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def _revolved(profile: Sequence[tuple[float, float]], soft: float = 2.0) -> Solid:
    """A turned solid; the corners of its profile (radius, height) are rounded over about `soft` units."""
    points = np.array(profile, float)
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    fine = np.arange(0.0, length[-1], 0.5)
    smooth = np.column_stack([np.interp(fine, length, points[:, axis]) for axis in (0, 1)])
    ends = smooth[[0, -1]].copy()
    smooth = gaussian_filter1d(smooth, soft / 0.5, axis=0, mode="nearest")
    smooth[[0, -1]] = ends
    smooth[[0, -1], 0] = 0.0
    return turned(smooth, smooth=False, step=0.8)


def _hemisphere() -> list[Solid]:
    angle = np.linspace(0.0, np.pi / 2, 120)
    dome = np.column_stack([100.0 * np.cos(angle), 100.0 * np.sin(angle)])
    return [_revolved([(0.0, -12.0), (97.0, -12.0), (100.0, -9.0), *map(tuple, dome)], 1.0)]


def _cylinder() -> list[Solid]:
    return [_revolved([(0.0, -140.0), (50.0, -140.0), (50.0, 140.0), (0.0, 140.0)], 1.2)]


def _wine_glass() -> list[Solid]:
    outside = [(0, -150), (52, -150), (52, -146), (10, -140), (5, -130), (5, -50), (10, -45), (40, -20), (58, 20)]
    inside = [(58, 70), (50, 140), (47.5, 140), (55, 70), (55, 20), (38, -16), (8, -40), (0, -41)]
    return [_revolved([*outside, *inside], 1.0)]


def _water_glass() -> list[Solid]:
    return [_revolved([(0, -120), (55, -120), (70, 120), (66, 120), (51, -106), (0, -106)], 1.0)]


def _jug() -> list[Solid]:
    body: list[Field] = [
        ellipsoid((0, -35, 0), (78, 85, 78)),
        capsule((0, 20, 0), (0, 118, 0), 46.0, 50.0),
        ellipsoid((0, -116, 0), (60, 11, 60)),
    ]
    angle = np.linspace(-0.42 * np.pi, 0.42 * np.pi, 12)
    bow = np.column_stack([34 + 74 * np.cos(angle), 22 + 72 * np.sin(angle), 0 * angle])
    handle = [capsule(tuple(a), tuple(b), 10.0, 10.0) for a, b in pairwise(bow)]
    return [moulded(union(body + handle, 4.0), np.array([-82, -175, -82]), np.array([125, 175, 82]), 1.6)]


def _fish() -> list[Solid]:
    parts: list[Field] = [
        ellipsoid((0, 0, 0), (92, 56, 34)),
        ellipsoid((-98, 26, 0), (36, 24, 10)),
        ellipsoid((-98, -26, 0), (36, 24, 10)),
        ellipsoid((6, 58, 0), (40, 26, 9)),
        ellipsoid((10, -56, 0), (26, 20, 8)),
        ellipsoid((58, 16, 26), (9, 9, 9)),
    ]
    glass = moulded(union(parts, 5.0), np.array([-140, -85, -45]), np.array([100, 92, 45]), 1.4)
    low, high = np.array([-30, -16, -12]), np.array([36, 18, 12])
    core = moulded(ellipsoid((2, 0, 0), (30, 14, 10)), low, high, 1.4, MATTE)
    return [glass, _inner(core)]


def _bird() -> list[Solid]:
    parts: list[Field] = [
        ellipsoid((-6, -20, 0), (84, 50, 46)),
        ellipsoid((62, 44, 0), (36, 34, 32)),
        capsule((88, 42, 0), (118, 34, 0), 12.0, 3.0),
        capsule((-70, -6, 0), (-118, 30, 0), 26.0, 10.0),
        ellipsoid((-18, -12, 38), (46, 24, 14)),
        ellipsoid((-18, -12, -38), (46, 24, 14)),
        ellipsoid((0, -66, 0), (46, 12, 40)),
    ]
    glass = moulded(union(parts, 6.0), np.array([-135, -84, -60]), np.array([128, 84, 60]), 1.4)
    hollow = moulded(ellipsoid((6, -14, 0), (18, 14, 14)), np.array([-14, -30, -16]), np.array([26, 2, 16]), 1.4)
    return [glass, bubble(hollow)]


def _inner(solid: Solid) -> Solid:
    return replace(solid, inner=True, colour=(0.75, 0.35, 0.2))


_MAKERS = {
    "hemisphere": _hemisphere,
    "cylinder": _cylinder,
    "jug": _jug,
    "fish": _fish,
    "wine-glass": _wine_glass,
    "water-glass": _water_glass,
    "bird": _bird,
}
