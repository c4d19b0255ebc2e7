"""Glasses: the paper's wine glass and water glass, others whose feet and lips differ, and vessels with handles."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from glint.tasks.algorithms.meshing.implicit import ImplicitFunction, capsule, revolved, union

Profile = Sequence[tuple[float, float]]
"""Radius and height of the corners, from the bottom along the outside to the lip, and down the inside."""


def _flask() -> Profile:
    """Return the profile of a round flask whose wall is a twentieth of its radius thick."""
    outside, inside = (
        [(radius * np.cos(angle), radius * np.sin(angle)) for angle in np.radians(np.linspace(-72.0, 71.0, 24))]
        for radius in (64.0, 60.8)
    )
    lip = [(20.0, 68.0), (20.0, 118.0), (23.0, 122.0), (17.0, 122.0), (16.8, 66.0)]
    return [(0.0, outside[0][1]), *outside, *lip, *inside[::-1], (0.0, inside[0][1])]


GLASSES: dict[str, Profile] = {
    "wine-glass": (
        (0, -150), (52, -150), (52, -146), (10, -140), (5, -130), (5, -50), (10, -45), (40, -20), (58, 20),
        (58, 70), (50, 140), (47.5, 140), (55, 70), (55, 20), (38, -16), (8, -40), (0, -41),
    ),
    "water-glass": ((0, -120), (55, -120), (70, 120), (66, 120), (51, -106), (0, -106)),
    "goblet": (
        (0, -110), (60, -110), (60, -102), (14, -92), (8, -80), (8, -40), (16, -30), (50, 0), (62, 50),
        (60, 110), (56.5, 110), (58, 50), (46, 4), (12, -24), (0, -25),
    ),
    "tumbler": ((0, -70), (45, -70), (60, 70), (54, 70), (41, -52), (0, -54)),
    "coupe": (
        (0, -100), (48, -100), (48, -97), (8, -91), (4, -84), (4, -10), (14, 0), (50, 18), (64, 50),
        (62, 51), (48, 21), (12, 4), (0, 4),
    ),
    "flask": _flask(),
}  # fmt: skip
"""Profiles of the glasses that are made as surfaces of revolution."""
GLASS_TILT_DEG = {
    "wine-glass": 14.0,
    "water-glass": 14.0,
    "goblet": 20.0,
    "tumbler": 25.0,
    "coupe": 10.0,
    "flask": 14.0,
    "mug": 22.0,
    "tankard": 12.0,
    "pitcher": 8.0,
}
"""Angle by which the camera looks down on each."""


def _handle(
    attachments: tuple[float, float, float], reach: float, turn: float, radius: float
) -> list[ImplicitFunction]:
    """Return the rods of a handle.

    attachments: radius of the wall, and the lower and the upper height at which the handle leaves it. reach: how far it
    stands out. turn: degrees from the right towards the camera. radius: of the rods.
    """
    wall, low, high = attachments
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 12)
    out, height = wall - radius / 2 + reach * np.cos(angle), (low + high) / 2 + (high - low) / 2 * np.sin(angle)
    across, forward = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    bow = np.column_stack([out * across, height, out * forward])
    return [capsule(tuple(a), tuple(b), radius, radius) for a, b in pairwise(bow)]


def mug() -> ImplicitFunction:
    """Return a mug with a thick bottom, its handle to the right and towards the camera."""
    profile = ((0, -68), (48, -68), (50, -62), (54, 68), (50, 68), (45, -48), (0, -50))
    return union([revolved(profile, 2.0), *_handle((53.0, -34.0, 36.0), 36.0, 28.0, 7.5)], 2.0)


def tankard() -> ImplicitFunction:
    """Return a tall tankard with a foot, its handle to the left and away from the camera."""
    profile = (
        (0, -96), (58, -96), (58, -88), (46, -78), (44, -60), (52, -20), (46, 88), (42, 88), (47, -20), (39, -66),
        (0, -70),
    )  # fmt: skip
    return union([revolved(profile, 1.5), *_handle((47.0, -30.0, 66.0), 32.0, 165.0, 6.5)], 2.0)


def pitcher() -> ImplicitFunction:
    """Return a solid bellied pitcher on a foot, its handle to the right."""
    profile = (
        (0, -104), (46, -104), (46, -98), (26, -90), (30, -80), (62, -40), (66, -10), (50, 40), (34, 64), (40, 96),
        (38, 100), (0, 100),
    )  # fmt: skip
    return union([revolved(profile, 3.0), *_handle((40.0, 4.0, 84.0), 46.0, 8.0, 8.0)], 3.0)
