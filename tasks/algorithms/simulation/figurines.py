"""Figurines whose limbs overlap: each shows occluding contours inside its silhouette. Implicit functions, y up."""

from itertools import pairwise

import numpy as np

from glint.tasks.algorithms.meshing.implicit import ImplicitFunction, capsule, ellipsoid, union


def puppy() -> ImplicitFunction:
    """Return a sitting puppy: forelegs across its belly, a hind leg before the other, hanging ears before the head."""
    parts = [
        ellipsoid((0, -26, 0), (54, 62, 44)),
        ellipsoid((2, 62, 4), (42, 38, 36)),
        ellipsoid((-34, 50, 34), (13, 30, 8)),
        ellipsoid((38, 48, 30), (13, 30, 8)),
        capsule((-52, 10, 22), (14, -14, 68), 15.0, 12.0),
        capsule((52, 4, 18), (2, -52, 62), 15.0, 12.0),
        capsule((-40, -76, 12), (38, -92, 64), 19.0, 15.0),
        capsule((40, -72, 2), (-52, -104, 26), 19.0, 15.0),
    ]
    return union(parts, 4.0)


def teddy_bear() -> ImplicitFunction:
    """Return a sitting bear: an arm across its belly, a foot and a muzzle before the body, ears before the head."""
    parts = [
        ellipsoid((0, -30, 0), (55, 62, 46)),
        ellipsoid((4, 58, 4), (42, 37, 36)),
        ellipsoid((10, 48, 38), (18, 14, 16)),
        ellipsoid((-27, 88, 16), (16, 17, 8)),
        ellipsoid((37, 86, 12), (16, 17, 8)),
        capsule((-50, 10, 22), (12, -22, 66), 16.0, 13.0),
        capsule((50, 8, 8), (76, -48, 30), 15.0, 13.0),
        capsule((-26, -74, 20), (-46, -90, 82), 22.0, 21.0),
        capsule((28, -74, 20), (64, -92, 58), 21.0, 19.0),
    ]
    return union(parts, 4.0)


def elephant() -> ImplicitFunction:
    """Return an elephant seen from its side: ear, tusk and near legs before what lies behind them."""
    trunk = np.array([(98, 12, 0), (116, -14, 4), (112, -52, 16), (92, -76, 22)], float)
    parts = [
        ellipsoid((-12, 0, 0), (82, 54, 48)),
        ellipsoid((76, 26, 0), (38, 40, 34)),
        ellipsoid((54, 24, 44), (27, 36, 8)),
        ellipsoid((54, 24, -44), (27, 36, 8)),
        capsule((92, -2, 22), (124, -26, 44), 7.5, 4.0),
        capsule((44, -14, 28), (50, -92, 34), 22.0, 18.0),
        capsule((-54, -14, 28), (-60, -92, 34), 23.0, 18.0),
        capsule((20, -14, -26), (14, -92, -30), 22.0, 18.0),
        capsule((-30, -14, -26), (-26, -92, -30), 22.0, 18.0),
        *[capsule(tuple(a), tuple(b), 15.0 - 2.5 * i, 12.5 - 2.5 * i) for i, (a, b) in enumerate(pairwise(trunk))],
    ]
    return union(parts, 4.0)
