"""Shapes of simulated objects: closed glass surfaces, y up, scaled to fill the object's region in the frame.

After the objects of the paper's section 5 (hemisphere, cylinder, jug, fish, two glasses): other glasses, figurines, and
solids of flat faces. Lengths inside the makers are arbitrary units; `build_solids` scales them to pixels.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import pairwise

import numpy as np
from scipy.ndimage import gaussian_filter1d

from glint.tasks.algorithms.meshing.implicit import ImplicitFunction, capsule, ellipsoid, polyhedron, torus, union
from glint.tasks.algorithms.multiview.view import rotation_about_y
from glint.tasks.algorithms.simulation.figurines import elephant, puppy, teddy_bear
from glint.tasks.algorithms.simulation.glasses import GLASS_TILT_DEG, GLASSES, mug, pitcher, tankard
from glint.tasks.algorithms.simulation.relief import cut_bowl, hobnail_vase, ribbed_bottle
from glint.tasks.algorithms.simulation.solids import MATTE, Solid, as_cavity, from_implicit, revolve

REGION_MARGIN_PX = 8.0
"""Distance between the object and its region's border."""
TILT_DEG = {
    "hemisphere": 62.0,
    "cylinder": 6.0,
    **GLASS_TILT_DEG,
    "hobnail-vase": 14.0,
    "ribbed-bottle": 10.0,
    "cut-bowl": 24.0,
    "faceted-bottle": 22.0,
    "hexagonal-prism": 35.0,
    "cut-cube": 35.0,
    "ring": 52.0,
}
"""Angle by which the camera looks down on an upright object; 0 where none is given."""
PROFILE_STEP = 0.5
"""Spacing, in units, of the points between which a profile is smoothed."""


def build_solids(shape: str, width: int, height: int, turn: float = 0.0, level: bool = False) -> list[Solid]:
    """Build the solids of a shape in the camera frame (x right, y up, z to the camera; pixels), centred at the origin.

    Args:
        shape: a name of `options.SHAPES`.
        width, height: of the region in pixels, which the object fills except for REGION_MARGIN_PX.
        turn: degrees about the upward axis, counter-clockwise from above.
        level: no tilt, and a scale and position that do not depend on the turn, so that views of a turntable agree.
    """
    solids = untransformed_solids(shape)
    tilt = 0.0 if level else TILT_DEG.get(shape, 0.0)
    rotation = _rotation_x(tilt) @ rotation_about_y(turn)
    points = np.concatenate([solid.vertices for solid in solids if not solid.inner])
    if level:
        radius = np.hypot(points[:, 0], points[:, 2]).max()
        low, high = np.array([-radius, points[:, 1].min(), -radius]), np.array([radius, points[:, 1].max(), radius])
    else:
        points = points @ rotation.T
        low, high = points.min(axis=0), points.max(axis=0)
    factor = float(
        min((width - 2 * REGION_MARGIN_PX) / (high[0] - low[0]), (height - 2 * REGION_MARGIN_PX) / (high[1] - low[1]))
    )
    offset = -factor * (low + high) / 2.0
    return [solid.scaled(factor).transformed(rotation, offset) for solid in solids]


@cache
def untransformed_solids(shape: str) -> tuple[Solid, ...]:
    """Return the solids of a shape in its own frame, where y is upwards; made once."""
    return tuple(MAKERS[shape]())


def _rotation_x(degrees: float) -> np.ndarray:
    """Return the rotation (3, 3) about x: positive angles bring the object's top towards the camera."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def _revolve_rounded(profile: Sequence[tuple[float, float]], rounding: float) -> Solid:
    """Return the solid of revolution of a profile (radius, height) whose corners are rounded over `rounding` units."""
    points = np.array(profile, float)
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    fine = np.arange(0.0, length[-1], PROFILE_STEP)
    smooth = np.column_stack([np.interp(fine, length, points[:, axis]) for axis in (0, 1)])
    # Smoothing must not move the ends off the axis.
    ends = smooth[[0, -1]].copy()
    smooth = gaussian_filter1d(smooth, rounding / PROFILE_STEP, axis=0, mode="nearest")
    smooth[[0, -1]] = ends
    smooth[[0, -1], 0] = 0.0
    return revolve(smooth)


def _hemisphere() -> list[Solid]:
    angle = np.linspace(0.0, np.pi / 2, 120)
    dome = np.column_stack([100.0 * np.cos(angle), 100.0 * np.sin(angle)])
    return [_revolve_rounded([(0.0, -12.0), (97.0, -12.0), (100.0, -9.0), *map(tuple, dome)], 1.0)]


def _cylinder() -> list[Solid]:
    return [_revolve_rounded([(0.0, -140.0), (50.0, -140.0), (50.0, 140.0), (0.0, 140.0)], 1.2)]


def _glass(name: str) -> list[Solid]:
    return [_revolve_rounded(GLASSES[name], 1.0)]


def _jug() -> list[Solid]:
    body: list[ImplicitFunction] = [
        ellipsoid((0, -35, 0), (78, 85, 78)),
        capsule((0, 20, 0), (0, 118, 0), 46.0, 50.0),
        ellipsoid((0, -116, 0), (60, 11, 60)),
    ]
    angle = np.linspace(-0.42 * np.pi, 0.42 * np.pi, 12)
    bow = np.column_stack([34 + 74 * np.cos(angle), 22 + 72 * np.sin(angle), 0 * angle])
    handle = [capsule(tuple(a), tuple(b), 10.0, 10.0) for a, b in pairwise(bow)]
    return [from_implicit(union(body + handle, 4.0), np.array([-82, -175, -82]), np.array([125, 175, 82]), 1.6)]


def _fish() -> list[Solid]:
    parts: list[ImplicitFunction] = [
        ellipsoid((0, 0, 0), (92, 56, 34)),
        ellipsoid((-98, 26, 0), (36, 24, 10)),
        ellipsoid((-98, -26, 0), (36, 24, 10)),
        ellipsoid((6, 58, 0), (40, 26, 9)),
        ellipsoid((10, -56, 0), (26, 20, 8)),
        ellipsoid((58, 16, 26), (9, 9, 9)),
    ]
    glass = from_implicit(union(parts, 5.0), np.array([-140, -85, -45]), np.array([100, 92, 45]), 1.4)
    low, high = np.array([-30, -16, -12]), np.array([36, 18, 12])
    core = from_implicit(ellipsoid((2, 0, 0), (30, 14, 10)), low, high, 1.4, MATTE)
    # An opaque inclusion is no part of the outer surface.
    return [glass, replace(core, inner=True)]


def _bird() -> list[Solid]:
    parts: list[ImplicitFunction] = [
        ellipsoid((-6, -20, 0), (84, 50, 46)),
        ellipsoid((62, 44, 0), (36, 34, 32)),
        capsule((88, 42, 0), (118, 34, 0), 12.0, 3.0),
        capsule((-70, -6, 0), (-118, 30, 0), 26.0, 10.0),
        ellipsoid((-18, -12, 38), (46, 24, 14)),
        ellipsoid((-18, -12, -38), (46, 24, 14)),
        ellipsoid((0, -66, 0), (46, 12, 40)),
    ]
    glass = from_implicit(union(parts, 6.0), np.array([-135, -84, -60]), np.array([128, 84, 60]), 1.4)
    hollow = from_implicit(ellipsoid((6, -14, 0), (18, 14, 14)), np.array([-14, -30, -16]), np.array([26, 2, 16]), 1.4)
    return [glass, as_cavity(hollow)]


def _ring_of_planes(sides: int, elevation: float, distance: float, turn: float) -> list[tuple[float, ...]]:
    """Return the faces (n_x, n_y, n_z, distance) of a ring about the y axis; angles in degrees, 0 faces the camera."""
    up, out = np.sin(np.radians(elevation)), np.cos(np.radians(elevation))
    angles = np.radians(turn) + 2.0 * np.pi * np.arange(sides) / sides
    return [(out * np.sin(angle), up, out * np.cos(angle), distance) for angle in angles]


def _faceted_bottle() -> list[Solid]:
    """Return an octagonal bottle of solid glass, with slanting shoulders and a round neck under a faceted stopper."""
    body = [*_ring_of_planes(8, 0.0, 60.0, 12.0), *_ring_of_planes(8, 48.0, 88.0, 12.0)]
    stopper = [*_ring_of_planes(6, 0.0, 26.0, 20.0), (0.0, 1.0, 0.0, 150.0), (0.0, -1.0, 0.0, -112.0)]
    glass = union(
        [
            polyhedron([*body, (0.0, -1.0, 0.0, 110.0)], 1.0),
            capsule((0, 60, 0), (0, 120, 0), 18.0, 18.0),
            polyhedron(stopper, 1.0),
        ],
        1.5,
    )
    return [from_implicit(glass, np.array([-72, -116, -72]), np.array([72, 156, 72]), 1.6)]


def _hexagonal_prism() -> list[Solid]:
    faces = [*_ring_of_planes(6, 0.0, 70.0, 20.0), (0.0, 1.0, 0.0, 60.0), (0.0, -1.0, 0.0, 60.0)]
    return [from_implicit(polyhedron(faces, 1.2), np.full(3, -90.0), np.full(3, 90.0), 2.5)]


def _cut_cube() -> list[Solid]:
    faces = [*_ring_of_planes(4, 0.0, 70.0, 33.0), (0.0, 1.0, 0.0, 70.0), (0.0, -1.0, 0.0, 70.0)]
    corners = [*_ring_of_planes(4, 35.26, 92.0, 78.0), *_ring_of_planes(4, -35.26, 92.0, 78.0)]
    return [from_implicit(polyhedron([*faces, *corners], 1.2), np.full(3, -100.0), np.full(3, 100.0), 2.5)]


def _gem() -> list[Solid]:
    """Return a convex solid of 22 faces in arbitrary directions, at least 32 degrees from one another."""
    generator, faces = np.random.default_rng(2), np.zeros((0, 3))
    while len(faces) < 22:
        face = generator.normal(size=3)
        face /= np.linalg.norm(face)
        if (faces @ face < np.cos(np.radians(32.0))).all():
            faces = np.vstack([faces, face])
    planes = [(*face, 70.0 + 15.0 * generator.random()) for face in faces]
    return [from_implicit(polyhedron(planes, 2.0), np.full(3, -120.0), np.full(3, 120.0), 2.5)]


_IMPLICIT: dict[str, tuple[Callable[[], ImplicitFunction], Sequence[int], Sequence[int], float]] = {
    "mug": (mug, (-64, -74, -64), (100, 74, 80), 1.4),
    "tankard": (tankard, (-92, -102, -64), (64, 94, 64), 1.4),
    "pitcher": (pitcher, (-74, -112, -74), (102, 108, 74), 1.4),
    "hobnail-vase": (hobnail_vase, (-66, -94, -66), (66, 92, 66), 1.2),
    "ribbed-bottle": (ribbed_bottle, (-64, -96, -64), (64, 102, 64), 1.2),
    "cut-bowl": (cut_bowl, (-76, -64, -76), (76, 66, 76), 1.2),
    "puppy": (puppy, (-72, -124, -50), (70, 106, 86), 1.6),
    "teddy-bear": (teddy_bear, (-80, -122, -60), (98, 110, 112), 1.6),
    "ring": (partial(torus, 64.0, 24.0), (-94, -30, -94), (94, 30, 94), 1.6),
    "elephant": (elephant, (-102, -118, -62), (140, 74, 62), 1.6),
}
"""Makers of single solids, the corners of the box that each is meshed in, and the edge of its cells."""


def _from_table(name: str) -> list[Solid]:
    maker, low, high, cell = _IMPLICIT[name]
    return [from_implicit(maker(), np.array(low), np.array(high), cell)]


MAKERS: dict[str, Callable[[], list[Solid]]] = {
    "hemisphere": _hemisphere,
    "cylinder": _cylinder,
    "jug": _jug,
    "fish": _fish,
    **{name: partial(_glass, name) for name in GLASSES},
    **{name: partial(_from_table, name) for name in _IMPLICIT},
    "bird": _bird,
    "faceted-bottle": _faceted_bottle,
    "hexagonal-prism": _hexagonal_prism,
    "cut-cube": _cut_cube,
    "gem": _gem,
}
"""Makers of the solids of each shape, in its own frame."""
